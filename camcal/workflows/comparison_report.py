"""The pages of `camcal verify` and `camcal regress`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from camcal.formats.output import write_atomically
from camcal.workflows.report import now

if TYPE_CHECKING:
    from camcal.workflows.regress import Figure, Regression
    from camcal.workflows.verify import Verification


def write_comparison(
    page: Path, found: Verification, names: tuple[str, str], size: tuple[int, int], gates: Mapping[str, float | None]
) -> None:
    """Write the page of a verification.

    Parameters
    ----------
    page : Path
    found : Verification
    names : tuple of str
        Estimate and truth as the user named them.
    size : tuple of int
        Image (width, height) in pixels.
    gates : dict of str to float or None
        Limits by option; None where a gate was not asked for.
    """
    # matplotlib and jinja2 take their time to import.
    from camcal.report.comparison_pages import Comparison, comparison_page

    asked = {option: limit for option, limit in gates.items() if limit is not None}
    compared = Comparison(*names, size, found.projection, found.parameters, found.views, found.problems, asked, now())
    write_atomically(page, comparison_page(compared))


def write_suite(page: Path, suite: Regression, figures: Sequence[Figure], before: Mapping[str, Mapping[str, float]]) -> None:
    """Write the page of the accuracy suite; `before` is the baseline's figures by scenario, empty if there is none."""
    from camcal.report.comparison_pages import Scenario, Suite, suite_page

    scenarios = tuple(
        Scenario(result.name, result.figures, before.get(result.name, {}), result.seconds, result.problems)
        for result in suite.results
    )
    baseline = suite.baseline.name if suite.baseline is not None and before else ""
    titles = {figure.name: figure.title for figure in figures}
    write_atomically(page, suite_page(Suite(scenarios, titles, baseline, now())))
