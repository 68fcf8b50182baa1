"""CSV files of points: the columns x and y, and whatever else stands beside them, which is kept as it is."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camcal.errors import InputError
from camcal.formats.output import write_atomically
from camcal.formats.text import read_text, shown
from camcal.geometry.arrays import FloatArray

_LONGEST_FILE_BYTES = 1_000_000_000
_SEPARATORS = ";\t"
_UNKNOWN = ("", "nan")


@dataclass(frozen=True, slots=True, eq=False)
class PointsTable:
    """The content of a points file.

    Attributes
    ----------
    path : str
        The file as the user named it.
    header : tuple of str
    rows : list of list of str
        The cells, as they stand in the file.
    lines : list of int
        Line of each row, counted from 1.
    points_px : ndarray of shape (N, 2)
        x and y; NaN where a cell is empty or nan.
    """

    path: str
    header: tuple[str, ...]
    rows: list[list[str]]
    lines: list[int]
    points_px: FloatArray

    def column(self, name: str) -> int | None:
        """Index of a column; None if there is none of that name."""
        names = [cell.strip() for cell in self.header]
        return names.index(name) if name in names else None


def load_points(path: str | Path) -> PointsTable:
    """Read a points file.

    Parameters
    ----------
    path : str or Path
        CSV in UTF-8 with a header line; needs the columns x and y, in pixels.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: column: problem`.
    """
    reader = csv.reader(io.StringIO(read_text(path, _LONGEST_FILE_BYTES), newline=""), strict=True)
    rows: list[list[str]] = []
    lines: list[int] = []
    header: list[str] = []
    try:
        for row in filter(None, reader):
            if not header:
                header = row
                _check_header(path, [cell.strip() for cell in header], reader.line_num)
                continue
            if len(row) != len(header):
                got = f"got {len(row)}, expected {len(header)}"
                raise InputError(f"{path}:{reader.line_num}: wrong number of cells ({got}). Correct this line.")
            rows.append(row)
            lines.append(reader.line_num)
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: not valid CSV ({error}). Check the quotes.") from None
    if not rows:
        raise InputError(f"{path}: no points (only a header). Write at least one into it.")
    names = [cell.strip() for cell in header]
    columns = [[row[names.index(name)] for row in rows] for name in ("x", "y")]
    points = np.stack([_numbers(path, name, cells, lines) for name, cells in zip("xy", columns, strict=True)], axis=1)
    return PointsTable(str(path), tuple(header), rows, lines, points)


def save_points(path: str | Path, table: PointsTable, points_px: FloatArray, replaced: dict[str, str] | None = None) -> None:
    """Write a points file with other points and all other cells as they were.

    Parameters
    ----------
    path : str or Path
    table : PointsTable
    points_px : ndarray of shape (N, 2)
        x and y, written as the shortest text that reads back bit for bit; NaN is an empty cell.
    replaced : dict of str to str, optional
        Text for every cell of other columns, by the column's name.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    texts = {
        name: ["" if math.isnan(value) else repr(value) for value in values]
        for name, values in zip("xy", points_px.T.tolist(), strict=True)
    }
    texts |= {name: [text] * len(table.rows) for name, text in (replaced or {}).items()}
    rows = [list(row) for row in table.rows]
    for name, cells in texts.items():
        column = table.column(name)
        if column is not None:
            for row, cell in zip(rows, cells, strict=True):
                row[column] = cell
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(table.header)
    writer.writerows(rows)
    write_atomically(path, stream.getvalue())


def _check_header(path: str | Path, header: list[str], line: int) -> None:
    """Refuse a header without x and y, or with one of them twice."""
    for name in ("x", "y"):
        if header.count(name) > 1:
            raise InputError(f"{path}:{line}: {name}: column given twice. Remove one of the two.")
    missing = [name for name in ("x", "y") if name not in header]
    if missing and len(header) == 1 and any(mark in header[0] for mark in _SEPARATORS):
        raise InputError(f"{path}:{line}: columns not separated by commas (got {shown(header[0])}). Save it comma-separated.")
    if missing:
        got = shown(", ".join(header))
        raise InputError(f"{path}:{line}: {missing[0]}: missing column (got {got}, expected x and y). Add it.")


def _numbers(path: str | Path, name: str, cells: list[str], lines: list[int]) -> FloatArray:
    """Numbers of a column, shape (N,)."""
    values = np.empty(len(cells))
    for index, cell in enumerate(cells):
        try:
            values[index] = math.nan if cell.strip().lower() in _UNKNOWN else float(cell)
        except ValueError:
            raise InputError(f"{path}:{lines[index]}: {name}: not a number (got {shown(cell)}). Correct it.") from None
        if math.isinf(values[index]):
            raise InputError(f"{path}:{lines[index]}: {name}: not finite (got {shown(cell)}). Correct it.")
    return values
