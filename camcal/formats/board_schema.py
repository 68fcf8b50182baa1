"""What a board file must look like, camcal's own or Kalibr's target.yaml, and the way from it to a board."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Literal

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.formats.validation import Number, Schema, Whole, validate
from camcal.formats.yaml_io import Document, describe, load_yaml

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


class CheckerboardFile(Schema):
    """camcal's checkerboard."""

    type: Literal["checkerboard"]
    columns: Whole
    rows: Whole
    square_m: Number


class AprilGridFile(Schema):
    """camcal's AprilGrid; what is not given is as on Kalibr's boards."""

    type: Literal["aprilgrid"]
    columns: Whole
    rows: Whole
    tag_m: Number
    gap_m: Number
    family: str = "tag36h11"
    first: str = "bottom-left"
    border_bits: Whole = 2
    squares: bool = True


class KalibrAprilGrid(Schema):
    """Kalibr's AprilGrid; the spacing is a ratio of the tag's side."""

    target_type: Literal["aprilgrid"]
    tagCols: Whole  # noqa: N815 - Kalibr's name
    tagRows: Whole  # noqa: N815
    tagSize: Number  # noqa: N815
    tagSpacing: Number  # noqa: N815
    codeOffset: Literal[0] = 0  # noqa: N815


class KalibrCheckerboard(Schema):
    """Kalibr's checkerboard, which counts inner corners too."""

    target_type: Literal["checkerboard"]
    targetCols: Whole  # noqa: N815 - Kalibr's name
    targetRows: Whole  # noqa: N815
    rowSpacingMeters: Number  # noqa: N815
    colSpacingMeters: Number  # noqa: N815


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
        raise document.error((key,), f"unknown kind of board (got {describe(kind)}, expected {' or '.join(readers[key])})")
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
