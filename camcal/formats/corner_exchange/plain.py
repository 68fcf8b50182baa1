"""CSV files of corners under other names than camcal's own: one row for each corner, in pixels from (0, 0).

Known are the usual names of each column, in any order and any case, between commas, semicolons or tabs. The corner is told by
its id, or on a checkerboard by its row and column from 0; without either, each image has all corners in the order of the board.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from camcal.boards.base import Board
from camcal.errors import InputError
from camcal.formats.corner_exchange.columns import Columns, grid_of
from camcal.formats.corner_rows import CsvText, Rows

SYNONYMS = {
    "image": ("image", "image_name", "image_file", "file", "filename", "file_name", "name", "frame", "view", "path"),
    "id": ("id", "corner_id", "point_id", "feature_id", "corner", "feature", "point", "index", "keypoint"),
    "row": ("row", "grid_row", "board_row", "row_index"),
    "column": ("column", "col", "grid_column", "grid_col", "board_column", "board_col", "col_index"),
    "x": ("x", "u", "px", "x_px", "u_px", "pixel_x", "image_x", "img_x", "x_pixel", "img_loc_x"),
    "y": ("y", "v", "py", "y_px", "v_px", "pixel_y", "image_y", "img_y", "y_pixel", "img_loc_y"),
    "sigma": ("sigma", "sigma_px", "std", "stddev"),
    "width": ("width", "image_width", "img_width"),
    "height": ("height", "image_height", "img_height"),
    "used": ("used",),
}
"""Names that a column goes by, for each of camcal's own and for rows and columns of a checkerboard."""

_FRACTIONS = {"x", "y", "sigma"}
_LARGEST_PLACE = 10_000


def columns_of(header: Sequence[str]) -> dict[str, int] | None:
    """Find the columns in a header.

    Returns
    -------
    dict of str to int or None
        Number of the cell by the keys of `SYNONYMS`; None if image, x or y is not among them, or one is there twice.
    """
    names = [name.strip().strip('"').lower().replace(" ", "_").replace("-", "_") for name in header]
    places: dict[str, int] = {}
    for key, synonyms in SYNONYMS.items():
        found = [index for index, name in enumerate(names) if name in synonyms]
        if len(found) > 1:
            return None
        if found:
            places[key] = found[0]
    return places if {"image", "x", "y"} <= places.keys() else None


def read_plain(path: str | Path, board: Board, text: CsvText, places: dict[str, int]) -> Columns:
    """Read such a file.

    Parameters
    ----------
    path : str or Path
    board : Board
    text : CsvText
        Its content.
    places : dict of str to int
        What `columns_of` found in its header.

    Raises
    ------
    InputError
        If the corners cannot be told.
    """
    width = len(text.header)
    cells = {key: [cell.strip() for cell in text.cells[place::width]] for key, place in places.items()}
    if not text.lines:
        raise InputError(f"{path}: no corners (only a header). Write at least three views into it.")
    for key in _FRACTIONS & cells.keys():
        # Spreadsheets of half the world write 0,5, and semicolons between the cells.
        cells[key] = [cell.replace(",", ".") for cell in cells[key]]
    rows, columns = cells.pop("row", None), cells.pop("column", None)
    if "id" not in cells:
        if rows is not None and columns is not None:
            cells["id"] = _ids_of_places(path, board, text, rows, columns)
        else:
            cells["id"] = _ids_in_order(path, board, cells["image"])
    if not {"width", "height"} <= cells.keys():
        cells = {key: cell for key, cell in cells.items() if key not in {"width", "height"}}
    return Columns(cells, text.lines)


def _ids_of_places(path: str | Path, board: Board, text: CsvText, rows: list[str], columns: list[str]) -> list[str]:
    """Ids of corners that are told by row and column."""
    grid = grid_of(board, f"{path}: row and column")
    table = Rows(path, {"row": rows, "column": columns}, text.lines)
    row, column = (table.wholes(name, 0, _LARGEST_PLACE) for name in ("row", "column"))
    for name, place, count in (("row", row, grid.rows), ("column", column, grid.columns)):
        table.check(name, place >= count, f"not on the board (got {{}}, expected 0 to {count - 1} for {grid.spec})")
    return [str(one) for one in (row * grid.columns + column).tolist()]


def _ids_in_order(path: str | Path, board: Board, images: Sequence[str]) -> list[str]:
    """Ids of corners that are told by their order alone."""
    counts = Counter(images)
    name, count = min(counts.items(), key=lambda item: (item[1] == board.feature_count, item[0]))
    if count != board.feature_count:
        raise InputError(
            f"{path}: {name}: no column id, and not all corners (got {count}, expected {board.feature_count} for "
            f"{board.spec}). Add a column id, or row and column."
        )
    given: Counter[str] = Counter()
    ids = []
    for image in images:
        ids.append(str(given[image]))
        given[image] += 1
    return ids
