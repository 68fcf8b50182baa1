"""`camcal regress`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, fitted, print_json, print_table
from camcal.errors import QualityError

if TYPE_CHECKING:
    from camcal.workflows.regress import Regression

_OF_CAMERA = ("projection", "worst_parameter")
_SHARE = "detected_share"
_HEADINGS = {
    "views": "views",
    _SHARE: "found",
    "corner_rms_px": "RMS, px",
    "corner_rms_over_bound": "/ bound",
    "corner_max_over_bound": "max / bound",
    "corner_bias_px": "bias, px",
    "projection_mean_px": "mean px",
    "projection_max_px": "max px",
    "projection_over_sigma": "/ predicted",
    "worst_parameter_sigma": "worst / sigma",
}
"""Headings of the figures that are shorter than their titles."""
_LONGEST_NAME = 20


@click.command(cls=options.Command, epilog="Example: camcal regress webcam_720p --baseline baseline.json --update-baseline")
@click.argument("configs", nargs=-1, metavar="[CONFIG]...")
@click.option("--baseline", metavar="FILE", help="Figures to hold the run against, as JSON.")
@click.option("--update-baseline", is_flag=True, help="Write this run's figures to the baseline instead.")
@click.option("--junit", metavar="FILE", help="Write the results as JUnit XML as well; only JUnit XML is replaced.")
@options.html
@options.refine
@options.jobs
@options.as_json
@options.help_option
def regress(
    *,
    configs: tuple[str, ...],
    baseline: str | None,
    update_baseline: bool,
    junit: str | None,
    html: str | None,
    refine: str,
    jobs: int | None,
    as_json: bool,
) -> None:
    """Run the accuracy suite: render, calibrate from pixels, compare with the truth.

    CONFIG is a scenario file or the name of a shipped scenario; all shipped ones by default. Exit code 5 when a figure is
    worse than the baseline by more than its slack, naming scenario and figure.
    """
    from camcal.workflows.regress import regress as run_suite

    suite = run_suite(
        configs,
        baseline=baseline,
        update_baseline=update_baseline,
        junit=junit,
        html=html,
        refine=refine,
        jobs=jobs,
        reporter=ConsoleReporter(),
    )
    if as_json:
        print_json(suite.as_dict())
    else:
        print_regression(suite)
    if suite.problems:
        raise QualityError("regress: " + "; ".join(suite.problems) + ".")


def print_regression(suite: Regression) -> None:
    """Print a row for each scenario: what its corners are worth, and what its camera is."""
    from camcal.workflows.regress import FIGURES

    names = [fitted(result.name, _LONGEST_NAME) for result in suite.results]
    for title, of_camera in (("Corners against rendered truth", False), ("Camera against truth", True)):
        chosen = [figure for figure in FIGURES if figure.name.startswith(_OF_CAMERA) == of_camera]
        columns = [
            (_HEADINGS.get(f.name, f.title), [_written(f.name, r.figures[f.name]) for r in suite.results]) for f in chosen
        ]
        if of_camera:
            columns.append(("seconds", [f"{result.seconds:.1f}" for result in suite.results]))
        headings, values = zip(*columns, strict=True)
        print_table(title, ("", *headings), list(zip(names, *values, strict=True)))


def _written(name: str, value: float) -> str:
    """Write a figure; a share in percent, because it is near 1."""
    return f"{100 * value:.2f} %" if name == _SHARE else f"{value:.3g}"
