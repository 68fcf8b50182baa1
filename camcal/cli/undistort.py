"""`camcal undistort`."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, on_one_line, say, say_wrapped
from camcal.cli.image_size import read_size
from camcal.errors import InputError

if TYPE_CHECKING:
    from camcal.workflows.undistort.run import Undistortion

_LIST = "-"
# Options of glibc's mallopt, and the largest value that it takes for the first.
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
_LARGEST_KEPT_BYTES = 32 * 1024 * 1024
_MAIN, _GEOMETRY, _PIXELS, _VIDEOS, _RUN = "Options", "Geometry", "Pixels and formats", "Videos", "Run"


class _Option(click.Option):
    """An option that the help shows among others of its kind."""

    def __init__(self, *arguments: Any, section: str, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self.section = section


class _Command(options.Command):
    """A command whose help shows its options in sections."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options section by section."""
        sections: dict[str, list[tuple[str, str]]] = {name: [] for name in (_MAIN, _GEOMETRY, _PIXELS, _VIDEOS, _RUN)}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx) if isinstance(parameter, click.Option) else None
            if record is not None:
                sections[getattr(parameter, "section", _RUN)].append(record)
        for name, records in sections.items():
            with formatter.section(name):
                formatter.write_dl(records)


def _fill(context: click.Context, parameter: click.Parameter, value: str | None) -> float | tuple[float, ...] | None:
    """Read one number, or several with commas."""
    if value is None:
        return None
    try:
        numbers = tuple(float(part) for part in value.split(","))
    except ValueError:
        raise click.BadParameter(f"{value!r} is neither a number nor R,G,B.", context, parameter) from None
    return numbers[0] if len(numbers) == 1 else numbers


def _in(section: str) -> Callable[..., Callable[[Any], Any]]:
    """Return `click.option` for a section of the help."""

    def option(*names: str, **settings: Any) -> Callable[[Any], Any]:
        return click.option(*names, cls=_Option, section=section, **settings)

    return option


_main, _geometry, _pixels, _videos, _run = map(_in, (_MAIN, _GEOMETRY, _PIXELS, _VIDEOS, _RUN))


