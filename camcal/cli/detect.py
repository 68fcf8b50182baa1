"""`camcal detect`."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from camcal.cli import options, style
from camcal.cli.console import ConsoleReporter, fitted, number, print_facts, print_json, say
from camcal.cli.width import WIDTH, wrapped, wrapped_command
from camcal.errors import DetectionError

if TYPE_CHECKING:
    from camcal.observations import Detection, Rejected
    from camcal.workflows.detect import DetectionRun

_HEADER = ("corners", "sigma px", "edges px")
_COLUMN = 12
_NOTE_INDENT = "    "


@click.command(
    cls=options.Command, epilog="Example: camcal detect photos/ --board checkerboard:9x6:25mm -o corners.csv --overlay seen/"
)
@click.argument("images", nargs=-1, required=True)
@click.option("--board", required=True, metavar="SPEC", help="One-liner, sample board or board file.")
@click.option("-o", "--output", metavar="FILE", help="Corners to write: .csv for calibrate, .vnl for mrcal.")
@click.option("--overlay", metavar="DIR", help="Folder for a picture of each image with what was seen, or why nothing was.")
@click.option(
    "--refine",
    default="saddle",
    show_default=True,
    type=click.Choice(["saddle", "opencv"]),
    help="How corners are refined: a fitted saddle, or OpenCV.",
)
@options.jobs
@options.force
@options.as_json
@options.help_option
def detect(
    *,
    images: tuple[str, ...],
    board: str,
    output: str | None,
    overlay: str | None,
    refine: str,
    jobs: int | None,
    force: bool,
    as_json: bool,
) -> None:
    """Find the board in photographs, and show what was seen.

    IMAGES are files, folders or globs. Solves nothing: the corners go to a file that `camcal calibrate` and other tools take,
    and pictures show each corner with its place in the board's order. Exit code 3 if no image shows the board.
    """
    from camcal.workflows.detect import detect as run_detection

    run = run_detection(
        images, board, output, overlay=overlay, refine=refine, force=force, jobs=jobs, reporter=ConsoleReporter()
    )
    if as_json:
        print_json(run.as_dict())
    else:
        _print_views(run)
        _print_facts(run, overlay)
    if not run.detections:
        raise DetectionError(_nothing(run, overlay))


def _print_views(run: DetectionRun) -> None:
    """Print a row for each image, and under it what is to be said of it."""
    rows = [(view, _cells(view, run.board.feature_count), _notes(view, run)) for view in run.views]
    room = WIDTH - _COLUMN * len(_HEADER)
    names = [fitted(view.source, room) for view, *_ in rows]
    width = max(map(len, ("image", *names)))
    say(style.heading(_row("image", _HEADER, width)))
    for name, (_, cells, notes) in zip(names, rows, strict=True):
        say(_row(name, cells, width))
        for note in notes:
            say(wrapped(note, _NOTE_INDENT, _NOTE_INDENT))
    say("")


def _row(name: str, cells: Sequence[str], width: int) -> str:
    return f"{name:<{width}}" + "".join(f"{cell:>{_COLUMN}}" for cell in cells)


def _cells(view: Detection | Rejected, count: int) -> tuple[str, str, str]:
    """Corners, standard deviation and edge width of a view; dashes for a rejected one."""
    from camcal.observations import Rejected
    from camcal.workflows.detect import median_sigma_px

    if isinstance(view, Rejected):
        return "-", "-", "-"
    return f"{len(view)} of {count}", number(median_sigma_px(view), ".3f"), number(view.edge_width_px, ".1f")


def _notes(view: Detection | Rejected, run: DetectionRun) -> list[str]:
    """Clauses about a view."""
    from camcal.observations import Rejected

    if isinstance(view, Rejected):
        return [f"rejected: {view.reason}"]
    refused = run.refused.get(view.source, ())
    return [*view.notes, *([f"{len(refused)} refused (first: {refused[0]})"] if refused else [])]


def _print_facts(run: DetectionRun, overlay: str | None) -> None:
    """Print what all images come to, what was written, and what to run next."""
    from camcal.calibration.views import FEWEST_VIEWS

    found, count = len(run.detections), len(run.views)
    corners = sum(len(seen) for seen in run.detections)
    following = [
        "camcal calibrate",
        shlex.quote(str(run.output)),
        f"--board {shlex.quote(run.board.spec)}",
        *_size(run),
        "-o calib/",
    ]
    print_facts(
        {
            "board": f"{run.board.spec} in {found} of {count} {'image' if count == 1 else 'images'}, {corners} corners",
            "files": str(run.output or ""),
            "seen": f"{overlay}: a picture of each image" if run.overlays else "",
            "next": wrapped_command(following, indent=len("files  ")) if run.output and found >= FEWEST_VIEWS else "",
        }
    )


def _size(run: DetectionRun) -> list[str]:
    """The option that tells the size of the images where the file of corners does not."""
    sizes = {seen.size for seen in run.detections}
    told = run.output is None or run.output.suffix.lower() == ".csv" or len(sizes) != 1
    return [] if told else ["--size {}x{}".format(*sizes.pop())]


def _nothing(run: DetectionRun, overlay: str | None) -> str:
    """Say that there is no board in any image, and why the first has none."""
    first = run.rejected[0]
    look = f" Look at the pictures in {overlay}." if overlay else " Look at what was seen with --overlay DIR."
    where = "found in no image" if len(run.views) == 1 else f"found in none of {len(run.views)} images"
    return f"{run.board.spec}: {where} ({first.source}: {first.reason}).{look}"
