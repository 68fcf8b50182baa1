"""Columns of text read from another tool's file, on their way to detections; and the boards whose corners are a plain grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.errors import InputError
from camcal.formats.imaging.header import image_size
from camcal.formats.text import read_bytes

Size = tuple[int, int]
"""(width, height) in pixels."""


@dataclass(frozen=True, slots=True)
class Columns:
    """Corners as text cells.

    Attributes
    ----------
    cells : dict of str to list of str
        By the names of camcal's own corners file; without width and height where the file does not tell them.
    lines : list of int
        Line that each row stands on.
    """

    cells: Mapping[str, list[str]]
    lines: list[int]


def grid_of(board: Board, what: str) -> Checkerboard:
    """Return the board if its corners are the grid of equal steps that a format is made for.

    Parameters
    ----------
    board : Board
    what : str
        What is read or written, for the message.

    Raises
    ------
    InputError
        If they are not.
    """
    if isinstance(board, Checkerboard):
        return board
    raise InputError(
        f"{what}: holds corners of a grid of equal steps only (got {board.spec}, expected a checkerboard). Use CSV."
    )


def image_sizes(path: str | Path, names: Sequence[str], size: Size | None) -> dict[str, Size]:
    """Return the size of each image: the one that is given, else that of the image itself where it can be found.

    Parameters
    ----------
    path : str or Path
        The corners file; images are looked for from the current folder and from its own.
    names : sequence of str
        Names of the images as the file has them.
    size : tuple of int, optional
        (width, height) of all of them in pixels.

    Raises
    ------
    InputError
        If the size of an image is not given and the image cannot be found or read.
    """
    if size is not None:
        return dict.fromkeys(names, size)
    return {name: _size_of(path, name) for name in dict.fromkeys(names)}


def _size_of(path: str | Path, name: str) -> Size:
    """Size of one image from its header."""
    for place in (Path(name), Path(path).parent / name):
        try:
            found = image_size(read_bytes(place)) if place.is_file() else None
        except (OSError, InputError):
            continue
        if found is not None:
            return found
    raise InputError(
        f"{path}: the size of the images is not told, and {name} was not found (expected it beside the file). "
        "Pass --size WIDTHxHEIGHT in pixels."
    )
