"""What a board is: features to be found, and a pattern to be printed or rendered.

The board frame has x to the right and y down as printed, z into the board, and its origin at the top-left feature.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import FloatArray, IntArray, frozen_floats
from camcal.geometry.pose import Pose


@dataclass(frozen=True, slots=True, eq=False)
class Pattern:
    """A print that is constant on the cells of a rectilinear grid (whose lines need not be evenly spaced).

    Attributes
    ----------
    x_edges_m : ndarray of shape (nx + 1,)
        Increasing x of the grid lines in metres, board frame.
    y_edges_m : ndarray of shape (ny + 1,)
        Increasing y of the grid lines in metres, board frame.
    ink : ndarray of shape (ny, nx)
        1 where a cell is printed black, 0 where it is bare white paper.
    """

    x_edges_m: FloatArray
    y_edges_m: FloatArray
    ink: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "x_edges_m", frozen_floats(self.x_edges_m, (None,), "x_edges_m"))
        object.__setattr__(self, "y_edges_m", frozen_floats(self.y_edges_m, (None,), "y_edges_m"))
        cells = (self.y_edges_m.size - 1, self.x_edges_m.size - 1)
        object.__setattr__(self, "ink", frozen_floats(self.ink, cells, "ink"))
        if (np.diff(self.x_edges_m) <= 0).any() or (np.diff(self.y_edges_m) <= 0).any():
            raise ValueError("pattern: grid lines must increase")

    @property
    def extent_m(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom of the pattern (the white quiet zone included) in metres, board frame."""
        x, y = self.x_edges_m, self.y_edges_m
        return float(x[0]), float(y[0]), float(x[-1]), float(y[-1])

    def ink_at(self, points_board: npt.ArrayLike) -> FloatArray:
        """Ink (1 black, 0 white) at points of shape (..., 2) in metres, board frame; NaN off the pattern."""
        xy = np.asarray(points_board, dtype=np.float64)
        column = np.searchsorted(self.x_edges_m, xy[..., 0], side="right") - 1
        row = np.searchsorted(self.y_edges_m, xy[..., 1], side="right") - 1
        rows, columns = self.ink.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        found: FloatArray = np.where(inside, self.ink[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)], np.nan)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Symmetry:
    """A turn of the board that leaves its print unchanged.

    Attributes
    ----------
    ids : ndarray of shape (N,)
        `ids[i]` is the feature that takes the place of feature i.
    T_board_board : Pose
        The motion of the board onto itself: object_points[ids] equals T_board_board.apply(object_points).
    """

    ids: IntArray
    T_board_board: Pose


class Board(Protocol):
    """Any calibration target: N features with ids 0..N-1, and the print they belong to."""

    @property
    def spec(self) -> str:
        """The one-liner that names the board, e.g. `checkerboard:9x6:25mm`; parsing it gives an equal board."""
        ...

    @property
    def feature_count(self) -> int:
        """Number N of features."""
        ...

    @property
    def object_points(self) -> FloatArray:
        """Features in metres, board frame: shape (N, 3), z = 0; row i is the feature with id i."""
        ...

    @property
    def pattern(self) -> Pattern:
        """The print, its white quiet zone included."""
        ...

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """Every turn, other than none, that leaves the print unchanged (empty if the board has one orientation)."""
        ...

    @property
    def transposed(self) -> Board | None:
        """The board with rows and columns swapped, which a SPEC is easily mistaken for; None if there is no other."""
        ...
