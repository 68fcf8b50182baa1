"""A board as a file: camcal's own board.yaml, or Kalibr's target.yaml."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from camcal.boards.base import Board
from camcal.errors import InputError
from camcal.formats.board_file import board_yaml, load_board
from camcal.formats.kalibr_target import kalibr_target
from camcal.formats.output import claim_file, write_atomically
from camcal.formats.text import shown
from camcal.nearest import did_you_mean

BOARD_FORMATS: dict[str, Callable[[Board], str]] = {"camcal": board_yaml, "kalibr": kalibr_target}
"""What writes a board, by the name of the format."""


def export_board(board: str | Board, output: str | Path | None = None, *, to: str = "kalibr", force: bool = False) -> str:
    """Write a board as a file.

    Parameters
    ----------
    board : str or Board
        A one-liner such as `aprilgrid:6x6:88mm:0.3`, the name of a sample board, or a board file; or the board itself.
    output : path, optional
        Where to write; without it nothing is written.
    to : str
        kalibr or camcal.
    force : bool
        Whether an existing file is replaced.

    Returns
    -------
    str
        The content of the file.

    Raises
    ------
    InputError
        If there is no such board or format, the format cannot hold the board, or the file cannot be written.

    Examples
    --------
    >>> import camcal
    >>> print(camcal.export_board("aprilgrid:6x6:88mm:0.3").rstrip())
    target_type: 'aprilgrid'
    tagCols: 6
    tagRows: 6
    tagSize: 0.088  # metres, outer side of the black border
    tagSpacing: 0.3  # gap between tags over tagSize
    """
    if to not in BOARD_FORMATS:
        problem = f"--to: unknown format of boards (got {shown(to)}, expected one of {', '.join(BOARD_FORMATS)})."
        raise InputError(problem + did_you_mean(to, BOARD_FORMATS))
    content = BOARD_FORMATS[to](load_board(board) if isinstance(board, str) else board)
    if output is not None:
        write_atomically(claim_file(output, force=force), content)
    return content
