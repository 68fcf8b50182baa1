"""What a detector sees of a board that it does not accept: a grid of another size, tags, squares that might belong to one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from camcal.boards.aprilgrid import BORDER_BITS, AprilGrid
from camcal.boards.base import Board
from camcal.detection.reading import read_tags
from camcal.detection.sampling import Gray, reduced
from camcal.detection.survey import survey
from camcal.detection.tags import Tags, find_squares, find_tags
from camcal.geometry.arrays import FloatArray, IntArray

_SEARCH_PX = 1600
# More squares than this are a texture, and hide the picture that they are drawn on.
_MOST_SQUARES = 400


@dataclass(frozen=True, slots=True, eq=False)
class HalfSeen:
    """What was seen in an image that gave no detection.

    Attributes
    ----------
    text : str
        What it is, as a clause.
    grid_px : ndarray of shape (R, C, 2)
        Corners of the largest checkerboard, whatever its size, in pixels; shape (0, 0, 2) if there is none.
    tag_ids : ndarray of shape (T,)
        Ids of the tags that can be read, int64.
    tags_px : ndarray of shape (T, 4, 2)
        Their corners BL, BR, TR, TL in pixels.
    squares_px : ndarray of shape (Q, 4, 2)
        Where there is neither: dark quadrangles, corners in pixels.
    """

    text: str
    grid_px: FloatArray = field(default_factory=lambda: np.zeros((0, 0, 2)))
    tag_ids: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    tags_px: FloatArray = field(default_factory=lambda: np.zeros((0, 4, 2)))
    squares_px: FloatArray = field(default_factory=lambda: np.zeros((0, 4, 2)))


def half_seen(gray: Gray, board: Board) -> HalfSeen:
    """Look for anything that a board consists of.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    board : Board
        The one that was asked for and not found.
    """
    seen, tags, of = survey(gray), *_tags(gray, board)
    parts = []
    if not seen.is_empty:
        rows, columns = seen.grid.shape[:2]
        parts.append(f"a grid of {max(rows, columns)}x{min(rows, columns)} inner corners")
    if len(tags):
        parts.append(f"{len(tags)} {'tag' if len(tags) == 1 else 'tags'} of {of}")
    if parts:
        grid = np.zeros((0, 0, 2)) if seen.is_empty else seen.grid
        return HalfSeen(" and ".join(parts), grid, tags.ids, tags.corners_px)
    search = reduced(gray, _SEARCH_PX)
    squares = search.to_full(find_squares(search.gray))
    if 0 < len(squares) <= _MOST_SQUARES:
        return HalfSeen("dark shapes of four sides, but no board made of them", squares_px=squares)
    return HalfSeen("nothing that looks like a board")


def _tags(gray: Gray, board: Board) -> tuple[Tags, str]:
    """Tags of any family where there are several, else single ones of the board's own, and the family."""
    reading = read_tags(gray)
    if reading.printed is not None:
        return reading.tags, reading.printed.family
    if not isinstance(board, AprilGrid):
        return Tags.none(), ""
    search = reduced(gray, _SEARCH_PX)
    found = [find_tags(search.gray, board.family, bits, board.tag_count) for bits in BORDER_BITS]
    most = max(found, key=len)
    return Tags(most.ids, search.to_full(most.corners_px)), board.family
