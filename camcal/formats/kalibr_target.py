"""Kalibr's target.yaml of a board; `board_schema` reads it."""

from __future__ import annotations

from fractions import Fraction

from camcal.boards.aprilgrid import OPTION_DEFAULTS, AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.errors import InputError
from camcal.formats.yaml_plain import float_text


def kalibr_target(board: Board) -> str:
    """Return the content of Kalibr's target.yaml.

    Parameters
    ----------
    board : Board
        A checkerboard; or an AprilGrid as Kalibr knows them: tag36h11 with a border of 2 bits, tag 0 at the bottom left, black
        squares at the crossings.

    Returns
    -------
    str
        Lengths are exact; the spacing is the ratio of gap and tag, rounded to the nearest float.

    Raises
    ------
    InputError
        If Kalibr has no such board; says in what it differs.
    """
    if isinstance(board, Checkerboard):
        return (
            "target_type: 'checkerboard'\n"
            f"targetCols: {board.columns}  # inner corners\n"
            f"targetRows: {board.rows}\n"
            f"rowSpacingMeters: {float_text(board.square_m)}\n"
            f"colSpacingMeters: {float_text(board.square_m)}\n"
        )
    if not isinstance(board, AprilGrid):
        raise InputError(f"{board.spec}: not a board of Kalibr's (expected a checkerboard or an AprilGrid).")
    _check_is_kalibrs(board)
    ratio = float(Fraction(repr(board.gap_m)) / Fraction(repr(board.tag_m)))
    return (
        "target_type: 'aprilgrid'\n"
        f"tagCols: {board.columns}\n"
        f"tagRows: {board.rows}\n"
        f"tagSize: {float_text(board.tag_m)}  # metres, outer side of the black border\n"
        f"tagSpacing: {float_text(ratio)}  # gap between tags over tagSize\n"
    )


def _check_is_kalibrs(board: AprilGrid) -> None:
    """Refuse what target.yaml has no word for: Kalibr would look for other tags, or for these in other places."""
    options = {
        "family": board.family,
        "first": board.first,
        "border": str(board.border_bits),
        "squares": "yes" if board.squares else "no",
    }
    differing = {name: value for name, value in options.items() if value != OPTION_DEFAULTS[name]}
    if differing:
        got = ", ".join(f"{name}={value}" for name, value in differing.items())
        expected = ", ".join(f"{name}={OPTION_DEFAULTS[name]}" for name in differing)
        raise InputError(f"{board.spec}: Kalibr has no such board (got {got}, expected {expected}). Print a board of Kalibr's.")