@click.command(cls=_Command, epilog="Example: camcal undistort photos/ --camera calib/camera.yaml -o undistorted/")
@click.argument("inputs", nargs=-1, required=True)
@_main("--camera", required=True, metavar="FILE|DIR", help="Camera file, or a folder written by `calibrate`.")
@_main("-o", "--output", required=True, metavar="DIR|FILE", help="Folder for the results; for a single input, a file.")
@_main("-r", "--recursive", is_flag=True, help="Look into folders within folders, and make them again.")
@_main("--distort", is_flag=True, help="The other way: add the lens to images of the camera that the geometry describes.")
@_geometry(
    "--alpha",
    default=0.0,
    show_default=True,
    type=click.FloatRange(0, 1),
    help="0: only pixels that see the source; 1: every pixel of the source.",
)
@_geometry("--fov", "fov_deg", type=float, metavar="DEG", help="Horizontal field of view, instead of --alpha.")
@_geometry("--size", metavar="WxH", callback=read_size, help="Size of the results.  [default: the camera's]")
@_geometry("--scale", default=1.0, type=float, metavar="S", help="Factor by which the results are larger than that.")
@_geometry(
    "--crop", default="none", type=click.Choice(["valid", "none"]), help="valid: the largest rectangle that sees the source."
)
@_geometry("--target", metavar="FILE|DIR", help="Camera of the results, instead of all this.")
@_geometry("--rescale", is_flag=True, help="Scale the camera to images of another size but the same aspect ratio.")
@_pixels(
    "--interpolation",
    default="linear",
    show_default=True,
    type=click.Choice(["linear", "cubic", "lanczos"]),
    help="cubic and lanczos keep finer detail and take longer.",
)
@_pixels("--exact", is_flag=True, help="Compute each position by the lens model, instead of to 0.0002 px.")
@_pixels("--gamma", metavar="srgb|G", help="Average light instead of pixel values.")
@_pixels(
    "--fill",
    metavar="VALUE|R,G,B[,A]",
    callback=_fill,
    help="Value of pixels that see nothing; without A, an alpha is 0.  [default: 0]",
)
@_pixels("--format", "file_format", metavar="EXT", help="Write png, jpg, tif, webp, mp4 ...  [default: as the source]")
@_pixels("--quality", type=click.IntRange(1, 100), help="Of JPEG and WebP.  [default: 95, or the source's if higher]")
@_pixels("--most-pixels", type=click.IntRange(min=1), metavar="N", help="Refuse larger images.  [default: 400 million]")
@_pixels("--mask", is_flag=True, help="Write mask.png too: 255 where a pixel sees the source.")
@_pixels("--maps", is_flag=True, help="Write maps.npz and maps.tiff too: float32 x and y, as cv2.remap takes them.")
@_videos("--codec", metavar="NAME", help="h264, hevc, av1, vp9, ffv1, prores ...  [default: the source's]")
@_videos("--crf", type=float, metavar="Q", help="Quality on the codec's own scale; lower is better.")
@_videos("--pixel-format", metavar="NAME", help="By libav's name, such as yuv420p10le.  [default: the source's]")
@_videos("--preset", metavar="NAME", help="The encoder's, such as slow.")
@_videos("--lossless/--lossy", default=None, help="Whether nothing may be lost.  [default: as the source]")
@_videos("--frames", metavar="A:B", help="Only these, numbered from 0; B is left out.")
@_videos("--progressive", is_flag=True, help="Take frames that are marked as interlaced as whole ones.")
@_run("--resume", is_flag=True, help="Pass over what an earlier run finished with the same camera and options.")
@_run("--dry-run", is_flag=True, help="Print what would be done, and write nothing; nothing is decoded.")
@_run("--force", is_flag=True, help="Write into an output folder (or over a file) that exists.")
@_run("-j", "--jobs", type=click.IntRange(min=1), help="Images worked on at once.  [default: all processors]")
@_run("--scheduler", metavar="ADDRESS", help="Let a Dask cluster work; paths must be the same on all its machines.")
@options.help_option
def undistort(*, inputs: tuple[str, ...], **chosen: Any) -> None:
    """Take the lens out of images, videos or points.

    INPUTS are images, videos, folders of them, patterns, - for a list of paths on standard input, or one CSV file of points
    with the columns x and y. Names are kept. The camera that belongs to the results is written beside them as camera.yaml.
    """
    with _without_collector():
        _keep_freed_memory()
        from camcal.workflows.undistort import undistort as take_out
        from camcal.workflows.undistort.inputs import read_list

    if chosen["most_pixels"] is None:
        del chosen["most_pixels"]
    listed = read_list(_standard_input()) if _LIST in inputs else ()
    given = [path for path in inputs if path != _LIST]
    reporter = ConsoleReporter()
    done = take_out(given, listed=listed, reporter=reporter, **chosen)
    if chosen["dry_run"]:
        _say_plan(done)
    else:
        for output in done.outputs:
            reporter.detail(f"{output.source}: written to {output.target}")
        say_wrapped(on_one_line(_summary(done, "distorted" if chosen["distort"] else "undistorted")))
    if done.rejected:
        first, count = done.rejected[0], len(done.rejected)
        others = f"{count} of {count + len(done.outputs) + len(done.already_done)} files"
        raise InputError(f"undistort: {others} passed over (first: {first.source}: {first.reason})")


@contextmanager
def _without_collector() -> Iterator[None]:
    """Load modules without looking for garbage among them, now or ever: there is none, and it takes a fifth of the start."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def _keep_freed_memory() -> None:
    """Tell glibc to keep blocks of some megabytes that were freed for the next image, instead of fetching fresh ones.

    Encoded images are of that size, and the first touch of fresh memory costs as much as a twentieth of all the work.
    """
    import ctypes

    try:
        set_option = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):
        # Another C library.
        return
    set_option(_MMAP_THRESHOLD, _LARGEST_KEPT_BYTES)
    set_option(_TRIM_THRESHOLD, 2 * _LARGEST_KEPT_BYTES)


def _standard_input() -> bytes:
    """Read all of standard input; nothing if the caller closed it."""
    return b"" if sys.stdin is None else sys.stdin.buffer.read()


def _say_plan(done: Undistortion) -> None:
    """Print what would be done."""
    width, height = done.target.size
    for output in done.outputs:
        say(on_one_line(f"{output.source} -> {output.target}  {width}x{height} {output.format}"))
    if done.already_done:
        say(f"{len(done.already_done)} more {'is' if len(done.already_done) == 1 else 'are'} done already.")


def _summary(done: Undistortion, how: str) -> str:
    """One line on what was written and where."""
    if done.camera_file.name != "camera.yaml":
        return f"{done.outputs[0].target}: {how}; its camera is {done.camera_file}."
    kinds = {"image": len(done.images), "video": sum(job.is_video for job in done.outputs)}
    kinds["file of points"] = len(done.outputs) - sum(kinds.values())
    counts = [f"{count} {how} {kind}{'' if count == 1 else 's'}" for kind, count in kinds.items() if count]
    written = " and ".join(counts) or "nothing new"
    before = f" ({len(done.already_done)} done before)" if done.already_done else ""
    return f"{done.folder}: {written}{before} and {'its' if len(done.outputs) == 1 else 'their'} camera.yaml."
