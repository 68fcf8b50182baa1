"""What a person sees: progress and warnings on stderr, tables or JSON on stdout."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import click

from camcal.workflows.reporting import Advance

_WIDTH = 100
"""Columns of a table that goes to no terminal."""


class ConsoleReporter:
    """Warnings as lines on stderr; progress bars there too, but only on a terminal."""

    def warn(self, text: str) -> None:
        """Print one warning."""
        click.echo(f"camcal: warning: {text}", err=True)

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


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table whose first column is text and whose others are numbers, right-aligned; no header, no header row."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD if header else None, show_header=bool(header), pad_edge=False)
    for index in range(len(rows[0])):
        table.add_column(header[index] if header else "", justify="left" if index == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    console = Console(file=sys.stdout, highlight=False, width=None if sys.stdout.isatty() else _WIDTH)
    with console.capture() as capture:
        console.print(table)
    lines = [line.rstrip() for line in capture.get().splitlines()]
    click.secho(title, bold=True)
    click.echo("\n".join(line for line in lines if line) + "\n")


def number(value: float, form: str) -> str:
    """Write a number; a dash for one that is not known."""
    return "-" if math.isnan(value) else format(value, form)


def print_json(values: Mapping[str, object]) -> None:
    """Print one JSON document; what is not a number (NaN) becomes null."""
    click.echo(json.dumps(_plain(values), indent=2, ensure_ascii=False, allow_nan=False))


def _plain(value: object) -> object:
    """Replace NaN and infinity, which JSON does not have, by null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value
