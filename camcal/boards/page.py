"""The printed page, in millimetres: sheets of paper, and where board, ruler and caption stand on them.

Page coordinates have x to the right and y down, with the origin at the sheet's top-left corner.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from camcal.boards.base import Board, Pattern
from camcal.boards.fields import parse_choice
from camcal.errors import InputError
from camcal.geometry.arrays import FloatArray

ISO_SHEETS_MM = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "a2": (420.0, 594.0), "a1": (594.0, 841.0), "a0": (841.0, 1189.0)}
US_SHEETS_MM = {"letter": (215.9, 279.4), "legal": (215.9, 355.6), "tabloid": (279.4, 431.8)}
AUTO = "auto"
"""Name of the smallest sheet of the A series, upright or turned, that a board fits."""

_SHEET_LIMITS_MM = (50.0, 5000.0)
# Printers leave about 4 mm of a sheet's edge blank.
_MARGIN_MM = 4.5
_RULER_MM = 100
_TICK_LENGTHS_MM = {10: 2.4, 5: 1.7, 1: 1.1}
_LINE_MM = 0.15
_LABEL_SIZE_MM = 2.0
_LABEL_BASELINE_MM = 4.4
_UNIT_OFFSET_MM = 2.6
_CAPTION_SIZE_MM = 2.3
_CAPTION_PITCH_MM = 2.9
_CAPTION_BASELINE_MM = 1.9
_RULER_HEIGHT_MM = 5.5
# White between ruler and caption, which also holds the ruler's "mm".
_BETWEEN_MM = 8.0


class Anchor(StrEnum):
    """Which point of a line of text is placed; the values are SVG's."""

    START = "start"
    MIDDLE = "middle"
    END = "end"


@dataclass(frozen=True, slots=True)
class Text:
    """One line of text: where its baseline is anchored, and its font size; millimetres."""

    x_mm: float
    baseline_mm: float
    size_mm: float
    anchor: Anchor
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Page:
    """Everything on a sheet.

    Attributes
    ----------
    width_mm, height_mm : float
    spec : str
        SPEC of the board.
    ink_mm : ndarray of shape (N, 4)
        Left, top, right, bottom of the board's black rectangles; none overlap.
    ruler_mm : ndarray of shape (M, 4)
        The same for the ruler; its first rectangle is the base line, exactly as long as the ruler.
    texts : tuple of Text
        Labels and caption.
    """

    width_mm: float
    height_mm: float
    spec: str
    ink_mm: FloatArray
    ruler_mm: FloatArray
    texts: tuple[Text, ...]


@dataclass(frozen=True, slots=True)
class _Strip:
    """Ruler and caption as they stand on a sheet of some width.

    Beside each other they take one row; where the sheet is too narrow the caption's lines stand below the ruler.
    """

    width_mm: float
    height_mm: float
    ruler_mm: int
    caption: tuple[str, ...]
    beside: bool


def sheet_size(paper: str, *, landscape: bool) -> tuple[float, float]:
    """Width and height in mm of a named sheet or of `WxHmm`; landscape lays the longer side across.

    Raises
    ------
    InputError
        If no such paper is known, or its size is absurd.
    """
    match = re.fullmatch(r"(\d{1,6}(?:\.\d{1,6})?)x(\d{1,6}(?:\.\d{1,6})?)mm", paper.lower())
    if match:
        size = (float(match.group(1)), float(match.group(2)))
    else:
        sheets = ISO_SHEETS_MM | US_SHEETS_MM
        try:
            size = sheets[parse_choice(paper.lower(), sheets, "paper")]
        except ValueError as error:
            raise InputError(f"{error} Any other size is given as e.g. 210x297mm; '{AUTO}' chooses one.") from None
    low, high = _SHEET_LIMITS_MM
    if not (low <= min(size) and max(size) <= high):
        raise InputError(f"paper: absurd size (got {paper}, expected sides of {low:g} to {high:g} mm)")
    return (max(size), min(size)) if landscape else size


