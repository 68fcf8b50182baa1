"""A part of a video by frame numbers, and the packets of the other streams that play during it."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Self

from camcal.errors import InputError

if TYPE_CHECKING:
    from av import Packet
    from av.container.core import Chapter
    from av.stream import Stream

_RANGE = re.compile(r"(\d*):(\d*)")


@dataclass(frozen=True, slots=True)
class FrameRange:
    """Frames by their number in the order of showing, from 0, as a Python slice counts them.

    Attributes
    ----------
    start : int
        The first.
    stop : int or None
        One past the last; None is the end of the video.

    Raises
    ------
    InputError
        If it is empty or begins before 0.

    Examples
    --------
    >>> FrameRange.parse("10:40")
    FrameRange(start=10, stop=40)
    """

    start: int = 0
    stop: int | None = None

    def __post_init__(self) -> None:
        if self.start < 0 or (self.stop is not None and self.stop <= self.start):
            raise InputError(f"--frames: an empty range (got {self}, expected A:B with 0 <= A < B). Give both.")

    def __str__(self) -> str:
        return f"{self.start}:{'' if self.stop is None else self.stop}"

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read "A:B", "A:" or ":B".

        Raises
        ------
        InputError
            If it is anything else.
        """
        match = _RANGE.fullmatch(text.strip())
        if match is None:
            raise InputError(f"--frames: not a range (got {text!r}, expected A:B, A: or :B). Frames are numbered from 0.")
        first, last = match.groups()
        return cls(int(first or 0), int(last) if last else None)

    @property
    def whole(self) -> bool:
        """Whether nothing is left out."""
        return self.start == 0 and self.stop is None


class PacketGate:
    """Lets packets pass whose time lies within that of the chosen frames.

    The time of the first and of the last frame is known only once they are decoded, which is later than the packets that
    play with them are read: those wait here. What waits is what one file interleaves with the frames inside the decoder.

    Parameters
    ----------
    chosen : FrameRange
    send : callable
        Is given the packets that pass, in their order.
    """

    def __init__(self, chosen: FrameRange, send: Callable[[Packet[Stream]], None]) -> None:
        self._chosen = chosen
        self._send = send
        self._waiting: deque[Packet[Stream]] = deque()
        # Sound may begin a little before the first frame of the video; it belongs to it.
        self._open = chosen.start == 0

    def offer(self, packet: Packet[Stream]) -> None:
        """Take the next packet."""
        if self._chosen.whole:
            self._send(packet)
        else:
            self._waiting.append(packet)

    def reached(self, number: int, time_s: Fraction) -> None:
        """Say when a frame is shown; what plays before it passes or is dropped."""
        if self._chosen.whole:
            return
        self._release(time_s, send=self._open)
        self._open = self._open or number == self._chosen.start

    def close(self, time_s: Fraction) -> None:
        """Say when the first frame after the range is shown: nothing that plays from then on passes."""
        self._release(time_s, send=True)
        self._waiting.clear()

    def finish(self) -> None:
        """Let everything pass that waits, at the end of the video."""
        while self._waiting:
            self._send(self._waiting.popleft())

    def _release(self, before_s: Fraction, *, send: bool) -> None:
        """Pass on or drop what waits and begins before a time; each stream keeps its order."""
        kept: deque[Packet[Stream]] = deque()
        while self._waiting:
            packet = self._waiting.popleft()
            if packet_time_s(packet) >= before_s:
                kept.append(packet)
            elif send:
                self._send(packet)
        self._waiting = kept


def packet_time_s(packet: Packet[Stream]) -> Fraction:
    """Return when a packet begins to play."""
    time = packet.pts if packet.pts is not None else packet.dts
    return (time or 0) * packet.time_base


def chosen_chapters(chapters: list[Chapter], chosen: FrameRange, begin_s: Fraction, rate: Fraction) -> list[Chapter]:
    """Return the chapters that play during the chosen frames, in the time that begins with them.

    Parameters
    ----------
    chapters : list of Chapter
    chosen : FrameRange
    begin_s : Fraction
        When the first of them is shown.
    rate : Fraction
        Frames per second: the end of the range is known only when it comes, so that it is estimated.
    """
    if chosen.whole:
        return chapters
    length_s = None if chosen.stop is None else (chosen.stop - chosen.start) / rate
    kept: list[Chapter] = []
    for chapter in chapters:
        unit = chapter["time_base"] or Fraction(1, 1000)
        start, end = max(0, chapter["start"] - round(begin_s / unit)), chapter["end"] - round(begin_s / unit)
        if length_s is not None:
            end = min(end, round(length_s / unit))
        if end > start:
            kept.append({**chapter, "start": start, "end": end})
    return kept
