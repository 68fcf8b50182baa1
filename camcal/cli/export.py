"""`camcal export`."""

from __future__ import annotations

from typing import Any

import click
from click.core import ParameterSource

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, say, say_wrapped
from camcal.cli.image_size import read_size
from camcal.errors import InputError

FORMATS = ("ros", "opencv", "kalibr", "colmap", "mrcal", "nerfstudio", "matlab", "lensfun", "json")
"""Formats of cameras."""
_OF_BOARDS = ("kalibr", "camcal")
_OF_CORNERS = ("csv", "vnl", "matlab")
_EVERY_FORMAT = tuple(dict.fromkeys((*FORMATS, *_OF_BOARDS, *_OF_CORNERS)))
_ONLY_FOR = {
    "cameras": ("max_refit_px", "no_refit", "lens_name", "crop_factor", "focal_mm"),
    "corners": ("board", "size", "only_used"),
}
"""Options that mean nothing for anything else."""


@click.command(cls=options.Command, epilog="Example: camcal export calib/ --to kalibr -o camchain.yaml")
@click.argument("camera")
@click.option(
    "--to",
    required=True,
    type=click.Choice(_EVERY_FORMAT, case_sensitive=False),
    metavar="NAME",
    help="; ".join(
        f"{what} {', '.join(names)}"
        for what, names in (("The format. Of cameras:", FORMATS), ("of boards:", _OF_BOARDS), ("of corners:", _OF_CORNERS))
    )
    + ".",
)
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
@click.pass_context
def export(
    context: click.Context,
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
    from camcal.workflows.exportable import what_is

    kind = what_is(camera)
    _refuse_other_options(context, kind)
    exported: tuple[str | bytes, str]
    if kind == "corners":
        exported = _corners(camera, output, to=to, board=board, size=size, only_used=only_used, force=force)
    elif kind == "boards":
        exported = _board(camera, output, to=to, force=force)
    else:
        exported = _camera(
            camera,
            output,
            to=to,
            refit=not no_refit,
            max_refit_px=max_refit_px,
            lens_name=lens_name or "",
            crop_factor=crop_factor,
            focal_mm=focal_mm,
            force=force,
        )
    content, what = exported
    if output is None:
        say(str(content).rstrip("\n"))
    else:
        say_wrapped(f"{output}: {what}.")


def _corners(given: str, output: str | None, **how: Any) -> tuple[str, str]:
    """Export corners: the content, and what it is."""
    from camcal.workflows.export_corners import export_corners

    made = export_corners(given, output, **how)
    return made.content, f"{made.what}, {made.corners} corners in {made.views} views"


def _board(given: str, output: str | None, *, to: str, force: bool) -> tuple[str, str]:
    """Export a board: the content, and what it is."""
    from camcal.workflows.export_board import export_board

    return export_board(given, output, to=to, force=force), f"the board {given} for {to}"


def _camera(given: str, output: str | None, *, to: str, **how: Any) -> tuple[str | bytes, str]:
    """Export a camera: the content, and what it is."""
    from camcal.workflows.export import export_camera

    made = export_camera(given, to, output, reporter=ConsoleReporter(), **how)
    return made.content, f"{to}, {'refitted' if made.lost else 'the same camera'}"


def _refuse_other_options(context: click.Context, kind: str) -> None:
    """Refuse options that mean nothing for what is exported."""
    for option in context.command.params:
        home = next((several for several, names in _ONLY_FOR.items() if option.name in names), kind)
        if home != kind and context.get_parameter_source(option.name or "") is ParameterSource.COMMANDLINE:
            raise InputError(f"{option.opts[0]}: only for {home} (got {kind}). Leave it away.")
