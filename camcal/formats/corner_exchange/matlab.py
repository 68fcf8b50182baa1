"""MATLAB's imagePoints as text: M rows, one for each corner, and two columns, x and y, for each image.

It is what `writematrix(imagePoints(:, :), "points.csv")` writes of the M x 2 x images array of `detectCheckerboardPoints`, and
what `imagePoints = reshape(readmatrix("points.csv", NumHeaderLines=1), M, 2, [])` reads back. The corners go down the columns
of the board, in the order of `generateCheckerboardPoints(boardSize, squareSize)`, where boardSize is [rows + 1, columns + 1]:
MATLAB counts squares. The centre of the top-left pixel is (1, 1); NaN is a corner that was not seen. Camcal writes one header
line with the names of the images, which `readmatrix` passes over, and needs none to read.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.errors import InputError
from camcal.formats.corner_exchange.columns import Columns, grid_of
from camcal.formats.corner_rows import CsvText
from camcal.formats.text import shown
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.observations import Detection

_ORIGIN_PX = 1.0
"""MATLAB's coordinate of the centre of the first pixel."""
_AXES = (" x", " y")


def is_matrix(header: Sequence[str]) -> bool:
    """Tell whether the first row of a file is one of such a matrix, or its header as camcal writes it."""
    return len(header) >= 2 and (_is_numeric(header) or _named(header) is not None)


def read_matlab(path: str | Path, board: Board, text: CsvText) -> Columns:
    """Read a matrix of image points.

    Parameters
    ----------
    path : str or Path
    board : Board
        A checkerboard; there is one row for each of its corners.
    text : CsvText
        The content of the file. Without a header the images are called view_1, view_2 and so on.

    Raises
    ------
    InputError
        If it cannot be used.
    """
    grid = grid_of(board, str(path))
    cells, lines, width = text.cells, text.lines, len(text.header)
    names = _named(text.header)
    if _is_numeric(text.header):
        cells, lines = [*text.header, *cells], [text.header_line, *lines]
    if width % 2:
        raise InputError(f"{path}: an odd number of columns (got {width}, expected x and y of each image)")
    if len(lines) != grid.feature_count:
        squares = f"boardSize [{grid.rows + 1} {grid.columns + 1}]"
        got = f"got {len(lines)}, expected {grid.feature_count} for {grid.spec}, MATLAB's {squares}"
        raise InputError(f"{path}: wrong number of rows ({got}). Pass the board with --board.")
    digits = len(str(width // 2))
    views = names or [f"view_{number:0{digits}d}" for number in range(1, width // 2 + 1)]
    values = np.array([_number(path, lines[index // width], cell) for index, cell in enumerate(cells)])
    # To (image, corner, axis), corners in the order of their ids.
    points = values.reshape(len(lines), -1, 2).transpose(1, 0, 2) - _ORIGIN_PX
    order = _order(grid)
    rows = [
        (view, str(order[index]), repr(x), repr(y), line)
        for view, seen in zip(views, points.tolist(), strict=True)
        for index, ((x, y), line) in enumerate(zip(seen, lines, strict=True))
        if not (math.isnan(x) or math.isnan(y))
    ]
    if not rows:
        raise InputError(f"{path}: no corners (all are NaN). Detect them again.")
    image, ids, x, y, found = (list(column) for column in zip(*rows, strict=True))
    return Columns({"image": image, "id": ids, "x": x, "y": y}, found)


def matlab_text(detections: Sequence[Detection], board: Board) -> str:
    """Write corners as MATLAB reads them.

    Parameters
    ----------
    detections : sequence of Detection
    board : Board
        A checkerboard.

    Raises
    ------
    InputError
        If the board is no checkerboard.
    """
    grid = grid_of(board, "matlab")
    points: FloatArray = np.full((grid.feature_count, len(detections), 2), np.nan)
    for index, seen in enumerate(detections):
        points[seen.ids, index] = seen.corners_px + _ORIGIN_PX
    matrix = points[_order(grid)].reshape(grid.feature_count, -1)
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([seen.source + axis for seen in detections for axis in _AXES])
    writer.writerows([["NaN" if math.isnan(value) else repr(value) for value in row] for row in matrix.tolist()])
    return stream.getvalue()


def _order(grid: Checkerboard) -> IntArray:
    """Ids in MATLAB's order, down the columns, shape (N,)."""
    return np.arange(grid.feature_count).reshape(grid.rows, grid.columns).T.ravel()


def _named(header: Sequence[str]) -> list[str] | None:
    """Names of the images in a header that camcal wrote; None if it is another one."""
    if len(header) % 2:
        return None
    pairs = list(zip(header[::2], header[1::2], strict=True))
    names = [first.removesuffix(_AXES[0]) for first, _ in pairs]
    written = all((name + _AXES[0], name + _AXES[1]) == pair for name, pair in zip(names, pairs, strict=True))
    return names if written and len(set(names)) == len(names) else None


def _is_numeric(cells: Sequence[str]) -> bool:
    """Whether all cells are numbers, NaN or empty."""
    try:
        return [float(cell or "nan") for cell in cells] != []
    except ValueError:
        return False


def _number(path: str | Path, line: int, cell: str) -> float:
    """A coordinate; NaN for an empty cell."""
    try:
        return float(cell.strip() or "nan")
    except ValueError:
        raise InputError(f"{path}:{line}: not a number (got {shown(cell)}, expected pixels or NaN)") from None
