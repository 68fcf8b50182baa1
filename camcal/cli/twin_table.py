"""What a person reads of the twins of a capture: the errors actually made, beside those that were predicted."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from camcal.cli.console import print_facts, print_table
from camcal.rounding import point_in_line, rounded, spread

if TYPE_CHECKING:
    from camcal.compare.twins import TwinErrors
    from camcal.workflows.twin import Twin

_MOST_NAMED = 2
_SMALL_RATIO = 0.095
_PLACES = {"centre": "centre, px", "edges": "mid-edges, px", "corners": "corners, px", "image": "image, px"}


def print_twin(twin: Twin) -> None:
    """Print what the twins of a capture got wrong, and how many could not be calibrated.

    Parameters
    ----------
    twin : Twin
    """
    rendered = f"this capture rendered {_times(twin.count)} and calibrated from its pixels"
    if twin.errors is not None:
        _print_errors(f"Twin: {rendered}", twin.errors)
    print_facts(
        {
            "error": _ratio(twin.errors) if twin.errors is not None else "",
            "": twin.errors.meaning if twin.errors is not None else "",
            "RMS": _rms(twin) if twin.errors is not None else "",
            "lost": _first_few([f"{source} in {reason}" for source, reason in twin.lost.items()]),
            "failed": _failed(twin),
        }
    )


def _print_errors(title: str, errors: TwinErrors) -> None:
    """Print a row for each parameter, and one for the projection in each part of the image."""
    rows = [(p.name, p.predicted, p.actual, p.ratio) for p in errors.parameters]
    rows += [(_PLACES[p.place], p.predicted_px, p.actual_px, p.ratio) for p in errors.projection if not math.isnan(p.ratio)]
    names, predicted, actual, ratios = zip(*rows, strict=True)
    places = 2 if min(ratios) >= _SMALL_RATIO else 3
    columns = (
        names,
        point_in_line([spread(value) for value in predicted]),
        point_in_line([spread(value) for value in actual]),
        [f"{value:.{places}f}" for value in ratios],
    )
    print_table(title, ("", "predicted ±", "actual", "ratio"), list(zip(*columns, strict=True)))


def _ratio(errors: TwinErrors) -> str:
    """Write the one number."""
    doubt = errors.ratio * errors.ratio_error
    where = "the image" if errors.compared_share == 1 else f"the {100 * errors.compared_share:.0f} % of the image that all see"
    return f"{rounded(errors.ratio, doubt)} ± {spread(doubt)} times the predicted one, over {where}:"


def _rms(twin: Twin) -> str:
    """Compare the residuals of the twins with those of the photographs."""
    twins = f"{spread(twin.rms_px)} px over {twin.corners:.0f} corners"
    return f"{twins}; of the photographs {spread(twin.photographs_rms_px)} px over {twin.photographs_corners}"


def _failed(twin: Twin) -> str:
    """Say how many twins could not be calibrated, and why the first could not."""
    return f"{len(twin.failures)} of {twin.count}: {twin.failures[0]}" if twin.failures else ""


def _first_few(texts: Sequence[str]) -> str:
    """Join the first few texts, and count the others."""
    more = len(texts) - _MOST_NAMED
    return "; ".join(texts[:_MOST_NAMED]) + (f"; and {more} more" if more > 0 else "")


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
