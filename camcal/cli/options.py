"""What several commands share: options, and arguments that must not be empty."""

from __future__ import annotations

import click

from camcal.cli.console import say
from camcal.errors import InputError

force = click.option("--force", is_flag=True, help="Write into an output folder (or over a file) that exists.")
jobs = click.option("-j", "--jobs", type=click.IntRange(min=1), help="Images worked on at once.  [default: all processors]")
as_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")

refine = click.option(
    "--refine",
    default="warped",
    show_default=True,
    metavar="warped|saddle|opencv",
    help="How corners are refined: by the template that a first solve predicts, a fitted saddle, or OpenCV.",
)


def _show_help(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print the help and leave."""
    if wanted and not context.resilient_parsing:
        say(context.get_help())
        context.exit()


help_option = click.option(
    "-h", "--help", is_flag=True, is_eager=True, expose_value=False, callback=_show_help, help="Show this message."
)


class Command(click.Command):
    """A command that refuses empty arguments: as a path, empty text would quietly be the current folder."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does, then refuse what is empty."""
        rest = super().parse_args(ctx, args)
        for parameter in self.params:
            value = ctx.params.get(parameter.name or "")
            if value == "" or (isinstance(value, tuple) and "" in value):
                label = parameter.opts[-1]
                label = label if label.startswith("-") else label.upper()
                raise InputError(f"{label}: empty (got '', expected a value). Check the variable or quotes that it came from.")
        return rest
