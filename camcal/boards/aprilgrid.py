"""The AprilGrid: a grid of AprilTags, on Kalibr's boards with black squares at the grid's crossings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from camcal.boards.base import Pattern, Symmetry
from camcal.boards.fields import (
    checked_count,
    checked_length,
    format_length,
    format_spacing,
    parse_choice,
    parse_grid,
    parse_length,
    parse_spacing,
)
from camcal.geometry.arrays import FloatArray

FAMILIES = {"tag36h11": (6, 587), "tag36h10": (6, 2320), "tag25h9": (5, 35), "tag16h5": (4, 30)}
"""Data bits along a tag's side, and number of tags, of each AprilTag family."""

FIRST_TAGS = ("bottom-left", "top-left")
BORDER_BITS = (2, 1)
OPTION_DEFAULTS = {"family": "tag36h11", "first": "bottom-left", "border": "2", "squares": "yes"}
"""Options of the one-liner and what each is when it is not given: Kalibr's board."""

_FEWEST_TAGS = 2
_WIDEST_SPACING = 2.0


@dataclass(frozen=True, slots=True)
class AprilGrid:
    """A grid of AprilTags; feature id = 4 * tag id + corner, corners BL, BR, TR, TL of the tag as printed upright.

    The origin is the top-left corner of the top-left tag, whatever its id.

    Attributes
    ----------
    columns, rows : int
        Tags in each direction.
    tag_m : float
        Outer side of a tag's black border in metres.
    gap_m : float
        Free space between neighbouring tags in metres, which is also the side of the corner squares.
    family : str
        One of `FAMILIES`.
    first : str
        Where tag 0 is: "bottom-left" (ids run right, then up: Kalibr) or "top-left" (ids run right, then down).
    border_bits : int
        Width of the black border in bits: 2 (Kalibr) or 1 (official tags).
    squares : bool
        Whether black gap x gap squares stand at every crossing of the gaps, the outer ring's included.

    Raises
    ------
    ValueError
        If a value makes no sense, or the family has not enough tags.

    Examples
    --------
    >>> board = AprilGrid(columns=6, rows=6, tag_m=0.088, gap_m=0.0264)
    >>> board.spec, board.feature_count, board.object_points[0].tolist()
    ('aprilgrid:6x6:88mm:0.3', 144, [0.0, 0.66, 0.0])
    """

    columns: int
    rows: int
    tag_m: float
    gap_m: float
    family: str = "tag36h11"
    first: str = "bottom-left"
    border_bits: int = 2
    squares: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "columns", checked_count(self.columns, _FEWEST_TAGS, "columns of tags"))
        object.__setattr__(self, "rows", checked_count(self.rows, _FEWEST_TAGS, "rows of tags"))
        object.__setattr__(self, "tag_m", checked_length(self.tag_m, "tag"))
        object.__setattr__(self, "gap_m", checked_length(self.gap_m, "spacing"))
        object.__setattr__(self, "squares", bool(self.squares))
        parse_choice(self.family, FAMILIES, "family")
        parse_choice(self.first, FIRST_TAGS, "first")
        if self.border_bits not in BORDER_BITS:
            raise ValueError(f"border: not a border that tags are printed with (got {self.border_bits!r}, expected 1 or 2)")
        object.__setattr__(self, "border_bits", int(self.border_bits))
        if self.gap_m > _WIDEST_SPACING * self.tag_m:
            ratio = self.gap_m / self.tag_m
            raise ValueError(
                f"spacing: absurd (got {ratio:g} tag sides, expected at most {_WIDEST_SPACING:g}). "
                "A bare number is a ratio of the tag's side, a length needs its unit."
            )
        available = FAMILIES[self.family][1]
        if self.tag_count > available:
            raise ValueError(
                f"size: more tags than {self.family} has (got {self.columns}x{self.rows} = {self.tag_count}, expected "
                f"at most {available})"
            )

    @classmethod
    def from_fields(cls, fields: Sequence[str], options: Mapping[str, str]) -> AprilGrid:
        """Build the board from a one-liner's fields (size, tag, spacing) and options (names checked before)."""
        size, tag, spacing = fields
        columns, rows = parse_grid(size, "tags")
        tag_m = parse_length(tag, "tag")
        chosen = {**OPTION_DEFAULTS, **options}
        return cls(
            columns,
            rows,
            tag_m=float(tag_m),
            gap_m=float(parse_spacing(spacing, tag_m)),
            family=chosen["family"],
            first=chosen["first"],
            border_bits=int(parse_choice(chosen["border"], ("1", "2"), "border")),
            squares=parse_choice(chosen["squares"], ("yes", "no"), "squares") == "yes",
        )

    @property
    def spec(self) -> str:
        """The one-liner that names the board; options appear only where they differ from Kalibr's board."""
        values = {
            "family": self.family,
            "first": self.first,
            "border": str(self.border_bits),
            "squares": "yes" if self.squares else "no",
        }
        options = "".join(f":{name}={value}" for name, value in values.items() if value != OPTION_DEFAULTS[name])
        spacing = format_spacing(self.gap_m, self.tag_m)
        return f"aprilgrid:{self.columns}x{self.rows}:{format_length(self.tag_m)}:{spacing}{options}"

    @property
    def tag_count(self) -> int:
        """Number of tags; their ids are 0 .. tag_count - 1."""
        return self.columns * self.rows

    @property
    def feature_count(self) -> int:
        """Number of tag corners."""
        return 4 * self.tag_count

    @property
    def object_points(self) -> FloatArray:
        """Corners of the tags in metres, board frame: shape (N, 3), z = 0, read-only."""
        return _object_points(self)

    @property
    def pattern(self) -> Pattern:
        """Tags and corner squares, with one gap of white around the outer squares (two around the outer tags)."""
        return _pattern(self)

    @property
    def transposed(self) -> AprilGrid | None:
        """The board with rows and columns swapped; None if it has as many of both."""
        return None if self.columns == self.rows else replace(self, columns=self.rows, rows=self.columns)

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """None: every tag tells which way is up."""
        return ()


