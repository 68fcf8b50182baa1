"""Text that fits: into a column, and into 80 columns as a whole."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Sequence
from typing import TextIO

WIDTH = 80
"""Columns that every output fits into, as long as no single word is longer."""
_ELLIPSIS = "…"


def terminal_columns(stream: TextIO) -> int:
    """Return how many columns a terminal has: what `COLUMNS` says, or the terminal itself; `WIDTH` if neither does.

    `shutil.get_terminal_size` says the same, but loads every kind of compression before it does.

    Parameters
    ----------
    stream : text stream
    """
    told = os.environ.get("COLUMNS", "")
    if told.isdecimal() and int(told) > 0:
        return int(told)
    try:
        return os.get_terminal_size(stream.fileno()).columns or WIDTH
    except (OSError, ValueError):
        return WIDTH


def shortened(text: str, room: int) -> str:
    """Cut the middle out of a text that is longer than its room, so that its beginning and its end can be told.

    Examples
    --------
    >>> shortened("a_rather_long_name.png", 13), shortened("short.png", 13)
    ('a_rath…me.png', 'short.png')
    """
    if len(text) <= room:
        return text
    kept = max(0, room - len(_ELLIPSIS))
    return text[: kept - kept // 2] + _ELLIPSIS + text[len(text) - kept // 2 :]


def wrapped(text: str, first: str = "", later: str = "", width: int = WIDTH) -> str:
    """Break a text at blanks, so that each line fits; a word that is longer than a line stays whole.

    Parameters
    ----------
    text : str
    first, later : str
        What the first line and the later ones begin with.
    width : int
        Columns that there are.
    """
    return textwrap.fill(
        text,
        width,
        initial_indent=first,
        subsequent_indent=later,
        break_long_words=False,
        break_on_hyphens=False,
    )


def wrapped_command(parts: Sequence[str], indent: int = 0) -> str:
    r"""Break a command between its parts, with backslashes, so that it can still be copied into a shell.

    Parameters
    ----------
    parts : sequence of str
        The program with its arguments, and each option with its value.
    indent : int
        Columns that the first line has lost already, and that the later ones leave empty.

    Examples
    --------
    >>> wrapped_command(["camcal undistort photos/", "--camera calib/camera.yaml", "-o undistorted"])
    'camcal undistort photos/ --camera calib/camera.yaml -o undistorted'
    """
    deeper, end = " " * (indent + 2), " \\"
    if indent + len(" ".join(parts)) <= WIDTH:
        return " ".join(parts)
    lines = [parts[0]]
    for part in parts[1:]:
        if len(f"{deeper}{lines[-1]} {part}{end}") <= WIDTH:
            lines[-1] += f" {part}"
        else:
            lines.append(part)
    return f"{end}\n{deeper}".join(lines)
