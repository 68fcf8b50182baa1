"""The one-line SPEC of a board, and the one table that joins the kinds of boards."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from camcal.boards.aprilgrid import OPTION_DEFAULTS, AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.boards.fields import parse_choice
from camcal.errors import InputError

_LONGEST_SPEC = 200


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of board: how its one-liner looks and what builds it.

    Attributes
    ----------
    fields : tuple of str
        Names of the fields after the kind, in order.
    options : tuple of str
        Names of the options.
    example : str
        A SPEC that shows the form.
    build : callable
        (fields, options) -> Board; raises ValueError. Both are text; their number and names are checked before.
    """

    fields: tuple[str, ...]
    options: tuple[str, ...]
    example: str
    build: Callable[[Sequence[str], Mapping[str, str]], Board]


KINDS: dict[str, Kind] = {
    "checkerboard": Kind(("COLUMNSxROWS", "SQUARE"), (), "checkerboard:9x6:25mm", Checkerboard.from_fields),
    "aprilgrid": Kind(
        ("COLUMNSxROWS", "TAG", "SPACING"), tuple(OPTION_DEFAULTS), "aprilgrid:6x6:88mm:0.3", AprilGrid.from_fields
    ),
}
"""Every kind of board by the name that its one-liner starts with."""


def parse_board(spec: str) -> Board:
    """Build the board that a one-liner names.

    Parameters
    ----------
    spec : str
        `KIND:FIELD:...:option=value...`, e.g. `checkerboard:9x6:25mm` or `aprilgrid:6x6:88mm:0.3:family=tag36h10`.

    Returns
    -------
    Board

    Raises
    ------
    InputError
        If it makes no sense; says what is wrong and names the nearest match of a mistyped name.

    Examples
    --------
    >>> parse_board("checkerboard:9x6:25mm")
    Checkerboard(columns=9, rows=6, square_m=0.025)
    """
    if len(spec) > _LONGEST_SPEC:
        raise InputError(f"board '{spec[:40]}...': too long (got {len(spec)} characters, expected at most {_LONGEST_SPEC})")
    shown = "".join(character if character.isprintable() else "?" for character in spec)
    name, *parts = (part.strip() for part in shown.split(":"))
    try:
        kind = KINDS[parse_choice(name, KINDS, "kind")]
        fields = [part for part in parts if "=" not in part]
        options = _parse_options([part for part in parts if "=" in part], kind)
        if len(fields) != len(kind.fields) or "" in fields:
            form = ":".join((name, *kind.fields))
            raise ValueError(f"wrong fields (got {len(fields)} after '{name}', expected {form}). Example: {kind.example}")
        return kind.build(fields, options)
    except ValueError as error:
        raise InputError(f"board '{shown}': {error}") from None


def _parse_options(parts: Sequence[str], kind: Kind) -> dict[str, str]:
    """Split `name=value` parts; refuse unknown and repeated names."""
    options: dict[str, str] = {}
    for part in parts:
        name, value = (text.strip() for text in part.split("=", 1))
        if not kind.options:
            raise ValueError(f"'{part}' is not an option (this kind of board has none). Example: {kind.example}")
        if parse_choice(name, kind.options, "option") in options:
            raise ValueError(f"option '{name}' is given twice")
        options[name] = value
    return options
