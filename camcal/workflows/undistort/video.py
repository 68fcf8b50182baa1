"""A video without its lens: every plane of every frame moved, and all else in the file left as it is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from camcal import __version__
from camcal.errors import InputError
from camcal.formats.output import claim_file
from camcal.formats.video.codecs import Encoding, EncodingOptions, SourceCodec, choose_encoding
from camcal.formats.video.containers import container_format
from camcal.formats.video.encoders import ENCODERS
from camcal.formats.video.lossless import is_lossless
from camcal.formats.video.pixels import PixelLayout
from camcal.formats.video.reader import VideoReader
from camcal.formats.video.trimming import FrameRange
from camcal.formats.video.writer import VideoWriter
from camcal.observations import Image
from camcal.threads import single_threaded
from camcal.undistortion.maps import UndistortMap, undistort_image
from camcal.undistortion.planes import plane_map
from camcal.undistortion.scratch import Scratch
from camcal.undistortion.sizes import advice_on_size

Item = TypeVar("Item")
Planes = Sequence[Image]

FRAMES_AT_ONCE = 4
"""Frames that are moved together. OpenCV moves four samples that lie side by side in little more time than one."""

NOTE = f"Lens distortion removed by camcal {__version__}."


@dataclass(frozen=True, slots=True)
class VideoOptions:
    """How a video is written.

    Attributes
    ----------
    encoding : EncodingOptions
        By default as the source is: the same codec and pixels, at a quality that the eye does not tell from it.
    frames : FrameRange
        Which; the others, and the sound that plays with them, are left out.
    interpolation : str
        As for `undistort_image`.
    as_progressive : bool
        Take frames that are marked as interlaced as whole ones.
    """

    encoding: EncodingOptions = field(default_factory=EncodingOptions)
    frames: FrameRange = field(default_factory=FrameRange)
    interpolation: str = "linear"
    as_progressive: bool = False


@dataclass(frozen=True, slots=True)
class VideoResult:
    """What `undistort_video` wrote.

    Attributes
    ----------
    path : Path
    frames : int
        How many.
    size : tuple of int
        Their (width, height) in pixels.
    encoder, pixel_format : str
        libav's names.
    warnings : tuple of str
        What a person should know: what the new file lacks, and what was wrong with the old one.
    """

    path: Path
    frames: int
    size: tuple[int, int]
    encoder: str
    pixel_format: str
    warnings: tuple[str, ...] = ()


def undistort_video(
    source: str | Path,
    target: str | Path,
    undistort: UndistortMap,
    *,
    options: VideoOptions | None = None,
    force: bool = False,
    advance: Callable[[], None] | None = None,
    note: str = NOTE,
) -> VideoResult:
    """Take the lens out of a video.

    The frames keep their times, sound and other streams are copied as they are, tags, chapters, colours, aspect ratio and
    rotation are kept as far as the new container has a place for them. What sees nothing becomes black. Memory does not
    depend on the length of the video.

    Parameters
    ----------
    source : str or Path
        Any container that libav reads.
    target : str or Path
        Its extension says which container is written.
    undistort : UndistortMap
        From the camera that took the video to that of the new one; frames are used as they are stored, before any rotation
        for display.
    options : VideoOptions, optional
    force : bool
        Whether a file that exists is replaced.
    advance : callable, optional
        Called after each frame.
    note : str
        What is written into the new file's tags.

    Returns
    -------
    VideoResult

    Raises
    ------
    InputError
        If the source cannot be read to the end of what is asked for, is not of the camera's size or is interlaced, the
        options do not go together, or the target cannot be written. Nothing is written then.
    """
    options = options or VideoOptions()
    old, new = Path(source), Path(target)
    container = container_format(new)
    if new.exists() and old.exists() and new.samefile(old):
        raise InputError(f"{new}: output would replace its own input. Choose another name.")
    claim_file(new, force=force)
    threads = options.encoding.threads
    with VideoReader(old, as_progressive=options.as_progressive, threads=threads) as reader:
        _check_size(reader, undistort.source.size)
        source_codec = SourceCodec(
            reader.codec,
            reader.stream.profile or "",
            is_lossless(reader.codec, reader.stream.codec_context.extradata or b""),
            reader.layout,
        )
        encoding = choose_encoding(source_codec, container, options.encoding)
        size = undistort.target.size
        _check_parity(new, size, encoding)
        reader.convert_to(encoding.layout)
        mover = FrameMover(undistort, encoding.layout, options.interpolation)
        with VideoWriter(
            new, reader, size, encoding, container=container, note=note, chosen=options.frames, threads=threads
        ) as writer:
            frames = _move_all(reader, writer, mover, options.frames, advance)
            writer.finish()
    clauses = (*encoding.warnings, *writer.warnings)
    warnings = (*reader.warnings, *(f"{new}: {clause}." for clause in clauses))
    return VideoResult(new, frames, size, encoding.encoder, encoding.pixel_format, warnings)


class FrameMover:
    """Moves the planes of frames from one camera's view to another's.

    Parameters
    ----------
    undistort : UndistortMap
        Of the whole picture.
    layout : PixelLayout
        Of the frames.
    interpolation : str
        As for `undistort_image`.
    """

    def __init__(self, undistort: UndistortMap, layout: PixelLayout, interpolation: str) -> None:
        self._layout, self._interpolation = layout, interpolation
        self._highest = (1 << layout.depth) - 1
        self._scratch = Scratch()
        kinds = {(plane.step, plane.siting) for plane in layout.planes}
        self._maps = {kind: plane_map(undistort, *kind) for kind in sorted(kinds)}

    def move(self, sources: Sequence[Planes], targets: Sequence[Planes]) -> None:
        """Fill the planes of the targets from those of the sources, frame by frame."""
        for kind, undistort in self._maps.items():
            jobs = [
                (old[index], new[index], plane.black)
                for index, plane in enumerate(self._layout.planes)
                if (plane.step, plane.siting) == kind
                for old, new in zip(sources, targets, strict=True)
            ]
            for four in _groups(jobs, FRAMES_AT_ONCE):
                self._move_four(four, undistort)

    def _move_four(self, jobs: Sequence[tuple[Image, Image, int]], undistort: UndistortMap) -> None:
        """Move up to four planes through one map: side by side, as the channels of one image."""
        # One that is missing is filled up by another, whose result goes nowhere.
        full = [jobs[min(index, len(jobs) - 1)] for index in range(FRAMES_AT_ONCE)]
        (old, new, _), *_ = full
        before, after = (
            self._scratch.array(name, (*plane.shape, FRAMES_AT_ONCE), plane.dtype)
            for name, plane in (("before", old), ("after", new))
        )
        cv2.merge([old for old, _, _ in full], dst=before)
        blacks = [black for _, _, black in full]
        undistort_image(before, undistort, interpolation=self._interpolation, fill=blacks, alpha=False, out=after)
        if self._interpolation != "linear" and self._layout.depth > 8:
            # Sharper kernels overshoot, and sixteen bits do not end where ten do.
            np.minimum(after, self._highest, out=after)
        for channel, (_, new, _) in enumerate(jobs):
            cv2.extractChannel(after, channel, dst=new)


def _move_all(
    reader: VideoReader, writer: VideoWriter, mover: FrameMover, chosen: FrameRange, advance: Callable[[], None] | None
) -> int:
    """Read, move and write frame after frame; return how many."""
    count = 0
    with single_threaded():
        for pictures in _groups(reader.pictures(chosen, writer.copy), FRAMES_AT_ONCE):
            canvases = [writer.canvas() for _ in pictures]
            mover.move([picture.planes for picture in pictures], [canvas.planes for canvas in canvases])
            for picture, canvas in zip(pictures, canvases, strict=True):
                writer.write(canvas, picture.pts, picture.duration)
                count += 1
                if advance is not None:
                    advance()
    return count


def _groups(items: Iterable[Item], count: int) -> Iterator[list[Item]]:
    """Lists of `count` items, the last one shorter."""
    group: list[Item] = []
    for item in items:
        group.append(item)
        if len(group) == count:
            yield group
            group = []
    if group:
        yield group


def _check_size(reader: VideoReader, size: tuple[int, int]) -> None:
    """Refuse a video that is not of the camera's size, by name."""
    info = reader.info
    if info.size == size:
        return
    turned = f", shown turned by {info.rotation_deg} degrees" if info.rotation_deg else ""
    raise InputError(
        f"{reader.path}: not the camera's image size (got {info.size[0]}x{info.size[1]}{turned}, "
        f"expected {size[0]}x{size[1]}). {advice_on_size(info.size, size)}"
    )


def _check_parity(path: Path, size: tuple[int, int], encoding: Encoding) -> None:
    """Refuse a size that leaves half a sample of a subsampled plane, where the codec has no place for it."""
    if ENCODERS[encoding.encoder].codec not in ("h264", "hevc"):
        return
    layout = encoding.layout
    across, down = (max(plane.step[axis] for plane in layout.planes) for axis in (0, 1))
    width, height = size
    if width % across or height % down:
        raise InputError(
            f"{path}: a size that {layout.name} cannot have (got {width}x{height}, expected multiples of {across} and {down}). "
            "Choose another size, or a pixel format without subsampling such as yuv444p."
        )
