"""`camcal undistort`."""

from __future__ import annotations

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, say


@click.command(cls=options.Command, epilog="Example: camcal undistort photos/ --camera calib/camera.yaml -o undistorted/")
@click.argument("inputs", nargs=-1, required=True)
@click.option("--camera", required=True, metavar="FILE|DIR", help="Camera file, or a folder written by `calibrate`.")
@click.option("-o", "--output", required=True, metavar="DIR", help="Folder for the undistorted images.")
@click.option(
    "--alpha",
    default=0.0,
    show_default=True,
    type=click.FloatRange(0, 1),
    help="0: only pixels that see the source; 1: every pixel of the source.",
)
@options.jobs
@options.force
@options.help_option
def undistort(*, inputs: tuple[str, ...], camera: str, output: str, alpha: float, jobs: int | None, force: bool) -> None:
    """Take the lens out of images.

    INPUTS are image files, folders or globs. The images keep their names; the camera that belongs to them, without
    distortion, is written beside them as camera.yaml.
    """
    from camcal.workflows.undistort import undistort as take_out

    done = take_out(inputs, camera, output, alpha=alpha, force=force, jobs=jobs, reporter=ConsoleReporter())
    say(f"{done.folder}: {len(done.images)} undistorted images and their camera.yaml.")
