"""`camcal calibrate`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, print_json, print_table
from camcal.errors import QualityError

if TYPE_CHECKING:
    from camcal.workflows.calibrate import CalibrationRun


@click.command(epilog="Example: camcal calibrate photos/ --board checkerboard:9x6:25mm -o calib/")
@click.argument("images", nargs=-1, required=True)
@click.option("--board", required=True, metavar="SPEC", help="One-liner, sample board or board file.")
@click.option("-o", "--output", required=True, type=click.Path(file_okay=False), help="Folder for the results.")
@click.option(
    "--distortion", default="k1,k2,k3", show_default=True, metavar="NAMES", help="Free coefficients; the others stay 0."
)
@click.option("--anamorphic", is_flag=True, help="Accept pixels that are far from square.")
@click.option("--only-used", is_flag=True, help="With a corners.csv: keep its choice of corners.")
@click.option("--undistort", is_flag=True, help="Write the undistorted images as well.")
@click.option("--name", default="camera", show_default=True, help="Name of the camera in camera.yaml.")
@options.jobs
@options.force
@options.as_json
def calibrate(
    *,
    images: tuple[str, ...],
    board: str,
    output: str,
    distortion: str,
    anamorphic: bool,
    only_used: bool,
    undistort: bool,
    name: str,
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Find the board in photographs and solve for the camera.

    IMAGES are files, folders or globs, or one corners.csv, whose corners are then solved without any detection. Writes
    camera.yaml, views.yaml, corners.csv and board.yaml. Exit code 5 when the result is written but must not be trusted.
    """
    from camcal.workflows.calibrate import calibrate as run_calibration

    run = run_calibration(
        images,
        board,
        output,
        distortion=distortion,
        anamorphic=anamorphic,
        only_used=only_used,
        undistort=undistort,
        name=name,
        force=force,
        jobs=jobs,
        reporter=ConsoleReporter(),
    )
    if as_json:
        print_json(run.as_dict())
    else:
        print_calibration(run)
    if run.intrinsics.problems:
        raise QualityError(f"{run.folder}: written, but must not be trusted: " + " ".join(run.intrinsics.problems))


def print_calibration(run: CalibrationRun) -> None:
    """Print the parameters with their standard deviations, and what they rest on."""
    known, sigma = run.intrinsics, run.intrinsics.sigma
    values = dict(zip(known.camera.intrinsic_names, known.camera.intrinsics.tolist(), strict=True))
    rows = [(name, f"{values[name]:.8g}", f"{sigma[name]:.3g}") for name in known.free]
    width, height = known.camera.size
    print_table(f"{known.name}: {width}x{height}", ("", "value", "std. dev."), rows)
    rejected = len(run.calibration.rejected)
    click.echo(
        f"RMS {known.rms_px:.4f} px over {known.corners} corners in {known.views} views"
        + (f", {rejected} rejected" if rejected else "")
    )
    click.echo(f"written to {run.folder}")