def lay_out(board: Board, *, paper: str, landscape: bool) -> Page:
    """Place a board, its ruler and its caption on a sheet.

    The board is centred. The white around it, clear of everything, is the pattern's whole quiet zone where the sheet
    has room for it and never less than half of it.

    Raises
    ------
    InputError
        If the board does not fit; names the sheet that it would fit.
    """
    pattern, spec = board.pattern, board.spec
    if paper.lower() == AUTO:
        found = _smallest_fit(pattern, spec, ISO_SHEETS_MM, (True,) if landscape else (False, True))
        if found is None:
            raise InputError(_misfit(pattern, spec, "paper: the board fits no sheet of the A series", {}))
        paper, landscape = found
    width, height = sheet_size(paper, landscape=landscape)
    need = _need(pattern, spec, width)
    if not _fits(need, (width, height)):
        sheets = US_SHEETS_MM if paper.lower() in US_SHEETS_MM else ISO_SHEETS_MM
        raise InputError(_misfit(pattern, spec, f"paper {paper}: the board does not fit {width:g} x {height:g} mm", sheets))
    return _compose(pattern, spec, width, height)


def _compose(pattern: Pattern, spec: str, width: float, height: float) -> Page:
    """Put the parts on a sheet that is known to hold them."""
    strip = _strip(spec, width)
    quiet, ink_width, ink_height = _extent_mm(pattern)
    strip_top = height - _MARGIN_MM - strip.height_mm
    white = strip_top - ink_height
    white_below = min(quiet, white / 2, white - _edge_mm(quiet))
    left = (width - ink_width) / 2
    top = min((height - ink_height) / 2, strip_top - white_below - ink_height)
    ink = _ink_rectangles(pattern) * 1e3 + np.tile([left - quiet, top - quiet], 2)
    block = min(max(ink_width, strip.width_mm), width - 2 * _MARGIN_MM)
    ruler_left = (width - block) / 2 if strip.beside else (width - strip.ruler_mm) / 2
    ruler, labels = _ruler(strip.ruler_mm, ruler_left, strip_top)
    return Page(width, height, spec, ink, ruler, (*labels, *_caption(strip, (width + block) / 2, width / 2, strip_top)))


def _extent_mm(pattern: Pattern) -> tuple[float, float, float]:
    """Quiet zone, and width and height without it, in mm."""
    left, top, right, bottom = pattern.extent_m
    quiet = float(pattern.x_edges_m[1] - left)
    return quiet * 1e3, (right - left - 2 * quiet) * 1e3, (bottom - top - 2 * quiet) * 1e3


def _need(pattern: Pattern, spec: str, width: float) -> tuple[float, float]:
    """Width and height in mm that the parts take at least on a sheet of some width."""
    quiet, ink_width, ink_height = _extent_mm(pattern)
    edge = _edge_mm(quiet)
    return ink_width + 2 * edge, edge + ink_height + quiet / 2 + _strip(spec, width).height_mm + _MARGIN_MM


def _edge_mm(quiet: float) -> float:
    """Least white in mm between the ink and the edges of the sheet, for a quiet zone in mm."""
    return max(quiet / 2, _MARGIN_MM)


def _fits(need: tuple[float, float], sheet: tuple[float, float]) -> bool:
    """Tell whether a sheet is large enough; a micrometre is forgiven to rounding."""
    return need[0] <= sheet[0] + 1e-3 and need[1] <= sheet[1] + 1e-3


def _smallest_fit(
    pattern: Pattern, spec: str, sheets: dict[str, tuple[float, float]], turns: tuple[bool, ...]
) -> tuple[str, bool] | None:
    """Name and orientation of the first sheet, from small to large, that holds the board."""
    for name in sheets:
        for landscape in turns:
            size = sheet_size(name, landscape=landscape)
            if _fits(_need(pattern, spec, size[0]), size):
                return name, landscape
    return None


def _misfit(pattern: Pattern, spec: str, problem: str, sheets: dict[str, tuple[float, float]]) -> str:
    """Say that a board does not fit, what it needs, and which sheet to take."""
    width = max(_need(pattern, spec, 1e3)[0], _SHEET_LIMITS_MM[0])
    height = max(_need(pattern, spec, width)[1], _SHEET_LIMITS_MM[0])
    size = f"{math.ceil(width - 1e-3)}x{math.ceil(height - 1e-3)}mm"
    found = _smallest_fit(pattern, spec, sheets, (False, True))
    if found is not None:
        advice = f"Use --paper {found[0]}" + (" --landscape" if found[1] else "")
    else:
        advice = f"Use --paper {size}" if max(width, height) <= _SHEET_LIMITS_MM[1] else "Use a smaller board"
    return f"{problem} (it needs {size} with its white border and ruler). {advice}."


