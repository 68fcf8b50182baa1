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

from camcal.errors import InputError

if TYPE_CHECKING:
    from camcal.workflows.reporting import Advance

_WIDTH = 10_000
"""Columns a table may take: a terminal that is too narrow wraps a line, which beats numbers cut off."""


class ConsoleReporter:
    """Warnings as lines on stderr; progress bars there too, but only on a terminal."""

    def warn(self, text: str) -> None:
        """Print one warning."""
        complain(f"warning: {text}")

    @contextmanager
    def progress(self, label: str, total: int) -> Iterator[Advance]:
        """Show a bar with rate and remaining time while the block runs."""
        if not sys.stderr.isatty():
            yield lambda: None
            return
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(label, total=total)
            yield lambda: bar.advance(task)


def say(text: str) -> None:
    """Print to stdout; if whoever read it has gone, this and all that follows is dropped and the command goes on.

    Raises
    ------
    InputError
        If it cannot be written for another reason, such as a full disk.
    """
    try:
        click.echo(text)
    except OSError as error:
        silence(sys.stdout)
        if not isinstance(error, BrokenPipeError):
            problem = (error.strerror or str(error)).lower()
            raise InputError(f"standard output: cannot be written ({problem}). Send it somewhere else.") from None


def complain(text: str) -> None:
    """Print one line to stderr; a stderr that cannot be written leaves nobody to tell."""
    line = "".join(character if character.isprintable() else repr(character)[1:-1] for character in text)
    try:
        click.echo(f"camcal: {line}", err=True)
    except OSError:
        silence(sys.stderr)


def silence(stream: TextIO) -> None:
    """Send a stream nowhere, so that Python does not try in vain to write the rest of it at exit."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)) -> None:
    """Print a table of numbers, right-aligned but for the columns `left`; no header, no header row."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD if header else None, show_header=bool(header), pad_edge=False)
    for index in range(len(rows[0])):
        table.add_column(header[index] if header else "", justify="left" if index in left else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console = Console(file=io.StringIO(), highlight=False, width=_WIDTH)
    lines = [line.rstrip() for line in "".join(segment.text for segment in console.render(table)).splitlines()]
    say(click.style(title, bold=True))
    say("\n".join(line for line in lines if line) + "\n")


def print_facts(facts: Mapping[str, str]) -> None:
    """Print named facts, one per line; empty ones are left out."""
    width = max(len(name) for name in facts)
    for name, fact in facts.items():
        if fact:
            say(f"{name:<{width}}  {fact}")


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
