"""The pages of comparisons: an estimate against the truth, and the accuracy suite against its baseline."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup

from camcal.compare.parameters import ParameterError
from camcal.compare.projection import ProjectionDifference
from camcal.compare.views import ViewErrors
from camcal.report.comparison_figures import difference_figure, errors_figure, suite_figure
from camcal.report.figures.rendering import render_svg
from camcal.report.figures.style import STYLES
from camcal.report.page import Drawing, render_page
from camcal.rounding import as_given, rounded, spread
from camcal.trust.wording import rounded as short

_MEANINGS = {
    "passed": "Nothing that was asked for is missed.",
    "failed": "Not good enough, for the reasons below.",
    "compared": "No gate was asked for: the figures tell how far the two are apart.",
    "measured": "There is no baseline to hold the figures against.",
}
_LEVELS = {"passed": "good", "failed": "rejected", "compared": "note", "measured": "note"}
_IDEAL_ONE = ("corner_rms_over_bound", "projection_over_sigma")
"""Figures of the suite that would be 1 if everything were as good as it can be."""


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """An estimate against the truth.

    Attributes
    ----------
    estimate, truth : str
        What was compared, for people.
    size : tuple of int
        Image (width, height) in pixels.
    projection : ProjectionDifference
    parameters : tuple of ParameterError
    views : ViewErrors or None
    problems : tuple of str
        Why it is not good enough.
    gates : dict of str to float
        Options that were asked for, and their limits.
    made_on : str
        Date and time for people; empty to leave it out.
    """

    estimate: str
    truth: str
    size: tuple[int, int]
    projection: ProjectionDifference
    parameters: tuple[ParameterError, ...]
    views: ViewErrors | None
    problems: tuple[str, ...]
    gates: Mapping[str, float] = field(default_factory=dict)
    made_on: str = ""


@dataclass(frozen=True, slots=True)
class Scenario:
    """One scenario of the suite: its figures by name, those of its baseline, and which of them are worse."""

    name: str
    figures: Mapping[str, float]
    baseline: Mapping[str, float]
    seconds: float
    problems: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Suite:
    """The accuracy suite.

    Attributes
    ----------
    scenarios : tuple of Scenario
    titles : dict of str to str
        Of the figures, by name, in their order.
    baseline : str
        Name of the file that they were held against; empty if there is none.
    made_on : str
        Date and time for people; empty to leave it out.
    """

    scenarios: tuple[Scenario, ...]
    titles: Mapping[str, str]
    baseline: str = ""
    made_on: str = ""


def comparison_page(compared: Comparison) -> str:
    """Build the page of `camcal verify`."""
    word = "failed" if compared.problems else "passed" if compared.gates else "compared"
    p = compared.projection
    known = [error.error_in_sigma for error in compared.parameters if error.sigma > 0]
    glance = {
        "projection, mean": f"{short(p.mean_px)} px",
        "projection, largest": f"{short(p.max_px)} px",
        "compared over": f"{100 * p.compared_share:.0f} % of the image",
    }
    if known:
        glance["worst parameter"] = f"{max(map(abs, known)):.2g} std. dev."
    drawings = [
        _drawing(
            "difference",
            "Projection difference over the image",
            difference_figure(compared.size, p, STYLES["page"]),
            "Good: short arrows, below what the estimate says of its own uncertainty. Far points are compared, after the "
            "rotation between the two cameras is fitted and removed; hatched parts are seen by one of them only.",
        )
    ]
    if known:
        drawings.append(
            _drawing(
                "errors",
                "Parameters in standard deviations",
                errors_figure(compared.parameters, STYLES["page"], compared.gates.get("--max-sigma")),
                "Good: most bars within 2, and none beyond 4: then the standard deviations are honest.",
            )
        )
    return render_page(
        "comparison.html.j2",
        {
            "title": f"{compared.estimate}: {word}",
            "word": word,
            "level": _LEVELS[word],
            "meaning": _MEANINGS[word],
            "glance": glance,
            "compared": compared,
            "rows": tuple(map(_parameter_row, compared.parameters)),
            "views": {} if compared.views is None else _view_facts(compared.views),
            "drawings": drawings,
        },
    )


def suite_page(suite: Suite) -> str:
    """Build the page of `camcal regress`."""
    failed = [scenario for scenario in suite.scenarios if scenario.problems]
    word = "failed" if failed else "passed" if suite.baseline else "measured"
    panels = tuple(
        (
            title,
            np.array([scenario.figures[name] for scenario in suite.scenarios]),
            np.array([scenario.baseline.get(name, math.nan) for scenario in suite.scenarios]),
        )
        for name, title in suite.titles.items()
        if name in _IDEAL_ONE
    )
    drawn = suite_figure(tuple(scenario.name for scenario in suite.scenarios), panels, STYLES["page"])
    return render_page(
        "suite.html.j2",
        {
            "title": f"Accuracy: {word}",
            "word": word,
            "level": _LEVELS[word],
            "meaning": _MEANINGS[word],
            "glance": {
                "scenarios": str(len(suite.scenarios)),
                "worse than the baseline": str(len(failed)) if suite.baseline else "unknown",
                "time": f"{sum(scenario.seconds for scenario in suite.scenarios):.0f} s",
            },
            "suite": suite,
            "rows": tuple(_figure_row(suite, name) for name in suite.titles),
            "drawing": _drawing(
                "suite",
                "Against the ideal",
                drawn,
                "Good: bars at 1. Corners cannot be more exact than the bound (Cramér-Rao) says, and cameras should be as "
                "far off as their uncertainty predicts.",
            ),
        },
    )


def _drawing(name: str, title: str, figure: object, caption: str) -> Drawing:
    return Drawing(name, title, Markup(render_svg(figure, name)), caption)  # type: ignore[arg-type]


def _parameter_row(error: ParameterError) -> tuple[str, str, str, str, str, str, bool]:
    """Name, truth, estimate, its standard deviation, the error, that in standard deviations, and whether it is large."""
    known = error.sigma > 0
    return (
        error.name,
        as_given(error.truth, error.sigma),
        rounded(error.estimate, error.sigma),
        spread(error.sigma),
        rounded(error.error, error.sigma, "+") if known else f"{error.error:+.2g}",
        f"{error.error_in_sigma:+.2f}" if known else "-",
        known and abs(error.error_in_sigma) > 4,
    )


def _view_facts(views: ViewErrors) -> dict[str, str]:
    """What the views that both have in common tell."""
    x, y = views.corner_bias_px
    facts = {
        "Views": f"{views.views} in both, {views.corners} corners",
        "Corner error, RMS per axis": _known(views.corner_rms_px, "px"),
        "Corner bias": "" if math.isnan(x) else f"{x:+.4f} px along x, {y:+.4f} px along y",
        "Largest corner error": _known(views.corner_max_px, "px"),
        "Board rotation error, RMS": _known(views.rotation_deg, "°"),
        "Board position error, RMS": _known(1000 * views.translation_m, "mm"),
    }
    return {name: fact for name, fact in facts.items() if fact}


def _known(value: float, unit: str) -> str:
    return "" if math.isnan(value) else f"{value:.3g} {unit}"


def _figure_row(suite: Suite, name: str) -> tuple[str, tuple[tuple[str, str, bool], ...]]:
    """A figure's title, and for each scenario its value, that of the baseline, and whether it is worse."""
    cells = []
    for scenario in suite.scenarios:
        before = f"{scenario.baseline[name]:.4g}" if name in scenario.baseline else ""
        worse = any(problem.startswith(f"{name} ") for problem in scenario.problems)
        cells.append((f"{scenario.figures[name]:.4g}", before, worse))
    return suite.titles[name], tuple(cells)
