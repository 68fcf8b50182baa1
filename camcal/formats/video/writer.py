"""Videos written: new pictures with the old one's times, tags, sound and chapters, whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from camcal.errors import InputError
from camcal.formats.video.codecs import Encoding
from camcal.formats.video.companions import Companions
from camcal.formats.video.containers import container_options
from camcal.formats.video.encoders import ENCODERS
from camcal.formats.video.pixels import plane_arrays
from camcal.formats.video.reader import VideoReader
from camcal.formats.video.tags import COLOUR_TAGS, container_tags, display_matrix, losses, stream_tags
from camcal.formats.video.trimming import FrameRange, chosen_chapters
from camcal.observations import Image

if TYPE_CHECKING:
    from av import Packet, VideoFrame, VideoStream
    from av.stream import Stream

_BIT_EXACT = 1024
_FULL_RANGE = 2


@dataclass(frozen=True, slots=True, eq=False)
class Canvas:
    """A picture to be filled.

    Attributes
    ----------
    planes : tuple of ndarray
        Each of shape (height, width) of that plane, uint8 or uint16, with no values yet.
    frame : av.VideoFrame
        Whose memory they are.
    """

    planes: tuple[Image, ...]
    frame: VideoFrame


class VideoWriter:
    """A video being written beside its target, as a context manager; `finish` puts it in place.

    Whatever interrupts it before, Ctrl-C included, nothing is left behind and the target is as it was.

    Parameters
    ----------
    target : Path
    reader : VideoReader
        The source: gives times, tags and the streams that are copied.
    size : tuple of int
        (width, height) of the pictures.
    encoding : Encoding
    container : str
        libav's name of the container.
    note : str
        What was done to the pictures, for the container's tags.
    chosen : FrameRange
        The frames of the source that come; unless they begin with the first, times are counted from theirs.
    threads : int
        Of the encoder; 0 is one per processor.

    Attributes
    ----------
    warnings : list of str
        A clause each for what the new file lacks.

    Raises
    ------
    InputError
        If the encoder refuses its settings or the target cannot be written.
    """

    def __init__(
        self,
        target: Path,
        reader: VideoReader,
        size: tuple[int, int],
        encoding: Encoding,
        *,
        container: str,
        note: str,
        chosen: FrameRange,
        threads: int = 0,
    ) -> None:
        import av

        self.warnings: list[str] = []
        self._target, self._reader, self._size, self._encoding = target, reader, size, encoding
        self._chosen = chosen
        self._shift: int | None = 0 if chosen.start == 0 else None
        self._begun = self._rounded = False
        self._note, self._begin_s = note, Fraction(0)
        # AVI numbers frames and knows no other time.
        self._unit = 1 / reader.rate if container == "avi" else reader.time_base
        self._last: int | None = None
        self._early: list[Packet[Stream]] = []
        tags = container_tags(reader.container.metadata, note, container)
        self._temporary = target.absolute().with_name(f".camcal-{os.urandom(8).hex()}.tmp")
        ticks = reader.time_base.denominator if reader.time_base.numerator == 1 else None
        options = container_options(container, target.suffix.lower(), tags, ticks)
        with self._writing():
            self._output = av.open(
                str(self._temporary), "w", format=container, container_options=options, metadata_errors="surrogateescape"
            )
            # Without it Matroska draws its identifiers by lot.
            self._output.flags |= _BIT_EXACT
            self._output.metadata.update(tags)
            self._stream = self._add_video(threads)
        self._companions = Companions(reader.other_streams, self._output)
        self.warnings += self._companions.warnings

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        with suppress(Exception):
            self._output.close()
        self._temporary.unlink(missing_ok=True)

    def canvas(self) -> Canvas:
        """Return memory for a picture; it may be filled on any thread."""
        import av

        encoding = self._encoding
        # The planes of a format with a "j" are those of the one without.
        planar = encoding.pixel_format.replace("yuvj", "yuv") == encoding.layout.name
        frame = av.VideoFrame(*self._size, encoding.pixel_format if planar else encoding.layout.name)
        for tag in COLOUR_TAGS:
            setattr(frame, tag, getattr(self._stream.codec_context, tag))
        return Canvas(plane_arrays(frame), frame)

    def write(self, canvas: Canvas, pts: int, duration: int) -> None:
        """Encode a picture; its memory belongs to the encoder from now on.

        Parameters
        ----------
        canvas : Canvas
        pts, duration : int
            As the reader gave them.
        """
        if self._shift is None:
            self._shift = pts
        self._begin()
        while self._early:
            self.copy(self._early.pop(0))
        frame = canvas.frame
        time_s = (pts - self._shift) * self._reader.time_base
        time = round(time_s / self._unit)
        self._rounded = self._rounded or (time_s / (self._stream.time_base or self._unit)).denominator != 1
        if self._last is None:
            self._begin_s = time_s
        elif time <= self._last:
            time = self._last + 1
        self._last = frame.pts = time
        frame.time_base, frame.duration = self._unit, round(duration * self._reader.time_base / self._unit)
        with self._writing():
            self._output.mux(self._stream.encode(frame))

    def copy(self, packet: Packet[Stream]) -> None:
        """Write a packet of one of the reader's other streams; it waits until it is known where time begins."""
        if self._shift is None:
            self._early.append(packet)
            return
        self._begin()
        with self._writing():
            self._companions.copy(packet, self._shift_s)

    def finish(self) -> None:
        """Encode what the encoder still holds, close the file, compare it with the source and rename it to its target.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        with self._writing():
            self._output.mux(self._stream.encode(None))
            self._output.close()
        try:
            self.warnings += losses(self._temporary, self._reader, self._note, self._begin_s, rounded=self._rounded)
        except InputError:
            raise InputError(f"{self._target}: cannot be read back as it was written. Choose another codec or place.") from None
        with self._writing():
            self._temporary.replace(self._target)

    @property
    def _shift_s(self) -> Fraction:
        """By how much every time of the source is moved back."""
        return (self._shift or 0) * self._reader.time_base

    def _add_video(self, threads: int) -> VideoStream:
        """Add the stream of pictures, described as the source's is."""
        from av.codec.context import Flags

        reader, encoding, first = self._reader, self._encoding, self._reader.first_frame
        # SVT-AV1 would write to the terminal by itself.
        os.environ.setdefault("SVT_LOG", "1")
        made: Any = self._output.add_stream(
            encoding.encoder,
            rate=reader.rate,
            options=dict(encoding.options) | ({"bf": "0"} if self._output.format.name == "avi" else {}),
            width=self._size[0],
            height=self._size[1],
            time_base=self._unit,
        )
        context = made.codec_context
        context.pix_fmt, context.thread_count = encoding.pixel_format, threads
        context.flags |= Flags.frame_duration
        for tag in COLOUR_TAGS:
            setattr(context, tag, getattr(first, tag))
        if reader.layout.full_range:
            context.color_range = _FULL_RANGE
        if reader.stream.sample_aspect_ratio:
            context.sample_aspect_ratio = reader.stream.sample_aspect_ratio
        if ENCODERS[encoding.encoder].codec == "hevc" and self._output.format.name in ("mp4", "mov"):
            # Of the two tags the one that Apple's players know.
            context.codec_tag = "hvc1"
        made.set_display_matrix(display_matrix(first))
        made.disposition = reader.stream.disposition
        made.metadata.update(stream_tags(reader.stream.metadata))
        stream: VideoStream = made
        return stream

    def _begin(self) -> None:
        """Write the header, once it is known where time begins."""
        if self._begun:
            return
        self._begun = True
        chapters = chosen_chapters(self._reader.container.chapters(), self._chosen, self._shift_s, self._reader.rate)
        if chapters:
            self._output.set_chapters(chapters)
        with self._writing():
            self._output.start_encoding()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Turn what libav and the system say of the target into one line."""
        import av

        try:
            yield
        except OSError as error:
            cause = (error.strerror or str(error)).lower()
            raise InputError(f"{self._target}: cannot be written ({cause}). Choose another place.") from None
        except (av.FFmpegError, ValueError) as error:
            encoding, (width, height) = self._encoding, self._size
            cause = str(getattr(error, "strerror", None) or error).lower()
            raise InputError(
                f"{self._target}: {encoding.encoder} refuses {width}x{height} {encoding.pixel_format} ({cause}). "
                "Choose another codec, preset or size."
            ) from None
