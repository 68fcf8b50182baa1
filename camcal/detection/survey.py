"""The largest checkerboard in an image, whatever its size: to tell which board is really there."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from camcal.detection.grid import contrasts, grown, is_grid, leaves_image, right_handed, trimmed
from camcal.detection.sampling import Gray, reduced
from camcal.geometry.arrays import FloatArray

# Longer side of the images that are searched, and the smallest grid taken for a start. Squares of three pixels are found
# where the image is small enough to be enlarged.
_SEARCHES = ((480, (5, 4)), (640, (4, 3)))
_MOST_ENLARGED = 4.0
# What is reported must be big enough not to be a chance of texture.
_FEWEST_CORNERS = 12

# The sector-based finder clusters with random numbers; OpenCV's generator belongs to the thread.
_SEED = 0


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """The largest checkerboard of any size in an image.

    Attributes
    ----------
    grid : ndarray of shape (R, C, 2)
        Its corners in full-size pixels; shape (0, 0, 2) if there is none.
    complete : bool
        Whether every corner of it looks like one.
    cut_rows, cut_columns : bool
        Whether more rows, and whether more columns, would lie outside the image.
    """

    grid: FloatArray
    complete: bool
    cut_rows: bool
    cut_columns: bool

    @property
    def sides(self) -> tuple[int, int]:
        """Number of inner corners along the shorter side and along the longer one."""
        rows, columns = self.grid.shape[:2]
        return min(rows, columns), max(rows, columns)

    @property
    def is_empty(self) -> bool:
        """Whether nothing was seen that cannot be a chance of texture."""
        return self.sides[0] * self.sides[1] < _FEWEST_CORNERS

    def size(self, like: tuple[int, int]) -> tuple[int, int]:
        """Inner (columns, rows), the longer side where `like` has it, because the image may be turned."""
        short, long = self.sides
        return (short, long) if like[0] < like[1] else (long, short)

    def is_larger(self, asked: tuple[int, int]) -> bool:
        """Whether the board has more corners in some direction than one of (columns, rows)."""
        return self.sides[0] > min(asked) or self.sides[1] > max(asked)

    def contains(self, asked: tuple[int, int]) -> bool:
        """Whether a board of (columns, rows) would be a part of this larger one."""
        return self.is_larger(asked) and self.sides[0] >= min(asked) and self.sides[1] >= max(asked)

    def is_cut(self, asked: tuple[int, int]) -> bool:
        """Whether all that is missing of a board of (columns, rows) would lie outside the image."""
        sides = sorted(zip(self.grid.shape[:2], (self.cut_rows, self.cut_columns), strict=True))
        missing = [leaves for (have, leaves), want in zip(sides, sorted(asked), strict=True) if have < want]
        return len(missing) > 0 and all(missing)

    def counts_squares(self, asked: tuple[int, int]) -> bool:
        """Whether (columns, rows) are this board's squares, and no part of it is missing."""
        return (self.sides[0] + 1, self.sides[1] + 1) == (min(asked), max(asked)) and not self.is_cut(asked)


def survey(gray: Gray) -> Survey:
    """Look for a checkerboard of any size.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    """
    best, complete = np.zeros((0, 0, 2)), False
    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE
    for longest_px, smallest in _SEARCHES:
        search = reduced(gray, longest_px, _MOST_ENLARGED)
        cv2.setRNGSeed(_SEED)
        found, corners, meta = cv2.findChessboardCornersSBWithMeta(search.gray, smallest, flags)
        if not found:
            continue
        grid = np.asarray(corners, dtype=np.float64).reshape(*meta.shape[:2], 2)
        grid = trimmed(search.gray, right_handed(grid))
        if min(grid.shape[:2]) < 3 or not is_grid(grid, contrasts(search.gray, grid)):
            continue
        grid = grown(search.gray, grid)
        if grid.size > best.size:
            best, complete = search.to_full(grid), is_grid(grid, contrasts(search.gray, grid))
    cut_rows, cut_columns = leaves_image(gray, best) if best.size else (False, False)
    return Survey(best, complete, cut_rows, cut_columns)
