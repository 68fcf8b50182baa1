"""The one table of corner formats, and the one way to read and write a file in any of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from camcal.boards.base import Board
from camcal.errors import InputError
from camcal.formats.corner_exchange.columns import Columns, Size, grid_of, image_sizes
from camcal.formats.corner_exchange.matlab import is_matrix, matlab_text, read_matlab
from camcal.formats.corner_exchange.plain import columns_of, read_plain
from camcal.formats.corner_exchange.vnl import read_vnl, vnl_text
from camcal.formats.corner_rows import LONGEST_FILE_BYTES, Rows, read_csv
from camcal.formats.corners_file import NEEDED, CornersTable, corner_table, corners_text, load_corner_table
from camcal.formats.output import write_atomically
from camcal.formats.text import read_text, shown
from camcal.nearest import did_you_mean
from camcal.observations import Detection

SUFFIXES = (".csv", ".vnl", ".tsv")
"""Endings of the files that are taken for corners."""

_WRITTEN = {".csv": "csv", ".vnl": "vnl"}
_DELIMITERS = (",", ";", "\t")


@dataclass(frozen=True, slots=True)
class CornerFormat:
    """One format that corners are written in.

    Attributes
    ----------
    what : str
        What it is, for people.
    suffix : str
        Ending of its files.
    grids_only : bool
        Whether it holds the corners of checkerboards only.
    text : callable
        (detections, board) -> content of the file.
    """

    what: str
    suffix: str
    grids_only: bool
    text: Callable[[Sequence[Detection], Board], str]


FORMATS: dict[str, CornerFormat] = {
    "csv": CornerFormat("camcal's corners.csv", ".csv", False, lambda detections, _board: corners_text(detections)),
    "vnl": CornerFormat("mrcal's corners.vnl", ".vnl", True, vnl_text),
    "matlab": CornerFormat("MATLAB's imagePoints as a matrix", ".csv", True, matlab_text),
}
"""Every format by the name that `export --to` knows it by."""


def is_corners_path(path: str | Path) -> bool:
    """Tell whether a path ends like a file of corners."""
    return str(path).lower().endswith(SUFFIXES)


def read_corners(path: str | Path, board: Board, *, size: Size | None = None, only_used: bool = False) -> tuple[Detection, ...]:
    """Read a file of corners in any of the formats; which one shows from its name and its first line.

    Parameters
    ----------
    path : str or Path
    board : Board
        Tells which corner is which where the file does not.
    size : tuple of int, optional
        (width, height) of the images in pixels, where the file does not tell; else the images themselves are looked at.
    only_used : bool
        Leave out the corners that are marked as not used.

    Returns
    -------
    tuple of Detection
        Sorted by image name.

    Raises
    ------
    InputError
        If it cannot be used.
    """
    table = _table(path, board, size)
    return table.used_detections if only_used else table.detections


def format_of(path: str | Path, name: str | None = None) -> CornerFormat:
    """Return the format that a file is to be written in.

    Parameters
    ----------
    path : str or Path
        Its ending decides if there is no name, and has to be the format's if there is one; empty for no file.
    name : str, optional
        One of `FORMATS`.

    Raises
    ------
    InputError
        If there is no such format, or the ending tells none or is another's: what reads the file goes by it.
    """
    suffix = Path(path).suffix.lower()
    if name is None:
        if suffix not in _WRITTEN:
            raise InputError(f"{path}: not a file for corners (got {shown(suffix)}, expected {' or '.join(_WRITTEN)})")
        name = _WRITTEN[suffix]
    if name not in FORMATS:
        problem = f"--to: unknown format of corners (got {shown(name)}, expected one of {', '.join(FORMATS)})."
        raise InputError(problem + did_you_mean(name, FORMATS))
    found = FORMATS[name]
    if path and suffix != found.suffix:
        raise InputError(f"{path}: not an ending of {found.what} (got {shown(suffix or 'none')}, expected {found.suffix}).")
    return found


def check_holds(corner_format: CornerFormat, path: str | Path, board: Board) -> None:
    """Refuse, before any work, a board whose corners a format cannot hold.

    Raises
    ------
    InputError
        If that is so.
    """
    if corner_format.grids_only:
        grid_of(board, str(path))


def write_corners(path: str | Path, detections: Sequence[Detection], board: Board, corner_format: CornerFormat) -> None:
    """Write corners in a format.

    Raises
    ------
    InputError
        If the format cannot hold them, or the file cannot be written.
    """
    write_atomically(path, corner_format.text(detections, board))


def _table(path: str | Path, board: Board, size: Size | None) -> CornersTable:
    """Read a file of any format."""
    first = _first_line(path)
    if str(path).lower().endswith(".vnl") or first.startswith("#"):
        return _completed(path, read_vnl(path, board), size)
    delimiter = max(_DELIMITERS, key=first.count)
    header = [cell.strip().strip('"') for cell in first.split(delimiter)]
    places = columns_of(header)
    if is_matrix(header):
        return _completed(path, read_matlab(path, board, read_csv(path, delimiter)), size)
    if (delimiter == "," and set(NEEDED) <= set(header)) or places is None:
        return load_corner_table(path)
    return _completed(path, read_plain(path, board, read_csv(path, delimiter), places), size)


def _first_line(path: str | Path) -> str:
    """Return the first line that is neither empty nor a comment of a vnl file."""
    lines = (line.strip() for line in read_text(path, LONGEST_FILE_BYTES).splitlines())
    return next((line for line in lines if line and not line.startswith(("##", "#!"))), "")


def _completed(path: str | Path, columns: Columns, size: Size | None) -> CornersTable:
    """Add the sizes of the images to columns that do not have them, and turn all into detections."""
    cells = dict(columns.cells)
    if "width" not in cells:
        sizes = image_sizes(path, cells["image"], size)
        for axis, name in enumerate(("width", "height")):
            cells[name] = [str(sizes[image][axis]) for image in cells["image"]]
    return corner_table(Rows(path, cells, columns.lines))
