"""`camcal board`: a board as a page to print."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, cast, get_args

from camcal.boards.page import Page, lay_out
from camcal.boards.printing import print_board
from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.formats.output import claim_file, write_atomically

PageFormat = Literal["pdf", "svg", "png"]


def board(
    spec: str, output: str | Path, *, paper: str = "auto", landscape: bool = False, dpi: int = 300, force: bool = False
) -> Page:
    """Write a board as a page to print, true to scale.

    Parameters
    ----------
    spec : str
        A one-liner such as `checkerboard:9x6:25mm`, the name of a sample board, or a board file.
    output : path
        A .pdf, .svg or .png file.
    paper : str
        a4, a3, letter, ..., WIDTHxHEIGHTmm, or auto: the smallest sheet of the A series that holds it.
    landscape : bool
        Whether the page lies on its long side (auto decides by itself).
    dpi : int
        Resolution of a PNG, dots per inch.
    force : bool
        Whether an existing file is replaced.

    Returns
    -------
    Page
        What was printed, and on which size of paper.

    Raises
    ------
    InputError
        If the spec makes no sense, the board does not fit the paper, or the file cannot be written.

    Examples
    --------
    >>> import tempfile, camcal
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     page = camcal.board("checkerboard:9x6:25mm", f"{folder}/board.pdf")
    >>> page.width_mm, page.height_mm
    (297.0, 210.0)
    """
    path = Path(output)
    file_format = path.suffix.lower().lstrip(".")
    if file_format not in get_args(PageFormat):
        raise InputError(f"{path}: unknown page format (got {path.suffix or 'no extension'!r}, expected .pdf, .svg or .png).")
    target = load_board(spec)
    page = lay_out(target, paper=paper, landscape=landscape)
    claim_file(path, force=force)
    write_atomically(
        path, print_board(target, file_format=cast(PageFormat, file_format), paper=paper, landscape=landscape, dpi=dpi)
    )
    return page
