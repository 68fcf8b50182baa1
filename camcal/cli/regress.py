"""`camcal regress`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, print_json, print_table
from camcal.errors import QualityError

if TYPE_CHECKING:
    from camcal.workflows.regress import Regression


@click.command(cls=options.Command, epilog="Example: camcal regress webcam_720p --baseline baseline.json --update-baseline")
@click.argument("configs", nargs=-1, metavar="[CONFIG]...")
@click.option("--baseline", metavar="FILE", help="Figures to hold the run against, as JSON.")
@click.option("--update-baseline", is_flag=True, help="Write this run's figures to the baseline instead.")
@click.option("--junit", metavar="FILE", help="Write the results as JUnit XML as well.")
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
    """Print a row for each figure and a column for each scenario."""
    from camcal.workflows.regress import FIGURES

    rows = [(figure.title, *(f"{result.figures[figure.name]:.4g}" for result in suite.results)) for figure in FIGURES]
    rows.append(("seconds", *(f"{result.seconds:.1f}" for result in suite.results)))
    print_table("Accuracy against rendered truth", ("", *(result.name for result in suite.results)), rows)
