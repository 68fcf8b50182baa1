"""The checkerboard, counted in inner corners; the square up-left of the first corner is black."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from camcal.boards.base import Pattern, Symmetry
from camcal.boards.fields import checked_count, checked_length, format_length, parse_grid, parse_length
from camcal.geometry.arrays import FloatArray
from camcal.geometry.pose import Pose

# The finders see no pattern below three corners a side.
_FEWEST_CORNERS = 3


@dataclass(frozen=True, slots=True)
class Checkerboard:
    """A checkerboard; feature id = row * columns + column, at (column, row) * square.

    Attributes
    ----------
    columns, rows : int
        INNER corners, where four squares meet: one less than the squares in that direction.
    square_m : float
        Side of a square in metres.

    Raises
    ------
    ValueError
        If a count is below 3 or absurd, or the side is not positive or absurd.

    Examples
    --------
    >>> board = Checkerboard(columns=9, rows=6, square_m=0.025)
    >>> board.spec, board.feature_count, board.object_points[10].tolist()
    ('checkerboard:9x6:25mm', 54, [0.025, 0.025, 0.0])
    """

    columns: int
    rows: int
    square_m: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", checked_count(self.columns, _FEWEST_CORNERS, "columns of inner corners"))
        object.__setattr__(self, "rows", checked_count(self.rows, _FEWEST_CORNERS, "rows of inner corners"))
        object.__setattr__(self, "square_m", checked_length(self.square_m, "square"))

    @classmethod
    def from_fields(cls, fields: Sequence[str], _options: Mapping[str, str]) -> Checkerboard:
        """Build the board from a one-liner's fields (size, square); it has no options."""
        size, square = fields
        columns, rows = parse_grid(size, "inner corners")
        return cls(columns, rows, float(parse_length(square, "square")))

    @property
    def spec(self) -> str:
        """The one-liner that names the board."""
        return f"checkerboard:{self.columns}x{self.rows}:{format_length(self.square_m)}"

    @property
    def feature_count(self) -> int:
        """Number of inner corners."""
        return self.columns * self.rows

    @property
    def object_points(self) -> FloatArray:
        """Inner corners in metres, board frame: shape (N, 3), z = 0, read-only."""
        return _object_points(self)

    @property
    def pattern(self) -> Pattern:
        """The squares, with one square side of white around them."""
        return _pattern(self)

    @property
    def transposed(self) -> Checkerboard | None:
        """The board with rows and columns swapped; None if it has as many of both."""
        return None if self.columns == self.rows else replace(self, columns=self.rows, rows=self.columns)

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """Every turn that keeps both the corners and the colours of the squares.

        A half turn takes the top-left square to the bottom-right one, columns + rows steps away: the same colour where
        that sum is even. A quarter turn takes it to the top-right one, columns steps away, on boards as wide as high.
        """
        return _symmetries(self)


@lru_cache(maxsize=64)
def _object_points(board: Checkerboard) -> FloatArray:
    row, column = np.divmod(np.arange(board.feature_count), board.columns)
    points = np.stack([column * board.square_m, row * board.square_m, np.zeros(board.feature_count)], axis=1)
    points.flags.writeable = False
    return points


@lru_cache(maxsize=64)
def _pattern(board: Checkerboard) -> Pattern:
    row, column = np.indices((board.rows + 1, board.columns + 1))
    ink = np.pad((row + column + 1) % 2, 1)
    x = np.arange(-2, board.columns + 2, dtype=np.float64) * board.square_m
    y = np.arange(-2, board.rows + 2, dtype=np.float64) * board.square_m
    return Pattern(x, y, ink.astype(np.float64))


@lru_cache(maxsize=64)
def _symmetries(board: Checkerboard) -> tuple[Symmetry, ...]:
    quarters: tuple[int, ...] = ()
    if (board.columns + board.rows) % 2 == 0:
        quarters = (1, 2, 3) if board.columns == board.rows and board.columns % 2 == 0 else (2,)
    return tuple(_turn(board, quarter) for quarter in quarters)


def _turn(board: Checkerboard, quarters: int) -> Symmetry:
    """The turn by a number of quarters about the board's centre, from x towards y."""
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    R = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    row, column = np.divmod(np.arange(board.feature_count), board.columns)
    last = np.array([board.columns - 1, board.rows - 1])
    # The shift that brings a turned board back onto itself, in whole squares.
    shift = (last - R[:2, :2] @ last) // 2
    turned_column, turned_row = R[:2, :2] @ np.stack([column, row]) + shift[:, None]
    return Symmetry(turned_row * board.columns + turned_column, Pose(R, np.array([*shift, 0]) * board.square_m))
