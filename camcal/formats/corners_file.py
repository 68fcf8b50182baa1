"""corners.csv: every corner of every view; enough to solve from, whatever detector it comes from."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from camcal.errors import InputError
from camcal.formats.corner_rows import Rows, read_csv
from camcal.formats.output import write_atomically
from camcal.formats.text import shown
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.nearest import nearest
from camcal.observations import Detection

HEADER = ("image", "width", "height", "id", "x", "y", "sigma", "residual_x", "residual_y", "used")

NEEDED = HEADER[:6]
"""The columns that a file must have."""

_LARGEST_ID = 10**6
_LARGEST_SIDE_PX = 10**6
# Detectors may place a corner that the frame just cuts a little beyond it.
_OUTSIDE_PX = 1.0


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

    @property
    def used_detections(self) -> tuple[Detection, ...]:
        """The detections without the corners that were not used; views without any other are left out."""
        kept = (seen.take(used) for seen, used in zip(self.detections, self.used, strict=True))
        return tuple(seen for seen in kept if len(seen))


def save_corners(
    path: str | Path,
    detections: Sequence[Detection],
    residuals_px: Sequence[FloatArray] | None = None,
    used: Sequence[BoolArray] | None = None,
) -> None:
    """Write a corners file, as `corners_text` has it.

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
    write_atomically(path, corners_text(detections, residuals_px, used))


def corners_text(
    detections: Sequence[Detection],
    residuals_px: Sequence[FloatArray] | None = None,
    used: Sequence[BoolArray] | None = None,
) -> str:
    """Return the content of a corners file; floats are the shortest that read back bit for bit, NaN is an empty cell.

    Parameters
    ----------
    detections : sequence of Detection
    residuals_px : sequence of ndarray of shape (N, 2), optional
        Observed minus projected for each detection's corners, in pixels; empty cells by default.
    used : sequence of ndarray of shape (N,), optional
        Which corners went into the solve; all of them by default.
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
    return stream.getvalue()


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

    Examples
    --------
    >>> import tempfile, numpy as np, camcal
    >>> seen = camcal.Detection("left.png", (640, 480), [0, 1], [[10.25, 20], [30.5, 20]], [np.nan, np.nan])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     camcal.save_corners(f"{folder}/corners.csv", [seen])
    ...     (read,) = camcal.load_corners(f"{folder}/corners.csv")
    >>> read.source, read.ids.tolist(), read.corners_px.tolist()
    ('left.png', [0, 1], [[10.25, 20.0], [30.5, 20.0]])
    """
    table = load_corner_table(path)
    return table.used_detections if only_used else table.detections


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
    return corner_table(_read_rows(path))


def corner_table(rows: Rows) -> CornersTable:
    """Turn rows with the columns of a corners file into its content.

    Parameters
    ----------
    rows : Rows
        Of any file; missing columns are as for `load_corner_table`.

    Raises
    ------
    InputError
        If a value makes no sense; says `file:line: column: problem`.
    """
    names = rows.names("image")
    sizes = np.stack([rows.wholes(key, 1, _LARGEST_SIDE_PX) for key in ("width", "height")], axis=1)
    ids = rows.wholes("id", 0, _LARGEST_ID)
    corners = np.stack([rows.numbers(key) for key in ("x", "y")], axis=1)
    for axis, (key, side) in enumerate((("x", "width"), ("y", "height"))):
        beyond = (corners[:, axis] < -0.5 - _OUTSIDE_PX) | (corners[:, axis] > sizes[:, axis] - 0.5 + _OUTSIDE_PX)
        rows.check(key, beyond, f"outside the image (got {{}}, expected -0.5 to {side} - 0.5). Check the {side}")
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


def _read_rows(path: str | Path) -> Rows:
    """Read the rows of a corners file whose header has what is needed."""
    text = read_csv(path, check_header=partial(_check_header, path))
    if not text.lines:
        raise InputError(f"{path}: no corners (only a header). Write at least three views into it.")
    width = len(text.header)
    return Rows(path, {name: text.cells[column::width] for column, name in enumerate(text.header)}, text.lines)


def _check_header(path: str | Path, header: list[str], line: int) -> None:
    """Refuse a header without the needed columns, or with one twice."""
    where = f"{path}:{line}: "
    for name in HEADER:
        if header.count(name) > 1:
            raise InputError(f"{where}{name}: column given twice. Remove one of the two.")
    missing = [name for name in NEEDED if name not in header]
    if not missing:
        return
    if len(header) == 1 and any(mark in header[0] for mark in ";\t"):
        raise InputError(f"{where}columns not separated by commas (got {shown(header[0])}). Save it as comma-separated.")
    advice = {"width": " It is the image's, in pixels.", "height": " It is the image's, in pixels."}.get(missing[0], "")
    got = shown(", ".join(header))
    meant = nearest(missing[0], [name for name in header if name not in HEADER])
    remedy = f"Did you mean it by {shown(meant)}?" if meant else f"Add it.{advice}"
    raise InputError(f"{where}{missing[0]}: missing column (got {got}, expected {', '.join(NEEDED)}). {remedy}")


def _check_groups(rows: Rows, order: IntArray, codes: IntArray, ids: IntArray, sizes: IntArray) -> None:
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


def _cells(column: FloatArray) -> list[float | str]:
    """Floats as cells: csv writes the shortest exact text; NaN is empty."""
    return ["" if math.isnan(value) else value for value in column.tolist()]
