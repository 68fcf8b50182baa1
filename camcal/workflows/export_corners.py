"""Corners from any format to any other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from camcal.boards.base import Board
from camcal.errors import InputError
from camcal.formats.board_file import BOARD_FILE_NAME, load_board
from camcal.formats.corner_exchange.columns import Size
from camcal.formats.corner_exchange.table import check_holds, format_of, read_corners
from camcal.formats.output import claim_file, write_atomically
from camcal.workflows.observe import refuse_other_board


@dataclass(frozen=True, slots=True)
class CornersExport:
    """Corners in another format.

    Attributes
    ----------
    content : str
        What is in the file.
    what : str
        The format, for people.
    views, corners : int
        How many are in it.
    """

    content: str
    what: str
    views: int
    corners: int


def export_corners(
    corners: str | Path,
    output: str | Path | None = None,
    *,
    to: str | None = None,
    board: str | Board | None = None,
    size: Size | None = None,
    only_used: bool = False,
    force: bool = False,
) -> CornersExport:
    """Write the corners of a file in another format.

    Parameters
    ----------
    corners : path
        A corners.csv or another CSV, mrcal's .vnl, or MATLAB's image points as text.
    output : path, optional
        Where to write, with the format's ending: .csv, or .vnl for vnl; without it nothing is written.
    to : str, optional
        csv (camcal's own), vnl or matlab; told by the ending of the output if not given.
    board : str or Board, optional
        The board that was seen; if not given, the `board.yaml` beside the corners.
    size : tuple of int, optional
        (width, height) of the images in pixels where the file does not tell.
    only_used : bool
        Leave out the corners that a calibration did not use.
    force : bool
        Whether an existing file is replaced.

    Returns
    -------
    CornersExport

    Raises
    ------
    InputError
        If a file or an option cannot be used, or the format cannot hold corners of such a board.

    Examples
    --------
    >>> import tempfile, numpy as np, camcal
    >>> board = camcal.load_board("checkerboard:3x3:20mm")
    >>> corners = 100 + 1000 * board.object_points[:, :2]
    >>> seen = camcal.Detection("left.png", (640, 480), np.arange(9), corners, np.full(9, np.nan))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     camcal.save_corners(f"{folder}/corners.csv", [seen])
    ...     made = camcal.export_corners(f"{folder}/corners.csv", to="vnl", board=board)
    >>> print(made.content.splitlines()[-1])
    left.png 140.0 140.0 0
    """
    corner_format = format_of(output or "", to)
    target = board if board is not None and not isinstance(board, str) else load_board(_board_spec(corners, board))
    check_holds(corner_format, output or corner_format.what, target)
    detections = read_corners(corners, target, size=size, only_used=only_used)
    refuse_other_board(detections, target, str(corners))
    content = corner_format.text(detections, target)
    if output is not None:
        write_atomically(claim_file(output, force=force), content)
    return CornersExport(content, corner_format.what, len(detections), sum(len(seen) for seen in detections))


def _board_spec(corners: str | Path, board: str | None) -> str:
    """The board as the user names it, or the file beside the corners."""
    if board is not None:
        return board
    beside = Path(corners).parent / BOARD_FILE_NAME
    if not beside.is_file():
        raise InputError(
            f"{corners}: the board is not told (expected --board, or {BOARD_FILE_NAME} beside it). Pass --board SPEC."
        )
    return str(beside)
