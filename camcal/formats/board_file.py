"""Boards from a YAML file (camcal's or Kalibr's), from the name of a shipped one, or from a one-line SPEC; and to YAML."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from camcal import resources
from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.boards.spec import KINDS, parse_board
from camcal.errors import InputError
from camcal.formats.output import write_atomically
from camcal.formats.text import shown
from camcal.nearest import did_you_mean

BOARD_FILE_NAME = "board.yaml"

_HEADINGS = {
    "checkerboard": "Columns and rows count inner corners, where four squares meet.",
    "aprilgrid": "Columns and rows count tags; tag_m is the outer side of a tag's black border, gap_m the space between tags.",
}


def load_board(spec: str, folder: str | Path = ".") -> Board:
    """Return the board that a SPEC names.

    Parameters
    ----------
    spec : str
        A board YAML file (camcal's or Kalibr's target.yaml) or a folder that holds `board.yaml`; else the name of a shipped
        sample board; else a one-liner such as `checkerboard:9x6:25mm`.
    folder : str or Path
        What a relative path is relative to.

    Returns
    -------
    Board

    Raises
    ------
    InputError
        If the file is missing or cannot be used, or the SPEC makes no sense.

    Examples
    --------
    >>> import tempfile, camcal
    >>> camcal.load_board("checkerboard_9x6_25mm_a4").spec
    'checkerboard:9x6:25mm'
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     camcal.save_board(f"{folder}/board.yaml", camcal.load_board("aprilgrid:6x6:88mm:0.3"))
    ...     camcal.load_board(folder).spec
    'aprilgrid:6x6:88mm:0.3'
    """
    path = Path(folder) / spec
    try:
        if (path / BOARD_FILE_NAME).is_file():
            path = path / BOARD_FILE_NAME
        is_file = path.is_file()
    except OSError:
        is_file = False
    if is_file:
        return _load_file(path)
    if spec in resources.sample_board_names():
        return _load_file(resources.sample_board_path(spec))
    if spec.lower().endswith((".yaml", ".yml")) or any(mark in spec for mark in {"/", os.sep}):
        raise InputError(f"{shown(str(path))[1:-1]}: no such board file. Check the path.")
    if ":" not in spec and spec not in KINDS:
        names = resources.sample_board_names()
        example = next(iter(KINDS.values())).example
        raise InputError(
            f"board {shown(spec)}: neither a file, nor a sample board ({', '.join(names)}), nor a SPEC such as {example}."
            + did_you_mean(spec, (*KINDS, *names))
        )
    return parse_board(spec)


def save_board(path: str | Path, board: Board) -> None:
    """Write a board file.

    Parameters
    ----------
    path : str or Path
    board : Board

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_atomically(path, board_yaml(board))


def board_yaml(board: Board) -> str:
    """Return the content of a board file; reading it gives an equal board.

    Raises
    ------
    TypeError
        For a kind of board that has no file.
    """
    from camcal.formats.yaml_dump import dump_yaml  # a one-liner must not wait for YAML

    if isinstance(board, Checkerboard):
        kind, content = "checkerboard", _content(board, ("columns", "rows", "square_m"))
    elif isinstance(board, AprilGrid):
        names = ("columns", "rows", "tag_m", "gap_m", "family", "first", "border_bits", "squares")
        kind, content = "aprilgrid", _content(board, names)
    else:
        raise TypeError(f"board: no file format for {type(board).__name__}")
    return dump_yaml({"type": kind, **content}, _HEADINGS[kind])


def _content(board: Board, names: tuple[str, ...]) -> dict[str, Any]:
    return {name: getattr(board, name) for name in names}


def _load_file(path: Path) -> Board:
    from camcal.formats.board_schema import read_board  # a one-liner must not wait for pydantic

    return read_board(path)