def _ink_rectangles(pattern: Pattern) -> FloatArray:
    """Black rectangles (N, 4) in metres from the pattern's top-left corner; cells are merged along, then across, rows."""
    ink = np.pad(pattern.ink > 0.5, ((0, 0), (1, 1))).astype(np.int8)
    step = np.diff(ink, axis=1)
    row, start = np.nonzero(step > 0)
    stop = np.nonzero(step < 0)[1]
    order = np.lexsort((row, stop, start))
    row, start, stop = row[order], start[order], stop[order]
    grows = (np.diff(start) == 0) & (np.diff(stop) == 0) & (np.diff(row) == 1)
    first = np.flatnonzero(np.concatenate([[True], ~grows]))
    last = np.append(first[1:], row.size) - 1
    x, y = pattern.x_edges_m - pattern.x_edges_m[0], pattern.y_edges_m - pattern.y_edges_m[0]
    merged: FloatArray = np.stack([x[start[first]], y[row[first]], x[stop[first]], y[row[last] + 1]], axis=1)
    return merged


def _ruler(length: int, left: float, top: float) -> tuple[FloatArray, tuple[Text, ...]]:
    """Base line with a tick each millimetre below it, and a label each centimetre."""
    at = np.arange(length + 1)
    tick = np.select([at % 10 == 0, at % 5 == 0], [_TICK_LENGTHS_MM[10], _TICK_LENGTHS_MM[5]], _TICK_LENGTHS_MM[1])
    half = _LINE_MM / 2
    ticks = np.stack([left + at - half, np.full(at.shape, top + _LINE_MM), left + at + half, top + tick], axis=1)
    bars = np.concatenate([[[left, top, left + length, top + _LINE_MM]], ticks])
    baseline = top + _LABEL_BASELINE_MM
    labels = [Text(left + n, baseline, _LABEL_SIZE_MM, Anchor.MIDDLE, str(n)) for n in range(0, length + 1, 10)]
    return bars, (*labels, Text(left + length + _UNIT_OFFSET_MM, baseline, _LABEL_SIZE_MM, Anchor.START, "mm"))


def _caption(strip: _Strip, right: float, middle: float, top: float) -> tuple[Text, ...]:
    """Lines at the right of the ruler, or centred below it."""
    x, anchor = (right, Anchor.END) if strip.beside else (middle, Anchor.MIDDLE)
    first = top + _CAPTION_BASELINE_MM + (0 if strip.beside else _RULER_HEIGHT_MM)
    return tuple(Text(x, first + n * _CAPTION_PITCH_MM, _CAPTION_SIZE_MM, anchor, line) for n, line in enumerate(strip.caption))


def _strip(spec: str, width: float) -> _Strip:
    """Ruler and caption for a sheet of some width in mm."""
    inner = width - 2 * _MARGIN_MM
    length = min(_RULER_MM, int((inner - _BETWEEN_MM) // 10) * 10)
    lines = (
        f"camcal calibrate IMAGES --board {spec}",
        f"Print at 100 %, not fitted to the page: the ruler must measure {length} mm.",
    )
    beside = length + _BETWEEN_MM + max(_text_width_mm(line) for line in lines)
    if beside <= inner:
        return _Strip(beside, _RULER_HEIGHT_MM, length, lines, beside=True)
    wrapped = tuple(part for line in lines for part in _wrap(line, inner))
    return _Strip(inner, _RULER_HEIGHT_MM + len(wrapped) * _CAPTION_PITCH_MM, length, wrapped, beside=False)


def _wrap(line: str, width: float) -> list[str]:
    """Break a line after blanks and colons so that every part is at most `width` mm wide."""
    parts = [""]
    for piece in re.split(r"(?<=[ :])", line):
        if parts[-1] and _text_width_mm((parts[-1] + piece).rstrip()) > width:
            parts.append("")
        parts[-1] += piece
    return [part.rstrip() for part in parts]


def _text_width_mm(text: str) -> float:
    """Width of caption text in the font of the PDF, plus a tenth for the fonts of the other formats."""
    from reportlab.pdfbase.pdfmetrics import stringWidth

    return 1.1 * float(stringWidth(text, "Helvetica", _CAPTION_SIZE_MM))
