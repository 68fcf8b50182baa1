"""Videos read frame by frame: pictures as planes, and the packets of sound and everything else as they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from camcal.errors import InputError
from camcal.formats.video.clock import Clock
from camcal.formats.video.decoding import Decoder
from camcal.formats.video.opening import main_stream, open_video, refuse_cut_file
from camcal.formats.video.pixels import PixelLayout, planar_layout, plane_arrays
from camcal.formats.video.trimming import FrameRange, PacketGate, packet_time_s
from camcal.observations import Image

if TYPE_CHECKING:
    from av import Packet, VideoFrame, VideoStream
    from av.stream import Stream

    from camcal.formats.video.decoding import Event

_FULL_RANGE, _LIMITED_RANGE = 2, 1
_LATE_S = 10


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """One frame.

    Attributes
    ----------
    planes : tuple of ndarray
        Each of shape (height, width) of that plane, uint8 or uint16.
    pts : int
        When it is shown, in units of the video's time base.
    duration : int
        How long, in the same units; 0 where it is not known.
    """

    planes: tuple[Image, ...]
    pts: int
    duration: int


@dataclass(frozen=True, slots=True)
class VideoInfo:
    """What a video says of itself.

    Attributes
    ----------
    size : tuple of int
        Stored (width, height) in pixels, before any rotation for display.
    frames : int
        How many; estimated where the file does not say, 0 where nothing is known.
    codec, pixel_format : str
        libav's names.
    rotation_deg : int
        By how much players turn it counter-clockwise.
    """

    size: tuple[int, int]
    frames: int
    codec: str
    pixel_format: str
    rotation_deg: int


def probe_video(path: str | Path, *, as_progressive: bool = True) -> VideoInfo:
    """Read what a video says of itself; its first frame is decoded.

    Parameters
    ----------
    path : str or Path
    as_progressive : bool
        Whether it may be marked as interlaced.

    Raises
    ------
    InputError
        If it cannot be read, has no frame, or is interlaced and must not be.
    """
    with VideoReader(path, as_progressive=as_progressive) as reader:
        return reader.info


class VideoReader:
    """A video open for reading, as a context manager; `pictures` is to be called once.

    Parameters
    ----------
    path : str or Path
    as_progressive : bool
        Accept frames that are marked as interlaced.
    threads : int
        Of the decoder; 0 is one per processor.

    Attributes
    ----------
    container : av.container.InputContainer
        With metadata and chapters.
    stream : av.VideoStream
        The video.
    first_frame : av.VideoFrame
        As it was decoded.
    layout : PixelLayout
        Of the pictures, as they are decoded or as `convert_to` says.
    warnings : list of str
        What a person should know, filled while the video is read.

    Raises
    ------
    InputError
        If the file is missing, no video, has no video stream or frame, is interlaced or of unsupported pixels.
    """

    layout: PixelLayout

    def __init__(self, path: str | Path, *, as_progressive: bool = False, threads: int = 0) -> None:
        self.path = Path(path)
        self.warnings: list[str] = []
        self._as_progressive = as_progressive
        self.container = open_video(self.path)
        try:
            self.stream: VideoStream = main_stream(self.path, self.container)
            self.stream.thread_type = "AUTO"
            self.stream.thread_count = threads
            self._begin()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, and let the decoder's threads come to rest first.

        Decoders are freed by whoever drops the last reference, while all other Python waits; a thread of theirs that has
        something to log by way of Python would wait for that one, and that one for the thread.
        """
        for stream in self.container.streams.video:
            if stream.codec_context is not None:
                stream.codec_context.flush_buffers()
        self.container.close()

    @property
    def other_streams(self) -> tuple[Stream, ...]:
        """Every stream but the video itself."""
        return tuple(stream for stream in self.container.streams if stream.index != self.stream.index)

    @property
    def time_base(self) -> Fraction:
        """The unit of the pictures' times, in seconds."""
        return self.stream.time_base or Fraction(1, 90_000)

    @property
    def rate(self) -> Fraction:
        """Frames per second, on average.

        Where frames are not counted, the average is only what the file's writer said; no true one is above the rate that
        libav finds in the times.
        """
        average, found = self.stream.average_rate, self.stream.guessed_rate
        if average and found and not self.stream.frames:
            return min(average, found)
        return average or found or Fraction(25)

    @property
    def codec(self) -> str:
        """The codec, by libav's name."""
        return self.stream.codec.canonical_name

    @property
    def first_time_s(self) -> Fraction:
        """When the first frame is shown."""
        return (self.first_frame.pts or 0) * self.time_base

    @property
    def info(self) -> VideoInfo:
        """What the video says of itself."""
        seconds = (self.stream.duration or 0) * self.time_base or Fraction(self.container.duration or 0, 1_000_000)
        frames = self.stream.frames or round(seconds * self.rate)
        first = self.first_frame
        return VideoInfo((first.width, first.height), frames, self.codec, first.format.name, first.rotation)

    def pictures(self, chosen: FrameRange, copy: Callable[[Packet[Stream]], None]) -> Iterator[Picture]:
        """Decode frame after frame; at most a few are in memory.

        Parameters
        ----------
        chosen : FrameRange
            The frames to give; those before them are decoded and dropped.
        copy : callable
            Is given every packet of the other streams that plays while the chosen frames do.

        Yields
        ------
        Picture
            Its planes must not be written to: the decoder predicts from them.

        Raises
        ------
        InputError
            If the file is truncated or damaged, frames change their size or format, or none is in the range.
        """
        from av import VideoFrame

        refuse_cut_file(self.path, self.stream, chosen)
        gate = PacketGate(chosen, copy)
        count, self._decoder.is_lenient = 0, chosen.start > 0
        for event in self._events:
            if not isinstance(event, VideoFrame):
                gate.offer(event)
                continue
            picture = self._picture(event)
            gate.reached(count, picture.pts * self.time_base)
            if count >= chosen.start:
                self._decoder.is_lenient = False
                yield picture
            count += 1
            if count == chosen.stop:
                gate.close(self._end_of_range(gate))
                break
        else:
            gate.finish()
        if count <= chosen.start:
            raise InputError(f"{self.path}: no frame in the range (got frames {chosen}, expected a start below {count}).")
        self.warnings += self._decoder.warnings

    def convert_to(self, layout: PixelLayout) -> None:
        """Give pictures of another layout from now on."""
        # A format with a "j" has the planes of the one without.
        stored = self.first_frame.format.name.replace("yuvj", "yuv")
        self._convert = stored != layout.name or self.layout.full_range != layout.full_range
        self.layout = layout

    def _begin(self) -> None:
        """Decode up to the first frame, which tells what the stream's header may leave out."""
        from av import VideoFrame

        self._clock = Clock(self.path, self.time_base, self.rate, counts=self.container.format.name == "avi")
        self._decoder = Decoder(self.path, self.container, self.stream, self._clock)
        events = self._decoder.events()
        early: list[Event] = []
        for event in events:
            early.append(event)
            if isinstance(event, VideoFrame):
                self.first_frame = event
                break
        else:
            raise InputError(f"{self.path}: no frame could be decoded. Check that it plays, or record it again.")
        self._events = chain(early, events)
        self._refuse_interlaced(self.first_frame)
        tagged = {_FULL_RANGE: True, _LIMITED_RANGE: False}.get(int(self.first_frame.color_range))
        centred = self.codec in ("mjpeg", "mpeg1video")
        self.layout = planar_layout(self.first_frame.format.name, full_range=tagged, centred_chroma=centred)
        self.convert_to(self.layout)
        if self.stream.metadata.get("alpha_mode") == "1" and not self.layout.alpha:
            self.warnings.append(f"{self.path}: its transparency is not read.")

    def _picture(self, frame: VideoFrame) -> Picture:
        """Check a frame against the first one and give its planes."""
        first = self.first_frame
        got, expected = ((one.width, one.height, one.format.name) for one in (frame, first))
        pts = self._clock.time_of(frame)
        if got != expected:
            raise InputError(
                f"{self.path}: frames change at {float(pts * self.time_base):.2f} s (got {got[0]}x{got[1]} {got[2]}, "
                f"expected {expected[0]}x{expected[1]} {expected[2]}). Split the video there."
            )
        self._refuse_interlaced(frame)
        planar = frame
        if self._convert:
            full = _FULL_RANGE if self.layout.full_range else _LIMITED_RANGE
            planar = frame.reformat(format=self.layout.name, dst_color_range=full)
        return Picture(plane_arrays(planar), pts, frame.duration or 0)

    def _end_of_range(self, gate: PacketGate) -> Fraction:
        """Read on, to when the frame after the range is shown and the sound has come as far; whatever is damaged there."""
        from av import VideoFrame

        end_s: Fraction | None = None
        behind = {stream.index for stream in self.other_streams if stream.type == "audio"}
        try:
            for event in self._events:
                if isinstance(event, VideoFrame):
                    time_s = self._clock.time_of(event) * self.time_base
                    end_s = time_s if end_s is None else end_s
                else:
                    time_s = packet_time_s(event)
                    gate.offer(event)
                    if end_s is not None and time_s >= end_s:
                        behind.discard(event.stream.index)
                if end_s is not None and (not behind or time_s > end_s + _LATE_S):
                    return end_s
        except InputError:
            pass
        return end_s if end_s is not None else self._clock.last_s + 1 / self.rate

    def _refuse_interlaced(self, frame: VideoFrame) -> None:
        if frame.interlaced_frame and not self._as_progressive:
            raise InputError(
                f"{self.path}: interlaced (each frame holds two moments, which a lens correction would mix). "
                "Deinterlace it first, or add --progressive if it is only marked so."
            )
