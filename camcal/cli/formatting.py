"""How help is laid out."""

from __future__ import annotations

import click

from camcal.cli import style


class Formatter(click.HelpFormatter):
    """Help with bold headings; they are plain where there are no colours."""

    def write_heading(self, heading: str) -> None:
        """Write a heading."""
        super().write_heading(style.heading(heading))


class Context(click.Context):
    """The context of a command whose help is laid out so."""

    formatter_class = Formatter
