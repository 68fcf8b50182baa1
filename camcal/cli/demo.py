"""`camcal demo`."""

from __future__ import annotations

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter
from camcal.cli.verify import print_verification


@click.command(epilog="Example: camcal demo -o camcal-demo/")
@click.option(
    "-o", "--output", default="camcal-demo", show_default=True, type=click.Path(file_okay=False), help="Folder to fill."
)
@options.jobs
@options.force
def demo(output: str, jobs: int | None, force: bool) -> None:
    """Show the whole chain: render a dataset, calibrate from its pixels, undistort it, compare with the truth."""
    from camcal.workflows.demo import demo as run_demo

    shown = run_demo(output, force=force, jobs=jobs, reporter=ConsoleReporter())
    print_verification(shown.verification)
    made, run, done = shown.synthesis, shown.calibration, shown.undistortion
    click.echo(f"rendered images and truth   {made.folder}")
    click.echo(f"calibration                 {run.folder}")
    click.echo(f"undistorted images          {done.folder}")
