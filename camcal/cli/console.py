"""What a person sees: progress and warnings on stderr, tables or JSON on stdout."""

from __future__ import annotations

import io
import math
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

import click

from camcal.cli import style
from camcal.cli.loudness import DETAILS, NO_PROGRESS, NO_WARNINGS, loudness
from camcal.cli.width import WIDTH, shortened, terminal_columns, wrapped
from camcal.errors import InputError

if TYPE_CHECKING:
    from camcal.cli.progress import Display
    from camcal.workflows.reporting import Advance

PROGRAM = "camcal:"
_UNBOUNDED = 10_000
_FIRST_ESCAPED_BYTE = 0xDC00
_BETWEEN = 3
"""Columns between two of a table."""


class ConsoleReporter:
    """Warnings and details as lines on stderr; progress there too, but only on a terminal; as loud as was asked for."""

    def __init__(self) -> None:
        self._loudness = loudness()
        self._display: Display | None = None

    def warn(self, text: str) -> None:
        """Print one warning."""
        if self._loudness > NO_WARNINGS:
            self._print(f"{PROGRAM} {style.warning('warning:')}", text)

    def detail(self, text: str) -> None:
        """Print one line of what was decided."""
        if self._loudness >= DETAILS:
            self._print(style.aside(PROGRAM), text)

    @contextmanager
    def progress(self, label: str, total: int | None) -> Iterator[Advance]:
        """Show a row with rate and remaining time while the block runs; then tell how long it took, if details are wanted."""
        shown = self._loudness > NO_PROGRESS and style.is_terminal(sys.stderr)
        if not shown and self._loudness < DETAILS:
            yield lambda: None
            return
        from camcal.cli.progress import Display, Step, rate

        if shown:
            self._display = self._display or Display()
            with self._display.step(label, total) as (step, advance):
                yield advance
        else:
            step = Step(label, total)
            yield lambda: None
        seconds = step.elapsed_s
        self.detail(f"{label}: {f'{total} in ' if total else ''}{seconds:.2f} s{f', {rate(total, seconds)}' if total else ''}")

    def _print(self, announced: str, text: str) -> None:
        """Print a line above the progress."""
        if self._display is None or not self._display.print_above(_line(announced, text)):
            complain(text, announced)


def say(text: str) -> None:
    """Print to stdout; if whoever read it has gone, this and all that follows is dropped and the command goes on.

    Raises
    ------
    InputError
        If it cannot be written for another reason, such as a full disk.
    """
    try:
        click.echo(text, color=style.in_colour(sys.stdout))
    except OSError as error:
        silence(sys.stdout)
        if not isinstance(error, BrokenPipeError):
            problem = (error.strerror or str(error)).lower()
            raise InputError(f"standard output: cannot be written ({problem}). Send it somewhere else.") from None


def say_wrapped(text: str) -> None:
    """Print a sentence to stdout, broken at blanks so that it fits a terminal; elsewhere it stays one line."""
    say(wrapped(text) if style.is_terminal(sys.stdout) else text)


def complain(text: str, announced: str = "") -> None:
    """Print one message to stderr; a stderr that cannot be written leaves nobody to tell.

    Parameters
    ----------
    text : str
    announced : str
        What stands before it; the mark of a failure by default.
    """
    try:
        click.echo(_line(announced or style.failure(PROGRAM), text), err=True, color=style.in_colour(sys.stderr))
    except OSError:
        silence(sys.stderr)


def on_one_line(text: str) -> str:
    """Write what would move a terminal's cursor, or do worse, as escapes, and bytes of a file's name that are no text too."""
    return "".join(character if character.isprintable() else _escaped(character) for character in text)


def _escaped(character: str) -> str:
    """Write a character as Python would; one that stands for a byte (PEP 383) as that byte."""
    byte = ord(character) - _FIRST_ESCAPED_BYTE
    return f"\\x{byte:02x}" if 0x80 <= byte <= 0xFF else repr(character)[1:-1]


def _line(announced: str, text: str) -> str:
    """Put a text on one line; on a terminal it goes on below, under its beginning, instead of being broken within a word."""
    line = on_one_line(text)
    if style.is_terminal(sys.stderr):
        plain = click.unstyle(announced) + " "
        line = wrapped(line, plain, "  ", terminal_columns(sys.stderr))[len(plain) :]
    return f"{announced} {line}"


def silence(stream: TextIO) -> None:
    """Send a stream nowhere, so that Python does not try in vain to write the rest of it at exit."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)) -> None:
    """Print a table of numbers, right-aligned but for the columns `left`; no header, no header row.

    A table that is too wide goes on below, with its first column again: no number is ever cut.
    """
    say(style.heading(wrapped(title)))
    for columns in _parts(header, rows):
        part = [[row[column] for column in columns] for row in rows]
        aligned_left = [place for place, column in enumerate(columns) if column in left]
        say("\n".join(_table_lines([header[column] for column in columns] if header else [], part, aligned_left)) + "\n")


def _parts(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[list[int]]:
    """Share the columns of a table out among as few tables as fit, each beginning with the first column."""
    widths = [max(map(len, column)) for column in zip(*([header] if header else []), *rows, strict=True)]
    whole = WIDTH - 1 - widths[0]
    parts, room = [[0]], whole
    for column, width in enumerate(widths[1:], start=1):
        if width + _BETWEEN > room and len(parts[-1]) > 1:
            parts.append([0])
            room = whole
        parts[-1].append(column)
        room -= width + _BETWEEN
    return parts


def _table_lines(header: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[int]) -> list[str]:
    """Lines of a table, however wide."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD if header else None, show_header=bool(header), pad_edge=False)
    for index in range(len(rows[0])):
        table.add_column(header[index] if header else "", justify="left" if index in left else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console = Console(file=io.StringIO(), highlight=False, markup=False, emoji=False, width=_UNBOUNDED)
    lines = [line.rstrip() for line in "".join(segment.text for segment in console.render(table)).splitlines()]
    return [line for line in lines if line]


def print_facts(facts: Mapping[str, str]) -> None:
    """Print named facts, one below the other; empty ones are left out, long ones go on below, under their beginning."""
    width = max(len(name) for name in facts)
    for name, fact in facts.items():
        if fact:
            first = f"{name:<{width}}  "
            # Who breaks lines already knows where.
            say(first + fact if "\n" in fact else wrapped(fact, first, " " * len(first)))


def fitted(name: str, room: int) -> str:
    """Return a name as it fits beside numbers on a terminal; elsewhere, where it may be looked for, it stays whole."""
    return shortened(name, room) if style.is_terminal(sys.stdout) else name


def number(value: float, form: str) -> str:
    """Write a number; a dash for one that is not known."""
    return "-" if math.isnan(value) else format(value, form)


def print_json(values: Mapping[str, object]) -> None:
    """Print one JSON document in ASCII, which every terminal and pipe can hold; what is not a number (NaN) becomes null."""
    import json

    say(json.dumps(_plain(values), indent=2, allow_nan=False))


def _plain(value: object) -> object:
    """Replace NaN and infinity, which JSON does not have, by null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value
