"""When frames are shown: as a file says, or counted where it does not, and never two at a time."""

from __future__ import annotations

from collections import deque
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from camcal.errors import InputError

if TYPE_CHECKING:
    from av import Packet, VideoFrame
    from av.stream import Stream

_FARTHEST_BACK_S = 1


class Clock:
    """Gives frames their times, in the order of showing.

    Parameters
    ----------
    path : Path
        Of the video, for errors.
    time_base : Fraction
        The unit of times, in seconds.
    rate : Fraction
        Frames per second, where times are counted.
    counts : bool
        Whether the container holds no times of showing, as AVI: its packets are numbered in the order of decoding, and
        frames come out one for one.

    Attributes
    ----------
    nudged : int
        Frames that were given a tick more than the one before, because they had its time or an earlier one.
    """

    def __init__(self, path: Path, time_base: Fraction, rate: Fraction, *, counts: bool) -> None:
        self.nudged = 0
        self._path, self._time_base = path, time_base
        self._step = max(1, round(1 / (rate * time_base)))
        self._numbers: deque[int] | None = deque() if counts else None
        self._last: int | None = None

    @property
    def last_s(self) -> Fraction:
        """The time of the last frame; 0 before the first."""
        return (self._last or 0) * self._time_base

    def count(self, packet: Packet[Stream]) -> None:
        """Take note of a packet that goes to the decoder."""
        if self._numbers is not None and packet.size:
            self._numbers.append(packet.dts or 0)

    def time_of(self, frame: VideoFrame) -> int:
        """Return when the next frame is shown, in ticks.

        Raises
        ------
        InputError
            If that is more than a second before the last one.
        """
        if self._numbers is not None:
            time = self._numbers.popleft() if self._numbers else None
        else:
            time = frame.pts if frame.pts is not None else frame.dts
        if time is None:
            time = 0 if self._last is None else self._last + self._step
        if self._last is not None and time <= self._last:
            back_s = (self._last - time) * self._time_base
            if back_s > _FARTHEST_BACK_S:
                raise InputError(
                    f"{self._path}: time goes back by {float(back_s):.2f} s at {float(self.last_s):.2f} s. Split it there."
                )
            self.nudged += 1
            time = self._last + 1
        self._last = time
        return time
