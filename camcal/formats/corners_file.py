"""corners.csv: every corner of every view; enough to solve from, whatever detector it comes from."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from camcal.errors import InputError
from camcal.formats.output import write_atomically
from camcal.formats.text import read_text, shown
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.observations import Detection

HEADER = ("image", "width", "height", "id", "x", "y", "sigma", "residual_x", "residual_y", "used")

_NEEDED = HEADER[:6]
_LONGEST_FILE_BYTES = 200_000_000
_LARGEST_ID = 10**6
_LARGEST_SIDE_PX = 10**6
_LARGEST_COORDINATE_PX = 1e7
# Detectors may place a corner that the frame just cuts a little beyond it.
_OUTSIDE_PX = 1.0
_USED_WORDS = {"1": True, "0": False, "true": True, "false": False, "": True}


@dataclass(frozen=True, slots=True, eq=False)
class CornersTable:
    """The content of a corners file.

    Attributes
    ----------
    detections : tuple of Detection
        Sorted by image name.
    residuals_px : tuple of ndarray of shape (N, 2)
        Observed minus projected for the corners of each detection, in pixels; NaN where it is not known.
    used : tuple of ndarray of shape (N,)
        Which corners of each detection went into the solve.
    """

    detections: tuple[Detection, ...]
    residuals_px: tuple[FloatArray, ...]
    used: tuple[BoolArray, ...]


def save_corners(
    path: str | Path,
    detections: Sequence[Detection],
    residuals_px: Sequence[FloatArray] | None = None,
    used: Sequence[BoolArray] | None = None,
) -> None:
    """Write a corners file; floats are the shortest that read back bit for bit, NaN is an empty cell.

    Parameters
    ----------
    path : str or Path
    detections : sequence of Detection
    residuals_px : sequence of ndarray of shape (N, 2), optional
        Observed minus projected for each detection's corners, in pixels; empty cells by default.
    used : sequence of ndarray of shape (N,), optional
        Which corners went into the solve; all of them by default.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(HEADER)
    for index, seen in enumerate(detections):
        count = len(seen)
        residual = np.full((count, 2), np.nan) if residuals_px is None else np.asarray(residuals_px[index])
        chosen = np.ones(count, dtype=bool) if used is None else np.asarray(used[index])
        numbers = (*seen.corners_px.T, seen.sigma_px, *residual.reshape(count, 2).T)
        columns = (seen.ids.tolist(), *(_cells(column) for column in numbers), chosen.astype(int).tolist())
        writer.writerows((seen.source, *seen.size, *cells) for cells in zip(*columns, strict=True))
    write_atomically(path, stream.getvalue())


def load_corners(path: str | Path, *, only_used: bool = False) -> tuple[Detection, ...]:
    """Read the detections of a corners file.

    Parameters
    ----------
    path : str or Path
        CSV in UTF-8 with a header line; needs the columns image, width, height, id, x and y.
    only_used : bool
        Leave out the corners that were not used, and the views without any other.

    Returns
    -------
    tuple of Detection
        Sorted by image name, ids increasing, every number exactly as written.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: column: problem`.
    """
    table = load_corner_table(path)
    if not only_used:
        return table.detections
    kept = (_subset(seen, used) for seen, used in zip(table.detections, table.used, strict=True))
    return tuple(seen for seen in kept if len(seen))


def load_corner_table(path: str | Path) -> CornersTable:
    """Read a corners file with what a solve left in it.

    Parameters
    ----------
    path : str or Path
        As for `load_corners`; missing columns sigma, residual_x and residual_y are NaN, a missing used is true.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: column: problem`.
    """
    rows = _Rows(path)
    names = rows.column("image")
    for row, name in enumerate(names):
        if not name:
            rows.fail(row, "image", "missing (expected the image's name)")
    sizes = np.stack([rows.wholes(key, 1, _LARGEST_SIDE_PX) for key in ("width", "height")], axis=1)
    ids = rows.wholes("id", 0, _LARGEST_ID)
    corners = np.stack([rows.numbers(key) for key in ("x", "y")], axis=1)
    for axis, (key, side) in enumerate((("x", "width"), ("y", "height"))):
        beyond = (corners[:, axis] < -0.5 - _OUTSIDE_PX) | (corners[:, axis] > sizes[:, axis] - 0.5 + _OUTSIDE_PX)
        rows.check(key, beyond, f"outside the image (got {{}}, expected -0.5 to {side} - 0.5). Check the {side} column")
    sigma = rows.numbers("sigma", optional=True)
    rows.check("sigma", sigma <= 0, "out of range (got {}, expected a positive number or an empty cell)")
    residuals = np.stack([rows.numbers(key, optional=True) for key in ("residual_x", "residual_y")], axis=1)
    used = rows.flags("used")
    codes, ordered = _codes(names)
    # Views by name, ids increasing within each.
    order = np.lexsort((ids, codes))
    _check_groups(rows, order, codes, ids, sizes)
    groups = np.split(order, np.flatnonzero(np.diff(codes[order])) + 1)
    detections = tuple(
        Detection(name, (int(sizes[g[0], 0]), int(sizes[g[0], 1])), ids[g], corners[g], sigma[g])
        for name, g in zip(ordered, groups, strict=True)
    )
    return CornersTable(detections, tuple(residuals[g] for g in groups), tuple(used[g] for g in groups))


