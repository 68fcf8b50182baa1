"""Rows of text cells under named columns, each row with the line that it stands on, turned into numbers and checked."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from camcal.errors import InputError
from camcal.formats.text import read_text, shown
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray

LONGEST_FILE_BYTES = 200_000_000
_LARGEST_COORDINATE_PX = 1e7
_USED_WORDS = {"1": True, "0": False, "true": True, "false": False, "": True}


@dataclass(frozen=True, slots=True)
class CsvText:
    """A CSV file as text.

    Attributes
    ----------
    header : list of str
        Cells of the first row that is not empty, without white space around them.
    header_line : int
        Line that it stands on.
    cells : list of str
        Those of all other rows, one row after the other; as many in each row as in the header.
    lines : list of int
        Line of each of these rows.
    """

    header: list[str]
    header_line: int
    cells: list[str]
    lines: list[int]


def read_csv(
    path: str | Path, delimiter: str = ",", check_header: Callable[[list[str], int], None] = lambda _header, _line: None
) -> CsvText:
    """Read a CSV file in UTF-8.

    Parameters
    ----------
    path : str or Path
    delimiter : str
        One character.
    check_header : callable, optional
        Called with the header and its line before any row is judged; raises if there is no use in going on.

    Raises
    ------
    InputError
        If it cannot be read, its quotes do not match, or a row is longer or shorter than the header.
    """
    text = read_text(path, LONGEST_FILE_BYTES)
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=delimiter)
    lines: list[int] = []
    cells: list[str] = []
    try:
        rows = filter(None, reader)
        header = [cell.strip() for cell in next(rows)]
        header_line = reader.line_num
        check_header(header, header_line)
        for row in rows:
            if len(row) != len(header):
                raise InputError(f"{path}:{reader.line_num}: wrong number of cells (got {len(row)}, expected {len(header)})")
            cells += row
            lines.append(reader.line_num)
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: not valid CSV ({error}). Check the quotes.") from None
    return CsvText(header, header_line, cells, lines)


class Rows:
    """Cells by column.

    Parameters
    ----------
    path : str or Path
        Name of the file, for messages.
    columns : dict of str to sequence of str
        Cells of each column, all of one length.
    lines : sequence of int
        Line that each row stands on.
    """

    def __init__(self, path: str | Path, columns: Mapping[str, Sequence[str]], lines: Sequence[int]) -> None:
        self.path, self.columns, self.lines = path, columns, lines

    def fail(self, row: int, column: str, problem: str) -> NoReturn:
        """Raise for a cell."""
        raise InputError(f"{self.path}:{self.lines[row]}: {column}: {problem}")

    def check(self, column: str, wrong: npt.NDArray[np.bool_], problem: str) -> None:
        """Raise for the first wrong row; `{}` in the problem stands for its cell."""
        if wrong.any():
            row = int(wrong.argmax())
            self.fail(row, column, problem.format(shown(self.columns[column][row])))

    def names(self, column: str) -> list[str]:
        """Texts of a column, none of them empty."""
        cells = list(self.columns[column])
        for row, cell in enumerate(cells):
            if not cell:
                self.fail(row, column, f"missing (expected the {column}'s name)")
        return cells

    def numbers(self, column: str, *, optional: bool = False) -> FloatArray:
        """Numbers of a column, shape (rows,), within what pixels can be; NaN where an optional one is empty or not there."""
        cells = self.columns.get(column)
        if cells is None:
            return np.full(len(self.lines), np.nan)
        values = np.array(self._converted(column, cells, _optional_float if optional else float), dtype=np.float64)
        with np.errstate(invalid="ignore"):
            beyond = ~(np.abs(values) <= _LARGEST_COORDINATE_PX)
        if optional:
            beyond &= ~np.isnan(values)
        self.check(column, beyond, "out of range (got {}, expected a number of pixels)")
        return values

    def wholes(self, column: str, least: int, most: int) -> IntArray:
        """Whole numbers of a column within limits, shape (rows,)."""
        values = np.array(self._converted(column, self.columns[column], float), dtype=np.float64)
        wrong = ~((values >= least) & (values <= most) & (values == np.round(values)))
        self.check(column, wrong, f"out of range (got {{}}, expected a whole number from {least} to {most})")
        return values.astype(np.int64)

    def flags(self, column: str) -> BoolArray:
        """Flags of a column, shape (rows,); true where there is none."""
        cells = self.columns.get(column)
        if cells is None:
            return np.ones(len(self.lines), dtype=bool)
        return np.array(self._converted(column, cells, _flag, "1 or 0"), dtype=bool)

    def _converted(
        self, column: str, cells: Sequence[str], convert: Callable[[str], Any], expected: str = "a number"
    ) -> list[Any]:
        """Convert every cell; on a bad one, find out which it was."""
        try:
            return list(map(convert, cells))
        except ValueError:
            pass
        for row, cell in enumerate(cells):
            try:
                convert(cell)
            except ValueError:
                problem = f"not {expected} (got {shown(cell)})" if cell.strip() else f"missing (expected {expected})"
                self.fail(row, column, problem)
        raise AssertionError("some cell must fail again")


def _optional_float(cell: str) -> float:
    return float(cell) if cell and not cell.isspace() else math.nan


def _flag(cell: str) -> bool:
    word = cell.strip().lower()
    if word not in _USED_WORDS:
        raise ValueError(cell)
    return _USED_WORDS[word]
