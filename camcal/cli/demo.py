"""`camcal demo`."""

from __future__ import annotations

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, print_facts
from camcal.cli.verify import print_verification
from camcal.errors import QualityError


@click.command(cls=options.Command, epilog="Example: camcal demo -o camcal-demo/")
@click.option("-o", "--output", default="camcal-demo", show_default=True, metavar="DIR", help="Folder to fill.")
@options.jobs
@options.force
@options.help_option
def demo(output: str, jobs: int | None, force: bool) -> None:
    """Show the whole chain: render a dataset, calibrate from its pixels, undistort it, compare with the truth."""
    from camcal.workflows.demo import demo as run_demo
    from camcal.workflows.report import REPORT_FILE_NAME

    shown = run_demo(output, force=force, jobs=jobs, reporter=ConsoleReporter())
    print_verification(shown.verification)
    made, run, done = shown.synthesis, shown.calibration, shown.undistortion
    print_facts(
        {
            "rendered images and truth": str(made.folder),
            "calibration": str(run.folder),
            "its report": str(run.folder / REPORT_FILE_NAME) if run.folder else "",
            "undistorted images": str(done.folder),
        }
    )
    if shown.verification.problems:
        raise QualityError("demo: " + "; ".join(shown.verification.problems) + ".")
