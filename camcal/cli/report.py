"""`camcal report`."""

from __future__ import annotations

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, print_facts, print_json


@click.command(cls=options.Command, epilog="Example: camcal report calib/ --images photos/ -o report.html --force")
@click.argument("calibration")
@click.option(
    "-o", "--output", metavar="FILE", help="The page.  [default: report.html in the folder; an earlier page is replaced]"
)
@click.option("--images", metavar="DIR", help="Folder of the photographs.  [default: where views.yaml says]")
@click.option("--plots", metavar="DIR", help="Write the figures as files as well, for papers.")
@options.plot_formats
@options.jobs
@options.force
@options.as_json
@options.help_option
def report(
    *,
    calibration: str,
    output: str | None,
    images: str | None,
    plots: str | None,
    plot_formats: tuple[str, ...],
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Make the page of a calibration again.

    CALIBRATION is a folder that `calibrate` wrote. Nothing is solved: the page shows what the folder's files hold, with the
    photographs if they are found.
    """
    from camcal.workflows.report import make_report

    done = make_report(
        calibration,
        output,
        images=images,
        plots=plots,
        plot_formats=plot_formats,
        force=force,
        jobs=jobs,
        reporter=ConsoleReporter(),
    )
    if as_json:
        print_json({"page": str(done.page), "plots": [str(path) for path in done.plots], "missing": done.missing})
        return
    print_facts(
        {
            "page": str(done.page),
            "plots": f"{plots}: {len(done.plots)} files" if plots else "",
            "photographs": done.missing or "all shown",
        }
    )
