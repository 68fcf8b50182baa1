"""mrcal's corners.vnl: one line for each corner of the grid, row by row, as mrgingham prints them.

The lines are `filename x y level`: pixels with the centre of the top-left one at (0, 0); `-` for a corner that was not seen;
`level` how often the image was halved before the corner was found in it, so that its standard deviation is twice as large for
each. A column `weight` in its place is one over a standard deviation. An image without a board has one line, `filename - - -`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np

from camcal.boards.base import Board
from camcal.errors import InputError
from camcal.formats.corner_exchange.columns import Columns, grid_of
from camcal.formats.corner_rows import LONGEST_FILE_BYTES
from camcal.formats.text import read_text, shown
from camcal.observations import Detection

LEGEND = ("filename", "x", "y", "level")

_NOTHING = "-"
_FULL_SIZE_SIGMA_PX = 0.3
"""Standard deviation of a corner found at full size; it matters only next to others."""


def read_vnl(path: str | Path, board: Board) -> Columns:
    """Read a file of corners.

    Parameters
    ----------
    path : str or Path
    board : Board
        A checkerboard; each image has one line for each of its corners, or a single line without numbers.

    Returns
    -------
    Columns
        With a sigma where levels or weights differ; where all are the same they tell nothing.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: problem`.
    """
    count = grid_of(board, str(path)).feature_count
    columns: dict[str, list[str]] = {name: [] for name in ("image", "id", "x", "y", "sigma")}
    lines: list[int] = []
    seen: set[str] = set()
    for name, group in groupby(_rows(path), key=lambda row: row[1]):
        rows = list(group)
        if name in seen:
            raise InputError(f"{path}:{rows[0][0]}: filename: {shown(name)} again, after other images. Put its lines together.")
        seen.add(name)
        if len(rows) == 1 and rows[0][2] == _NOTHING:
            continue
        if len(rows) != count:
            got = f"got {len(rows)}, expected {count} for {board.spec}"
            raise InputError(f"{path}:{rows[0][0]}: {name}: wrong number of corners ({got}). Pass the board with --board.")
        for index, (line, _, x, y, sigma) in enumerate(rows):
            if x != _NOTHING:
                lines.append(line)
                for column, cell in zip(columns.values(), (name, str(index), x, y, sigma), strict=True):
                    column.append(cell)
    if not lines:
        raise InputError(f"{path}: no corners ({len(seen)} images without any). Detect them again.")
    if len(set(columns["sigma"])) == 1:
        columns["sigma"] = [""] * len(lines)
    return Columns(columns, lines)


def vnl_text(detections: Sequence[Detection], board: Board) -> str:
    """Write corners as mrcal reads them; every level is 0, because mrcal takes whole numbers of halvings there.

    Parameters
    ----------
    detections : sequence of Detection
    board : Board
        A checkerboard.

    Raises
    ------
    InputError
        If the board is no checkerboard, or an image's name cannot stand in such a file.
    """
    count = grid_of(board, "vnl").feature_count
    rows = ["# " + " ".join(LEGEND)]
    for seen in detections:
        _check_name(seen.source)
        grid = np.full((count, 2), np.nan)
        grid[seen.ids] = seen.corners_px
        rows += [f"{seen.source} - - -" if np.isnan(x) else f"{seen.source} {x!r} {y!r} 0" for x, y in grid.tolist()]
    return "\n".join(rows) + "\n"


def _rows(path: str | Path) -> list[tuple[int, str, str, str, str]]:
    """Line, image, x, y (`-` for both if the corner was not seen) and sigma of every row."""
    legend: Sequence[str] = LEGEND
    rows = []
    for line, text in enumerate(read_text(path, LONGEST_FILE_BYTES).splitlines(), 1):
        words = text.split()
        if not words or words[0].startswith("#"):
            names = text.strip().removeprefix("#").split()
            legend = names if {"filename", "x", "y"} <= set(names) else legend
            continue
        if not len(legend) - 1 <= len(words) <= len(legend) or len(words) < 3:
            got = f"got {len(words)}, expected {len(legend)}: {' '.join(legend)}"
            raise InputError(f"{path}:{line}: wrong number of values ({got})")
        cells = dict(zip(legend, [*words, _NOTHING], strict=False))
        sigma = _sigma(path, line, cells, len(words) < len(legend))
        x, y = cells["x"], cells["y"]
        missing = sigma == _NOTHING or _NOTHING in {x, y} or x.startswith("-") or y.startswith("-")
        rows.append((line, cells["filename"], *((_NOTHING, _NOTHING) if missing else (x, y)), sigma))
    return rows


def _sigma(path: str | Path, line: int, cells: dict[str, str], absent: bool) -> str:
    """Standard deviation that a level or a weight stands for; `-` for a corner that is to be ignored, as mrcal does."""
    name = next((name for name in ("weight", "level") if name in cells), "")
    if not name or absent:
        return ""
    if cells[name] == _NOTHING:
        return _NOTHING
    try:
        value = float(cells[name])
    except ValueError:
        value = float("nan")
    if not abs(value) < 64:
        raise InputError(f"{path}:{line}: {name}: not a {name} (got {shown(cells[name])}, expected a number or -)")
    if name == "weight":
        return repr(_FULL_SIZE_SIGMA_PX / value) if value > 0 else _NOTHING
    return repr(_FULL_SIZE_SIGMA_PX * 2.0 ** int(value)) if value >= 0 else _NOTHING


def _check_name(name: str) -> None:
    """Refuse a name that mrcal would read as something else."""
    if not name.isascii() or len(name.split()) != 1 or name.startswith("#"):
        raise InputError(f"{name}: not a name for a vnl file (it has blanks, a leading # or letters beyond ASCII). Rename it.")
