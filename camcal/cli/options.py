"""What several commands share: options, and how their arguments are read and completed."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from camcal.cli import completion
from camcal.cli.console import ConsoleReporter, say
from camcal.cli.formatting import Context
from camcal.cli.loudness import DETAILS, loudness, loudness_options
from camcal.cli.width import wrapped_command
from camcal.errors import InputError
from camcal.nearest import did_you_mean

_LONGEST_METAVAR = 40

force = click.option("--force", is_flag=True, help="Write into an output folder (or over a file) that exists.")
jobs = click.option("-j", "--jobs", type=click.IntRange(min=1), help="Images worked on at once.  [default: all processors]")
as_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")

refine = click.option(
    "--refine",
    default="warped",
    show_default=True,
    type=click.Choice(["warped", "saddle", "opencv"]),
    help="How corners are refined: by the template that a first solve predicts, a fitted saddle, or OpenCV.",
)

html = click.option("--html", metavar="FILE", help="Write the result as a page as well; only a page of camcal's is replaced.")

plot_formats = click.option(
    "--plots-format",
    "plot_formats",
    multiple=True,
    type=click.Choice(["png", "svg", "pdf"]),
    default=["png", "svg", "pdf"],
    help="Only in this format; may be given several times.  [default: all three]",
)


def _show_help(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print the help and leave."""
    if wanted and not context.resilient_parsing:
        say(context.get_help())
        context.exit()


help_option = click.option(
    "-h", "--help", is_flag=True, is_eager=True, expose_value=False, callback=_show_help, help="Show this message."
)


if TYPE_CHECKING:
    _Words = click.Choice[str]
else:  # in click 8.1 it takes no parameter
    _Words = click.Choice


class Choice(_Words):
    """One of several words; a mistyped one is answered with the nearest."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the word, or say which was probably meant."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            raise click.BadParameter(error.message + did_you_mean(str(value), self.choices), ctx, param) from None


def _make_room(parameter: click.Parameter, words: Sequence[str]) -> None:
    """Move the words of an option into its help text, which can be wrapped, if there are too many for the option's column."""
    many = len("|".join(words)) > _LONGEST_METAVAR
    if many and isinstance(parameter, click.Option) and parameter.metavar is None:
        parameter.metavar = "NAME"
        parameter.help = f"{(parameter.help or 'One of').rstrip('.')}: {', '.join(words)}."


class Command(click.Command):
    """A command that refuses empty arguments, answers typing errors, completes paths, and can be quiet or verbose."""

    context_class = Context

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        for parameter in self.params:
            if type(parameter.type) is click.Choice:
                parameter.type = Choice(parameter.type.choices, parameter.type.case_sensitive)
                _make_room(parameter, parameter.type.choices)
            elif parameter.type is click.STRING:
                parameter.type = completion.text_type(parameter)
        # The help stands last.
        place = len(self.params) - any("--help" in parameter.opts for parameter in self.params[-1:])
        self.params[place:place] = loudness_options()

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse as click does, then refuse what is empty: as a path, empty text would quietly be the current folder."""
        rest = super().parse_args(ctx, args)
        for parameter in self.params:
            value = ctx.params.get(parameter.name or "")
            if value == "" or (isinstance(value, tuple) and "" in value):
                label = parameter.opts[-1]
                label = label if label.startswith("-") else label.upper()
                raise InputError(f"{label}: empty (got '', expected a value). Check the variable or quotes that it came from.")
        return rest

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write the example so that it can be copied into a shell, also where it is broken."""
        if self.epilog:
            indent = " " * formatter.indent_increment
            # An option stays with its value.
            parts = self.epilog.replace(" -", "\n-").split("\n")
            formatter.write(f"\n{indent}{wrapped_command(parts, len(indent))}\n")

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; who asks for details is also told what ran, and how long it took."""
        if loudness() < DETAILS:
            return super().invoke(ctx)
        reporter, begun_s, used_s = ConsoleReporter(), time.perf_counter(), time.process_time()
        reporter.detail(_versions())
        result = super().invoke(ctx)
        seconds, processor_s = time.perf_counter() - begun_s, time.process_time() - used_s
        reporter.detail(f"{ctx.info_name}: {seconds:.2f} s in all ({processor_s:.2f} s of processor time)")
        return result


def _versions() -> str:
    """Say which versions of what does the work are here."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    from camcal import __version__

    parts = [f"camcal {__version__}", f"Python {platform.python_version()}"]
    for name, package in (("OpenCV", "opencv-contrib-python-headless"), ("numpy", "numpy")):
        try:
            parts.append(f"{name} {version(package)}")
        except PackageNotFoundError:
            continue
    return f"{', '.join(parts)}; {os.cpu_count()} processors"
