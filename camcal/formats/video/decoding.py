"""A video file read to its end: frames decoded, packets of other streams as they are, and what is damaged on the way."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from camcal.errors import InputError
from camcal.formats.video.clock import Clock
from camcal.formats.video.opening import is_cover
from camcal.formats.video.trimming import packet_time_s

if TYPE_CHECKING:
    from av import Packet, VideoFrame, VideoStream
    from av.container import InputContainer
    from av.stream import Stream

    Event = VideoFrame | Packet[Stream]

# Containers whose header says when the file ends, and whether that counts from its first time; others are guessed at.
_SAYS_END = {"mov": True, "matroska": False, "avi": False}
# How far a file may end before its header says: cameras round, and sound may end a little earlier.
_MISSING_S = 0.5


class Decoder:
    """Decodes one video of a file.

    Parameters
    ----------
    path : Path
        What to call it.
    container : av.container.InputContainer
    stream : av.VideoStream
        The video.
    clock : Clock
        Is told of every packet of the video.

    Attributes
    ----------
    is_lenient : bool
        Whether what cannot be decoded is passed over, though frames came before it: they are not those that are wanted.
    """

    def __init__(self, path: Path, container: InputContainer, stream: VideoStream, clock: Clock) -> None:
        self.is_lenient = False
        self._path, self._container, self._stream, self._clock = path, container, stream, clock
        self._decoded = self._concealed = self._passed_over = 0
        self._end_s = Fraction(0)

    def events(self) -> Iterator[Event]:
        """Read and decode to the end of the file; packets of other streams come as they are.

        Raises
        ------
        InputError
            If the file is damaged, or ends before its header says.
        """
        import av

        packets = self._container.demux()
        while True:
            try:
                packet = next(packets, None)
            except av.FFmpegError as error:
                raise self._damaged(str(error.strerror)) from None
            if packet is None:
                break
            self._end_s = max(self._end_s, packet_time_s(packet) + (packet.duration or 0) * packet.time_base)
            if packet.stream.index == self._stream.index:
                yield from self._frames(packet)
            elif packet.size and (is_cover(packet.stream) or packet.stream.type != "video"):
                yield packet
        self._refuse_early_end()

    @property
    def warnings(self) -> list[str]:
        """What was wrong with the file so far and did not stop it, one sentence each."""
        counts = (
            (self._passed_over, "packet", "passed over before the first frame: undecodable, and not counted as a frame"),
            (self._concealed, "damaged frame", "written as the decoder concealed the damage"),
            (self._clock.nudged, "frame", "at the time of the frame before, now shown one tick later"),
        )
        return [f"{self._path}: {count} {one}{'' if count == 1 else 's'} {text}." for count, one, text in counts if count]

    def _frames(self, packet: Packet[Stream]) -> list[VideoFrame]:
        """Decode one packet of the video; what cannot be decoded before the first frame of the range is passed over."""
        import av

        self._clock.count(packet)
        try:
            frames: list[VideoFrame] = self._stream.decode(packet)
        except av.FFmpegError as error:
            if self._decoded and not self.is_lenient:
                raise self._damaged(str(error.strerror)) from None
            # A recording cut out of a broadcast begins between key frames; what lies before a range need not be whole.
            self._passed_over += 1
            return []
        self._decoded += len(frames)
        self._concealed += sum(frame.is_corrupt for frame in frames)
        return frames

    def _refuse_early_end(self) -> None:
        """Refuse a file that ends before its header says."""
        counts_from_first = _SAYS_END.get(self._container.format.name.partition(",")[0])
        if counts_from_first is None or not self._container.duration:
            return
        first = self._container.start_time or 0 if counts_from_first else 0
        expected_s = Fraction(self._container.duration + first, 1_000_000)
        if self._end_s < expected_s - Fraction(_MISSING_S):
            raise self._damaged(f"it ends there, its header says {float(expected_s):.2f} s")

    def _damaged(self, cause: str) -> InputError:
        if not self._decoded:
            return InputError(f"{self._path}: no frame could be decoded ({cause}). Check that it plays, or record it again.")
        time_s = float(self._clock.last_s)
        return InputError(
            f"{self._path}: truncated or damaged at {time_s:.2f} s, frame {self._decoded} ({cause}). Copy it again, or take "
            f"what is whole with --frames 0:{self._decoded}."
        )
