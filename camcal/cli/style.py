"""Colours and bold type: only where somebody looks, and never the only sign of anything."""

from __future__ import annotations

import os
from typing import TextIO

import click

_DUMB = {"dumb", "unknown"}
_LEVEL_COLOURS = {"good": "green", "usable": "yellow", "poor": "red", "rejected": "red", "note": "cyan"}


def in_colour(stream: TextIO) -> bool:
    """Tell whether a stream gets colours: `NO_COLOR` forbids them, `FORCE_COLOR` and `CLICOLOR_FORCE` demand them.

    Parameters
    ----------
    stream : text stream
        Otherwise it gets them if it is a terminal that is not dumb. <https://no-color.org>, <https://force-color.org>,
        <https://bixense.com/clicolors>.
    """
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR") or os.environ.get("CLICOLOR_FORCE", "0") not in {"", "0"}:
        return True
    return is_terminal(stream)


def is_terminal(stream: TextIO) -> bool:
    """Tell whether a stream is a terminal that can move its cursor and show colours."""
    try:
        return stream.isatty() and os.environ.get("TERM", "").lower() not in _DUMB
    except ValueError:  # it is closed
        return False


def heading(text: str) -> str:
    """Mark a heading."""
    return click.style(text, bold=True)


def level(word: str) -> str:
    """Mark the word of a verdict, or the level of a finding."""
    return click.style(word, fg=_LEVEL_COLOURS.get(word), bold=True)


def warning(text: str) -> str:
    """Mark the word that announces a warning."""
    return click.style(text, fg="yellow")


def failure(text: str) -> str:
    """Mark the word that announces a failure."""
    return click.style(text, fg="red", bold=True)


def aside(text: str) -> str:
    """Mark what most people need not read."""
    return click.style(text, dim=True)
