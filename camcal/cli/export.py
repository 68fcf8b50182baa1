"""`camcal export`."""

from __future__ import annotations

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, say, say_wrapped
from camcal.cli.export_other import OTHER_FORMATS, export_other
from camcal.cli.image_size import read_size

FORMATS = ("ros", "opencv", "kalibr", "colmap", "mrcal", "nerfstudio", "matlab", "lensfun", "json")
EVERY_FORMAT = (*FORMATS, *(name for name in OTHER_FORMATS if name not in FORMATS))


@click.command(cls=options.Command, epilog="Example: camcal export calib/ --to kalibr -o camchain.yaml")
@click.argument("camera")
@click.option("--to", required=True, type=click.Choice(EVERY_FORMAT, case_sensitive=False), help="The format to write.")
@click.option("-o", "--output", metavar="FILE", help="File to write.  [default: standard output]")
@click.option("--max-refit-px", default=3.0, show_default=True, metavar="PX", help="Largest difference a refit may leave.")
@click.option("--no-refit", is_flag=True, help="Fail (exit code 5) where the format cannot hold the camera as it is.")
@click.option("--lens-name", default=None, metavar="NAME", help="lensfun: the lens.  [default: the camera's name]")
@click.option("--crop-factor", type=float, metavar="N", help="lensfun: diagonal of a full frame over the sensor's.")
@click.option("--focal-mm", type=float, metavar="MM", help="lensfun: focal length as written on the lens.")
@click.option("--board", metavar="SPEC", help="Corners: the board they are of.  [default: board.yaml beside them]")
@click.option("--size", metavar="WxH", callback=read_size, help="Corners: size of the images, if the file does not say.")
@click.option("--only-used", is_flag=True, help="Corners: leave out those that a calibration did not use.")
@options.force
@options.help_option
def export(
    *,
    camera: str,
    to: str,
    output: str | None,
    max_refit_px: float,
    no_refit: bool,
    lens_name: str | None,
    crop_factor: float | None,
    focal_mm: float | None,
    board: str | None,
    size: tuple[int, int] | None,
    only_used: bool,
    force: bool,
) -> None:
    """Write a camera, a board or corners for another tool, in its own convention of pixels.

    CAMERA is a camera file of any known format (FILE#NAME where it holds several), or a folder that `calibrate` wrote. What
    the format cannot hold, such as k3 in Kalibr's, is never cut off: the camera is refitted over the whole image, and the
    difference is told in pixels.

    A board (a SPEC or a board file) goes to kalibr, a file of corners to vnl, matlab or csv: give it in place of CAMERA.
    """
    if export_other(camera, to, output, board=board, size=size, only_used=only_used, force=force):
        return
    from camcal.workflows.export import export_camera

    done = export_camera(
        camera,
        to,
        output,
        refit=not no_refit,
        max_refit_px=max_refit_px,
        lens_name=lens_name or "",
        crop_factor=crop_factor,
        focal_mm=focal_mm,
        force=force,
        reporter=ConsoleReporter(),
    )
    if output is None:
        say(str(done.content).rstrip("\n"))
    else:
        how = "refitted" if done.lost else "the same camera"
        say_wrapped(f"{output}: {to}, {how}.")