def _tag_places(board: AprilGrid) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Column and row from the top, each of shape (T,), of every tag id."""
    row, column = np.divmod(np.arange(board.tag_count), board.columns)
    return column, board.rows - 1 - row if board.first == "bottom-left" else row


@lru_cache(maxsize=64)
def _object_points(board: AprilGrid) -> FloatArray:
    column, row = _tag_places(board)
    pitch_m = board.tag_m + board.gap_m
    left, top = column * pitch_m, row * pitch_m
    right, bottom = left + board.tag_m, top + board.tag_m
    x = np.stack([left, right, right, left], axis=1).ravel()
    y = np.stack([bottom, bottom, top, top], axis=1).ravel()
    points = np.stack([x, y, np.zeros_like(x)], axis=1)
    points.flags.writeable = False
    return points


@lru_cache(maxsize=16)
def _pattern(board: AprilGrid) -> Pattern:
    cells = FAMILIES[board.family][0] + 2 * board.border_bits
    # Along each axis: quiet zone, outer gap, then per tag its cells and the gap after it, quiet zone.
    period = cells + 1
    ink = np.zeros((3 + board.rows * period, 3 + board.columns * period))
    if board.squares:
        ink[1:-1:period, 1:-1:period] = 1
    column, row = _tag_places(board)
    inner = np.arange(cells)
    ink_rows = (2 + row * period)[:, None, None] + inner[:, None]
    ink_columns = (2 + column * period)[:, None, None] + inner
    ink[ink_rows, ink_columns] = tag_ink(board.family, board.tag_count, board.border_bits)
    return Pattern(_edges(board, board.columns, cells), _edges(board, board.rows, cells), ink)


def _edges(board: AprilGrid, count: int, cells: int) -> FloatArray:
    """Grid lines along one axis; a tag's outer lines are the very floats of its corners in `object_points`."""
    starts = np.arange(count) * (board.tag_m + board.gap_m)
    tags = starts[:, None] + board.tag_m * (np.arange(cells + 1) / cells)
    outer = board.gap_m * np.array([1.0, 2.0])
    return np.concatenate([-outer[::-1], tags.ravel(), tags[-1, -1] + outer])


@lru_cache(maxsize=16)
def tag_ink(family: str, count: int, border_bits: int) -> FloatArray:
    """Cells of a family's first tags as officially drawn upright, black border included.

    Parameters
    ----------
    family : str
        One of `FAMILIES`.
    count : int
        Number of tags.
    border_bits : int
        Width of the black border in bits.

    Returns
    -------
    ndarray of shape (count, n, n)
        1 black, 0 white; n = data bits along a side + 2 * border_bits. Read-only.
    """
    import cv2  # here, because a checkerboard need not wait for it

    # DICT_APRILTAG_36h11 and so on; OpenCV draws AprilTags upside down, so each is turned by 180°.
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_APRILTAG_{family.removeprefix('tag')}"))
    cells = FAMILIES[family][0] + 2 * border_bits
    drawn = np.stack([cv2.aruco.generateImageMarker(dictionary, i, cells, borderBits=border_bits) for i in range(count)])
    ink: FloatArray = (drawn[:, ::-1, ::-1] < 128).astype(np.float64)
    ink.flags.writeable = False
    return ink