class _Rows:
    """The cells of a CSV file by column, and the line each row stands on."""

    def __init__(self, path: str | Path) -> None:
        self.path = path
        text = read_text(path, _LONGEST_FILE_BYTES)
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        self.lines: list[int] = []
        cells: list[str] = []
        try:
            rows = filter(None, reader)
            header = [cell.strip() for cell in next(rows)]
            self._check_header(header, reader.line_num)
            for row in rows:
                if len(row) != len(header):
                    got = f"got {len(row)}, expected {len(header)}"
                    raise InputError(f"{path}:{reader.line_num}: wrong number of cells ({got})")
                cells += row
                self.lines.append(reader.line_num)
        except csv.Error as error:
            raise InputError(f"{path}:{reader.line_num}: not valid CSV ({error}). Check the quotes.") from None
        if not self.lines:
            raise InputError(f"{path}: no corners (only a header). Write at least three views into it.")
        self.cells = {name: cells[column :: len(header)] for column, name in enumerate(header)}

    def _check_header(self, header: list[str], line: int) -> None:
        """Refuse a header without the needed columns, or with one twice."""
        where = f"{self.path}:{line}: "
        for name in HEADER:
            if header.count(name) > 1:
                raise InputError(f"{where}{name}: column given twice. Remove one of the two.")
        missing = [name for name in _NEEDED if name not in header]
        if not missing:
            return
        if len(header) == 1 and any(mark in header[0] for mark in ";\t"):
            raise InputError(f"{where}columns not separated by commas (got {shown(header[0])}). Save it as comma-separated.")
        advice = {"width": " It is the image's, in pixels.", "height": " It is the image's, in pixels."}.get(missing[0], "")
        got = shown(", ".join(header))
        raise InputError(f"{where}{missing[0]}: missing column (got {got}, expected {', '.join(_NEEDED)}). Add it.{advice}")

    def fail(self, row: int, column: str, problem: str) -> NoReturn:
        """Raise for a cell."""
        raise InputError(f"{self.path}:{self.lines[row]}: {column}: {problem}")

    def check(self, column: str, wrong: npt.NDArray[np.bool_], problem: str) -> None:
        """Raise for the first wrong row; `{}` in the problem stands for its cell."""
        if wrong.any():
            row = int(wrong.argmax())
            self.fail(row, column, problem.format(shown(self.cells[column][row])))

    def column(self, name: str) -> list[str]:
        """Cells of a column."""
        return self.cells[name]

    def numbers(self, name: str, *, optional: bool = False) -> FloatArray:
        """Numbers of a column, shape (rows,), within what pixels can be; NaN where an optional one is empty."""
        cells = self.cells.get(name)
        if cells is None:
            return np.full(len(self.lines), np.nan)
        values = np.array(self._converted(name, cells, _optional_float if optional else float), dtype=np.float64)
        with np.errstate(invalid="ignore"):
            beyond = ~(np.abs(values) <= _LARGEST_COORDINATE_PX)
        if optional:
            beyond &= ~np.isnan(values)
        self.check(name, beyond, "out of range (got {}, expected a number of pixels)")
        return values

    def wholes(self, name: str, least: int, most: int) -> IntArray:
        """Whole numbers of a column within limits, shape (rows,)."""
        values = np.array(self._converted(name, self.cells[name], float), dtype=np.float64)
        wrong = ~((values >= least) & (values <= most) & (values == np.round(values)))
        self.check(name, wrong, f"out of range (got {{}}, expected a whole number from {least} to {most})")
        return values.astype(np.int64)

    def flags(self, name: str) -> BoolArray:
        """Flags of a column, shape (rows,); true where there is none."""
        cells = self.cells.get(name)
        if cells is None:
            return np.ones(len(self.lines), dtype=bool)
        return np.array(self._converted(name, cells, _flag, "1 or 0"), dtype=bool)

    def _converted(self, name: str, cells: list[str], convert: Callable[[str], Any], expected: str = "a number") -> list[Any]:
        """Convert every cell; on a bad one, find out which it was."""
        try:
            return list(map(convert, cells))
        except ValueError:
            pass
        for row, cell in enumerate(cells):
            try:
                convert(cell)
            except ValueError:
                self.fail(
                    row, name, f"not {expected} (got {shown(cell)})" if cell.strip() else f"missing (expected {expected})"
                )
        raise AssertionError("some cell must fail again")


def _check_groups(rows: _Rows, order: IntArray, codes: IntArray, ids: IntArray, sizes: IntArray) -> None:
    """Refuse a corner given twice and images of two sizes, naming the later line."""
    same = codes[order][1:] == codes[order][:-1]
    before, after = order[:-1], order[1:]
    for column, wrong, problem in (
        ("id", same & (ids[before] == ids[after]), "corner {} of this image again (it is on line {} already)"),
        ("width", same & (sizes[before] != sizes[after]).any(axis=1), "another size of the same image (line {1} has another)"),
    ):
        if wrong.any():
            pair = int(wrong.argmax())
            first, second = sorted((int(before[pair]), int(after[pair])))
            rows.fail(second, column, problem.format(ids[second], rows.lines[first]))


def _codes(names: Sequence[str]) -> tuple[IntArray, list[str]]:
    """Number of each name in the sorted order of all, shape (rows,), and that order."""
    ordered = sorted(set(names))
    numbers = {name: number for number, name in enumerate(ordered)}
    return np.array([numbers[name] for name in names], dtype=np.int64), ordered


def _subset(seen: Detection, mask: BoolArray) -> Detection:
    """Part of a detection."""
    return replace(seen, ids=seen.ids[mask], corners_px=seen.corners_px[mask], sigma_px=seen.sigma_px[mask])


def _cells(column: FloatArray) -> list[float | str]:
    """Floats as cells: csv writes the shortest exact text; NaN is empty."""
    return ["" if math.isnan(value) else value for value in column.tolist()]


def _optional_float(cell: str) -> float:
    return float(cell) if cell and not cell.isspace() else math.nan


def _flag(cell: str) -> bool:
    word = cell.strip().lower()
    if word not in _USED_WORDS:
        raise ValueError(cell)
    return _USED_WORDS[word]
