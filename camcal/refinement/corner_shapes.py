"""What the print looks like around each feature: colours of the four quadrants, free space, and the features next to it."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

import numpy as np

from camcal.boards.base import Board
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray

LEFT, RIGHT, UP, DOWN = range(4)
"""Columns of `CornerShapes.neighbours`: towards -x, +x, -y and +y of the board."""

# Two board coordinates this close (relative to the board) are the same line.
_SAME = 1e-9
# How many cells of the pattern are looked at from a feature in each direction.
_FARTHEST_CELLS = 8


@dataclass(frozen=True, slots=True, eq=False)
class CornerShapes:
    """The print around each of a board's N features.

    Attributes
    ----------
    mix : ndarray of shape (N, 4)
        Weights of the edge along x, the edge along y and their product, as `corner_model.Corners` takes them: the mix is +1
        on paper and -1 on ink but for a constant. A checkerboard's corner is (0, 0, ±1), an L-corner is three times ±1/2.
    clear_m : ndarray of shape (N,)
        Half the side of the square, centred on the feature, in which every quadrant has one colour; metres. 0 where no two
        edges meet.
    pitch_m : ndarray of shape (N, 2)
        Distance to the nearest feature along x and along y in metres; inf if there is none.
    neighbours : ndarray of shape (N, 4)
        Id of the nearest feature to the left, right, above and below (on the same grid line); -1 if there is none.
    """

    mix: FloatArray
    clear_m: FloatArray
    pitch_m: FloatArray
    neighbours: IntArray

    @property
    def has_l_corners(self) -> bool:
        """Whether there are corners that only one quadrant of ink makes."""
        return bool(self.mix[:, :2].any())


def corner_shapes(board: Board) -> CornerShapes:
    """Work out the print around every feature of a board, from its pattern alone. Boards are values: the answer is kept."""
    return _corner_shapes(cast("Hashable", board))


@lru_cache(maxsize=16)
def _corner_shapes(key: Hashable) -> CornerShapes:
    board = cast("Board", key)
    colours, clear_m = _quadrants(board)
    # Along x the tangent is (1, 0) and the normal (0, 1): the step is +1 below. Along y the normal is (-1, 0): +1 on the left.
    below, left = np.array([[-1.0, -1.0], [1.0, 1.0]]), np.array([[1.0, -1.0], [1.0, -1.0]])
    mix = np.stack([(colours * weight).sum(axis=(1, 2)) / 4 for weight in (below, left, below * left, np.ones((2, 2)))], axis=1)
    neighbours = _neighbours(board.object_points[:, :2])
    is_corner = np.abs(mix[:, 2]) > 0
    pitch_m = _pitch(board.object_points[:, :2], neighbours)
    return CornerShapes(mix, np.where(is_corner, clear_m, 0.0), pitch_m, neighbours)


def _quadrants(board: Board) -> tuple[FloatArray, FloatArray]:
    """Colour (+1 paper, -1 ink) of the quadrants, shape (N, 2, 2) as [below][right], and the free half side (N,) in metres."""
    pattern = board.pattern
    points = board.object_points
    lines = (pattern.x_edges_m, pattern.y_edges_m)
    at = [np.abs(edges - points[:, axis, None]).argmin(axis=1) for axis, edges in enumerate(lines)]
    pad = _FARTHEST_CELLS
    ink = np.pad(pattern.ink, pad, constant_values=np.nan)
    x, y = (np.pad(edges, pad, mode="linear_ramp", end_values=(edges[0] - 1e3, edges[-1] + 1e3)) for edges in lines)
    column, row = at[0] + pad, at[1] + pad
    colours = np.empty((len(points), 2, 2))
    clear = np.full(len(points), np.inf)
    for below in (0, 1):
        for right in (0, 1):
            first = ink[row - 1 + below, column - 1 + right]
            colours[:, below, right] = 1 - 2 * first
            for down in range(pad):
                for across in range(pad):
                    other = ink[row + (down if below else -1 - down), column + (across if right else -1 - across)]
                    dx = np.abs(x[column + (across if right else -across)] - points[:, 0])
                    dy = np.abs(y[row + (down if below else -down)] - points[:, 1])
                    distance = np.maximum(dx, dy)
                    clear = np.where(other != first, np.minimum(clear, distance), clear)
    return colours, clear


def _neighbours(points: FloatArray) -> IntArray:
    """Nearest features along the four directions of the board: shape (N, 4), -1 for none."""
    found = np.full((len(points), 4), -1)
    tolerance = _SAME * np.ptp(points, axis=0).max()
    for axis in (0, 1):
        ahead = points[None, :, axis] - points[:, None, axis]
        same_line: BoolArray = np.abs(points[None, :, 1 - axis] - points[:, None, 1 - axis]) <= tolerance
        for side, sign in enumerate((-1, 1)):
            distance = np.where(same_line & (sign * ahead > tolerance), sign * ahead, np.inf)
            nearest = distance.argmin(axis=1)
            found[:, 2 * axis + side] = np.where(np.isfinite(distance.min(axis=1)), nearest, -1)
    return found


def _pitch(points: FloatArray, neighbours: IntArray) -> FloatArray:
    """Distance to the nearest feature along x and along y: shape (N, 2)."""
    distance = np.linalg.norm(points[neighbours] - points[:, None], axis=-1)
    distance[neighbours < 0] = np.inf
    return np.stack([distance[:, :2].min(axis=1), distance[:, 2:].min(axis=1)], axis=1)
