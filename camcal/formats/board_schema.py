"""What a board file must look like, camcal's own or Kalibr's target.yaml, and the way from it to a board."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Literal

from camcal.boards.aprilgrid import BORDER_BITS, FAMILIES, FIRST_TAGS, AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.formats.validation import Number, Schema, Whole, schema_only, validate
from camcal.formats.yaml_io import Document, describe, load_yaml
from camcal.nearest import did_you_mean

# What the boards' own checks call a value, and the key it stands under.
_KEYS = {
    "columns of inner corners": "columns",
    "rows of inner corners": "rows",
    "columns of tags": "columns",
    "rows of tags": "rows",
    "square": "square_m",
    "tag": "tag_m",
    "spacing": "gap_m",
    "border": "border_bits",
    "family": "family",
    "first": "first",
    "size": "columns",
}
_KALIBR_KEYS = {"columns": "tagCols", "rows": "tagRows", "tag_m": "tagSize", "gap_m": "tagSpacing"}
_KALIBR_SQUARE_KEYS = {"columns": "targetCols", "rows": "targetRows", "square_m": "rowSpacingMeters"}


# What the boards themselves check, in words of their own.
_Corners = Annotated[Whole, schema_only(minimum=3, maximum=100)]
_Tags = Annotated[Whole, schema_only(minimum=2, maximum=100)]
_Length = Annotated[Number, schema_only(minimum=1e-5, maximum=10)]


class CheckerboardFile(Schema):
    """A checkerboard, counted in inner corners, where four squares meet: one less than the squares."""

    type: Literal["checkerboard"]
    """The kind of board."""
    columns: _Corners
    """Inner corners from left to right."""
    rows: _Corners
    """Inner corners from top to bottom."""
    square_m: _Length
    """Side of a square, metres."""


class AprilGridFile(Schema):
    """A grid of AprilTags; what is not given is as on Kalibr's boards."""

    type: Literal["aprilgrid"]
    """The kind of board."""
    columns: _Tags
    """Tags from left to right."""
    rows: _Tags
    """Tags from top to bottom."""
    tag_m: _Length
    """Outer side of a tag's black border, metres."""
    gap_m: _Length
    """Free space between neighbouring tags, metres; at most twice the tag."""
    family: Annotated[str, schema_only(enum=list(FAMILIES))] = "tag36h11"
    """Family of the tags."""
    first: Annotated[str, schema_only(enum=list(FIRST_TAGS))] = "bottom-left"
    """Where tag 0 is: ids run right, then up from the bottom (Kalibr) or down from the top."""
    border_bits: Annotated[Whole, schema_only(enum=sorted(BORDER_BITS))] = 2
    """Width of a tag's black border in bits: 2 (Kalibr) or 1 (official tags)."""
    squares: bool = True
    """Whether black squares stand at every crossing of the gaps."""


class KalibrAprilGrid(Schema):
    """Kalibr's AprilGrid; the spacing is a ratio of the tag's side."""

    target_type: Literal["aprilgrid"]
    """The kind of board."""
    tagCols: _Tags  # noqa: N815 - Kalibr's name
    """Tags from left to right."""
    tagRows: _Tags  # noqa: N815
    """Tags from bottom to top."""
    tagSize: _Length  # noqa: N815
    """Outer side of a tag's black border, metres."""
    tagSpacing: Annotated[Number, schema_only(exclusiveMinimum=0, maximum=2)]  # noqa: N815
    """Gap between tags over the tag's side."""
    codeOffset: Literal[0] = 0  # noqa: N815
    """Id of the first tag."""


class KalibrCheckerboard(Schema):
    """Kalibr's checkerboard, which counts inner corners too."""

    target_type: Literal["checkerboard"]
    """The kind of board."""
    targetCols: _Corners  # noqa: N815 - Kalibr's name
    """Inner corners from left to right."""
    targetRows: _Corners  # noqa: N815
    """Inner corners from bottom to top."""
    rowSpacingMeters: _Length  # noqa: N815
    """Side of a square, metres."""
    colSpacingMeters: _Length  # noqa: N815
    """The same again: squares must be square."""


def read_board(path: str | Path) -> Board:
    """Read a board file.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: key: problem`.
    """
    document = load_yaml(path)
    readers: dict[str, dict[str, Callable[[Document], Board]]] = {
        "type": {"checkerboard": _checkerboard, "aprilgrid": _aprilgrid},
        "target_type": {"checkerboard": _kalibr_checkerboard, "aprilgrid": _kalibr_aprilgrid},
    }
    key = "target_type" if "target_type" in document.data else "type"
    if key not in document.data:
        raise document.error((key,), "missing (expected checkerboard or aprilgrid). Add it; Kalibr's is called target_type.")
    kind = document.data[key]
    if not isinstance(kind, str) or kind not in readers[key]:
        # Kalibr's third kind is no slip of the pen.
        circles = str(kind) == "circlegrid"
        advice = " Circles are not detected: print another board." if circles else did_you_mean(str(kind), readers[key])
        problem = f"unknown kind of board (got {describe(kind)}, expected {' or '.join(readers[key])})."
        raise document.error((key,), problem + advice)
    return readers[key][kind](document)


def _checkerboard(document: Document) -> Board:
    file = validate(document, CheckerboardFile)
    return _built(document, lambda: Checkerboard(file.columns, file.rows, file.square_m))


def _aprilgrid(document: Document) -> Board:
    file = validate(document, AprilGridFile)
    return _built(document, lambda: AprilGrid(**file.model_dump(exclude={"type"})))


def _kalibr_checkerboard(document: Document) -> Board:
    file = validate(document, KalibrCheckerboard)
    if file.rowSpacingMeters != file.colSpacingMeters:
        problem = (
            f"squares must be square (got {file.colSpacingMeters:g}, expected {file.rowSpacingMeters:g} as in rowSpacingMeters)"
        )
        raise document.error(("colSpacingMeters",), problem)
    return _built(document, lambda: Checkerboard(file.targetCols, file.targetRows, file.rowSpacingMeters), _KALIBR_SQUARE_KEYS)


def _kalibr_aprilgrid(document: Document) -> Board:
    file = validate(document, KalibrAprilGrid)
    # Exact in decimals, as in the one-liner: 0.3 of 0.088 m is 0.0264 m.
    gap_m = float(Fraction(repr(file.tagSpacing)) * Fraction(repr(file.tagSize)))
    return _built(document, lambda: AprilGrid(file.tagCols, file.tagRows, file.tagSize, gap_m), _KALIBR_KEYS)


def _built(document: Document, build: Callable[[], Board], keys: dict[str, str] | None = None) -> Board:
    """Build a board; what it finds wrong is told at the key it stands under."""
    try:
        return build()
    except ValueError as error:
        what, _, problem = str(error).partition(": ")
        key = _KEYS.get(what, "type")
        raise document.error(((keys or {}).get(key, key),), problem or str(error)) from None
