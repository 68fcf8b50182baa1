"""The group of all commands, and the one place that turns failures into one line and an exit code."""

from __future__ import annotations

import importlib
import io
import os
import sys
from collections.abc import Sequence
from typing import Any

import click

from camcal import __version__
from camcal.cli import completion, options
from camcal.cli.console import complain, say
from camcal.cli.formatting import Context
from camcal.cli.loudness import loudness_options
from camcal.errors import CamcalError, InputError
from camcal.nearest import did_you_mean

COMMANDS = {
    "board": "Write a board as a page to print, true to scale.",
    "calibrate": "Find the board in photographs and solve for the camera.",
    "completion": "Print a script that lets a shell complete commands, options, files and shipped names.",
    "demo": "Show the whole chain: render a dataset, calibrate from its pixels, undistort it, compare with the truth.",
    "detect": "Find the board in photographs, and show what was seen.",
    "export": "Write a camera, a board or corners for another tool, in its own convention of pixels.",
    "import": "Read another tool's camera and write it as a camera file.",
    "regress": "Run the accuracy suite: render, calibrate from pixels, compare with the truth.",
    "report": "Make the page of a calibration again.",
    "schema": "Print the JSON Schema of a YAML file, with which editors complete and check it.",
    "synth": "Render a board through a known camera, with the exact truth beside the images.",
    "undistort": "Take the lens out of images, videos or points.",
    "verify": "Tell how far an estimated camera is from the truth.",
}
"""The commands, each with the first sentence of its help, so that the list of them needs none of their modules."""
_HOMES = {"completion": "completion_script", "import": "import_"}
"""Modules of `camcal.cli`, and functions in them, that are not called as their command is."""


class Commands(click.Group):
    """A group that names the command nearest to a mistyped one, and can be quiet or verbose."""

    context_class = Context

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self.params[:0] = loudness_options()

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002
        """Return the names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002
        """Import the command of a name when it is asked for; None if there is none."""
        if cmd_name not in COMMANDS:
            return None
        home = _HOMES.get(cmd_name, cmd_name)
        command: click.Command = getattr(importlib.import_module(f"camcal.cli.{home}"), home)
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or say which was probably meant."""
        name = args[0]
        if name in COMMANDS or ctx.resilient_parsing or name.startswith("-"):
            return super().resolve_command(ctx, args)
        advice = did_you_mean(name, COMMANDS) or f" Expected one of {', '.join(COMMANDS)}."
        raise click.UsageError(f"No such command {name!r}.{advice}", ctx)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002
        """Write each command with the whole of its first sentence."""
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


def _show_version(context: click.Context, _: click.Parameter, wanted: bool) -> None:
    """Print the version and leave."""
    if wanted and not context.resilient_parsing:
        say(f"camcal {__version__}")
        context.exit()


@click.group(
    cls=Commands,
    epilog="Example: camcal demo",
    invoke_without_command=True,
    context_settings={"max_content_width": 100},
)
@click.option("--version", is_flag=True, is_eager=True, expose_value=False, callback=_show_version, help="Show the version.")
@options.help_option
@click.pass_context
def cli(context: click.Context) -> None:
    """Calibrate cameras from photographs of a printed board, and take the lens out of images.

    Exit codes: 0 done, 2 bad input, 3 too few boards found, 4 not solvable, 5 result not to be trusted, 130 interrupted,
    143 terminated.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help(), err=True)
        context.exit(InputError.exit_code)


def run(arguments: Sequence[str]) -> int:
    """Run a command line, print what went wrong if something did, and return the exit code.

    Parameters
    ----------
    arguments : sequence of str
        What follows `camcal`.
    """
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A file name that is not UTF-8, or a terminal without "±", is no reason to lose a result.
        sys.stdout.reconfigure(errors="backslashreplace")
    if completion.VARIABLE in os.environ:
        cli.main(prog_name="camcal")
    try:
        with cli.make_context("camcal", list(arguments)) as context:
            cli.invoke(context)
    except click.exceptions.Exit as leaving:
        return leaving.exit_code
    except click.ClickException as error:
        complain(_usage(error))
        return InputError.exit_code
    except CamcalError as error:
        complain(str(error))
        return error.exit_code
    return 0


def _usage(error: click.ClickException) -> str:
    """Put click's message on one line, with the help to look at."""
    if isinstance(error, click.NoSuchOption):
        near = error.possibilities[0] if error.possibilities else ""
        message = f"No such option '{error.option_name}'." + (f" Did you mean '{near}'?" if near else "")
    else:
        message = " ".join(error.format_message().split())
    if not message.endswith((".", "?")):
        message += "."
    command = error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else "camcal"
    return f"{message} See '{command} --help'."
