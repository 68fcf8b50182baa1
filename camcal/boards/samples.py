"""The ready-to-print boards: one table that both the printed files and their test are made from."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Sample:
    """A board on the sheet it is printed on.

    Attributes
    ----------
    name : str
        File name without suffix: the kind, the size and the sheet.
    spec : str
        One-liner of the board.
    paper : str
        Name of the sheet.
    landscape : bool
        Whether the sheet's longer side lies across.
    """

    name: str
    spec: str
    paper: str
    landscape: bool


# Checkerboards of an odd and an even number of corners look the same in one orientation only.
SAMPLES = (
    Sample("checkerboard_9x6_25mm_a4", "checkerboard:9x6:25mm", "a4", landscape=True),
    Sample("checkerboard_11x8_28mm_a3", "checkerboard:11x8:28mm", "a3", landscape=True),
    Sample("aprilgrid_6x6_24mm_a4", "aprilgrid:6x6:24mm:0.3", "a4", landscape=False),
    Sample("aprilgrid_6x6_34mm_a3", "aprilgrid:6x6:34mm:0.3", "a3", landscape=False),
)
"""Two checkerboards and two AprilGrids, for A4 and A3."""
