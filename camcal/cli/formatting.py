"""How help is laid out."""

from __future__ import annotations

import sys

import click

from camcal.cli import style
from camcal.cli.width import WIDTH, terminal_columns

_NARROWEST, _MARGIN = 50, 2


class Formatter(click.HelpFormatter):
    """Help with bold headings; they are plain where there are no colours."""

    def write_heading(self, heading: str) -> None:
        """Write a heading."""
        super().write_heading(style.heading(heading))


class Context(click.Context):
    """The context of a command whose help is laid out so."""

    formatter_class = Formatter

    def make_formatter(self) -> click.HelpFormatter:
        """Begin a help text as wide as the terminal, in limits."""
        widest = self.max_content_width or WIDTH
        return Formatter(width=min(max(terminal_columns(sys.stdout) - _MARGIN, _NARROWEST), widest - _MARGIN))
