"""`camcal import`."""

from __future__ import annotations

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, say_wrapped
from camcal.cli.export import FORMATS
from camcal.cli.image_size import read_size


@click.command("import", cls=options.Command, epilog="Example: camcal import calib/camera.yaml -o camera.yaml")
@click.argument("file")
@click.option("-o", "--output", required=True, metavar="FILE", help="Camera file to write.")
@click.option(
    "--from",
    "file_format",
    type=click.Choice(FORMATS, case_sensitive=False),
    help="The file's format.  [default: recognised by its content]",
)
@click.option("--camera", metavar="NAME", help="Which camera, if the file has several.")
@click.option("--size", metavar="WxH", callback=read_size, help="Image size in pixels, if the file does not say.")
@click.option("--name", metavar="NAME", help="What to call the camera.")
@click.option("--max-refit-px", default=3.0, show_default=True, metavar="PX", help="Largest difference a refit may leave.")
@click.option("--no-refit", is_flag=True, help="Fail (exit code 5) if the file's lens is not one of camcal's.")
@options.force
@options.help_option
def import_(
    *,
    file: str,
    output: str,
    file_format: str | None,
    camera: str | None,
    size: tuple[int, int] | None,
    name: str | None,
    max_refit_px: float,
    no_refit: bool,
    force: bool,
) -> None:
    """Read another tool's camera and write it as a camera file.

    FILE is a camera of ROS, OpenCV, Kalibr, COLMAP, mrcal, nerfstudio, MATLAB or lensfun, or camcal's own JSON; - is
    standard input. Every command that takes a camera reads these files directly too; this one is for those that leave
    something open: which of several cameras, its image size, or a lens that has to be refitted.
    """
    from camcal.workflows.import_ import import_camera

    known = import_camera(
        file,
        output,
        file_format=file_format,
        camera=camera,
        size=size,
        name=name,
        refit=not no_refit,
        max_refit_px=max_refit_px,
        force=force,
        reporter=ConsoleReporter(),
    )
    say_wrapped(f"{output}: {known.camera}.")
