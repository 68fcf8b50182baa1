"""A terminal for tests: a program runs on a pseudo-terminal of 80 columns, and what stays on its screen is told."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass

import pytest

COLUMNS = 80
_ESCAPE = re.compile(r"\x1b\[([?\d;]*)([A-Za-z])")


@dataclass(frozen=True)
class Session:
    """What a program did on a terminal.

    Attributes
    ----------
    code : int
        How it left.
    raw : str
        All that it wrote.
    screen : list of str
        What stays, line by line, a terminal's own wrapping undone.
    widest : int
        Columns of the longest line that was ever drawn over.
    cursor_is_shown : bool
    """

    code: int
    raw: str
    screen: list[str]
    widest: int
    cursor_is_shown: bool


def run_on_terminal(
    arguments: list[str], *, interrupt_when: Callable[[str], bool] | None = None, **environment: str
) -> Session:
    """Run a program whose stdout and stderr are one terminal; send it Ctrl-C once what it wrote so far is as wanted."""
    pty, fcntl, termios = (pytest.importorskip(name) for name in ("pty", "fcntl", "termios"))
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, b"".join(n.to_bytes(2, "little") for n in (24, COLUMNS, 0, 0)))
    inherited = {name: value for name, value in os.environ.items() if "COLOR" not in name and name != "COLUMNS"}
    settings = {**inherited, "TERM": "xterm-256color", **environment}
    process = subprocess.Popen(arguments, stdout=theirs, stderr=theirs, env=settings, start_new_session=True)
    os.close(theirs)
    raw, waiting, deadline = b"", interrupt_when is not None, time.monotonic() + 120
    while time.monotonic() < deadline:
        try:
            piece = os.read(ours, 65536)
        except OSError:  # the last writer has gone
            break
        if not piece:
            break
        raw += piece
        if waiting and interrupt_when is not None and interrupt_when(raw.decode(errors="replace")):
            waiting = False
            process.send_signal(signal.SIGINT)
    os.close(ours)
    return _session(process.wait(timeout=60), raw.decode())


def _session(code: int, raw: str) -> Session:
    """Draw what was written: text, carriage return, new line, cursor up, erased lines; all else has no place of its own."""
    lines, row, column, widest, shown = [""], 0, 0, 0, True
    at = 0
    while at < len(raw):
        escape = _ESCAPE.match(raw, at)
        if escape:
            at = escape.end()
            value, kind = escape.groups()
            if kind == "A":
                row = max(0, row - int(value or 1))
            elif kind == "K":
                lines[row] = ""
            elif value == "?25":
                shown = kind == "h"
            continue
        character, at = raw[at], at + 1
        if character == "\r":
            column = 0
        elif character == "\n":
            row += 1
            if row == len(lines):
                lines.append("")
        else:
            # What is drawn again and again is erased first; only such lines must not be wrapped by the terminal.
            lines[row] = lines[row][:column].ljust(column) + character + lines[row][column + 1 :]
            column += 1
            widest = max(widest, column if "━" in lines[row] else 0)
    while lines and not lines[-1].strip():
        lines.pop()
    return Session(code, raw, [line.rstrip() for line in lines], widest, shown)
