"""`camcal calibrate`."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, print_json
from camcal.cli.image_size import read_size
from camcal.errors import DetectionError, InputError, QualityError

_LONGEST_NAME = 1000


@click.command(cls=options.Command, epilog="Example: camcal calibrate photos/ --board checkerboard:9x6:25mm -o calib/")
@click.argument("images", nargs=-1, required=True)
@click.option("--board", required=True, metavar="SPEC", help="One-liner, sample board or board file.")
@click.option("-o", "--output", required=True, metavar="DIR", help="Folder for the results.")
@click.option(
    "--distortion",
    default="k1,k2,k3",
    show_default=True,
    metavar="NAMES|auto",
    help="Free coefficients; the others stay 0. auto: as many as the images support.",
)
@options.refine
@click.option("--warp", is_flag=True, help="Solve for the board's bow as well.")
@click.option("--scale", is_flag=True, help="Solve for a stretch of the print along y as well.")
@click.option("--require", type=click.Choice(["good", "usable", "poor"]), help="Exit with code 5 below this verdict.")
@click.option("--max-rms", type=click.FloatRange(min=0), metavar="PX", help="Exit with code 5 above this RMS.")
@click.option(
    "--max-sigma-px",
    type=click.FloatRange(min=0),
    metavar="PX",
    help="Exit with code 5 where the projection is known less well, at the boards' range.",
)
@click.option(
    "--twin",
    is_flag=False,
    flag_value=3,
    default=0,
    type=click.IntRange(min=0),
    metavar="[N]",
    help="Render the capture again N times (3) with known truth, and report the errors actually made.",
)
@click.option("--anamorphic", is_flag=True, help="Accept pixels that are far from square.")
@click.option("--only-used", is_flag=True, help="With a corners.csv: keep its choice of corners.")
@click.option("--size", metavar="WxH", callback=read_size, help="With corners of another tool: size of the images.")
@click.option("--undistort", is_flag=True, help="Write the undistorted images as well.")
@click.option("--no-report", is_flag=True, help="Do not write report.html.")
@click.option("--plots", metavar="DIR", help="Write the report's figures as files as well, for papers.")
@options.plot_formats
@click.option("--name", default="camera", show_default=True, help="Name of the camera in camera.yaml.")
@options.jobs
@options.force
@options.as_json
@options.help_option
def calibrate(
    *,
    images: tuple[str, ...],
    board: str,
    output: str,
    distortion: str,
    refine: str,
    warp: bool,
    scale: bool,
    require: str | None,
    max_rms: float | None,
    max_sigma_px: float | None,
    twin: int,
    anamorphic: bool,
    only_used: bool,
    size: tuple[int, int] | None,
    undistort: bool,
    no_report: bool,
    plots: str | None,
    plot_formats: tuple[str, ...],
    name: str,
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Find the board in photographs and solve for the camera.

    IMAGES are files, folders or globs; or one file of corners (camcal's, mrcal's, MATLAB's or another CSV), which are then
    solved without any detection. Writes camera.yaml, views.yaml, corners.csv, board.yaml and report.html. Exit code 5 when
    the result is written but must not be trusted.
    """
    _check_name(name)
    from camcal.trust.assess import Gates
    from camcal.workflows.calibrate import calibrate as run_calibration

    unlimited = float("nan")
    with _with_a_way_to_look(images, board):
        run = run_calibration(
            images,
            board,
            output,
            distortion=distortion,
            refine=refine,
            warp=warp,
            scale=scale,
            gates=Gates(
                require or "",
                unlimited if max_rms is None else max_rms,
                unlimited if max_sigma_px is None else max_sigma_px,
            ),
            twin=twin,
            anamorphic=anamorphic,
            only_used=only_used,
            size=size,
            undistort=undistort,
            report=not no_report,
            plots=plots,
            plot_formats=plot_formats,
            name=name,
            force=force,
            jobs=jobs,
            reporter=ConsoleReporter(),
        )
    if as_json:
        print_json(run.as_dict())
    else:
        from camcal.cli.summary import print_calibration

        print_calibration(run, images, undistorted=undistort, report=not no_report)
    if run.verdict.problems:
        raise QualityError(f"{run.folder}: written, but must not be trusted: {run.verdict.problems[0]}")


@contextmanager
def _with_a_way_to_look(images: Sequence[str], board: str) -> Iterator[None]:
    """Where too few boards were found in images, name the command that draws what was seen."""
    from camcal.formats.corner_exchange.table import is_corners_path

    try:
        yield
    except DetectionError as error:
        if is_corners_path(images[0]):
            raise
        named = shlex.quote(images[0]) if len(images) == 1 else "IMAGES"
        line = f"camcal detect {named} --board {shlex.quote(board)} -o corners.csv --overlay seen"
        raise DetectionError(f"{error} To look at what was seen: {line}") from None


def _check_name(name: str) -> None:
    """Refuse a name of the camera that a text file could not hold on one line."""
    if not name.isprintable() or len(name) > _LONGEST_NAME:
        got = repr(name) if len(name) <= _LONGEST_NAME else f"{len(name)} characters"
        raise InputError(f"--name: not a name (got {got}, expected one line of at most {_LONGEST_NAME} characters in UTF-8).")
