"""The command line: one small module per command that parses, calls its workflow and prints."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

import click

from camcal import __version__
from camcal.cli.board import board
from camcal.cli.calibrate import calibrate
from camcal.cli.demo import demo
from camcal.cli.synth import synth
from camcal.cli.undistort import undistort
from camcal.cli.verify import verify
from camcal.errors import INTERRUPTED_EXIT_CODE, CamcalError

_EPILOG = "Example: camcal demo"


@click.group(epilog=_EPILOG, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="camcal", message="%(prog)s %(version)s")
def cli() -> None:
    """Calibrate cameras from photographs of a printed board, and take the lens out of images.

    Exit codes: 0 done, 2 bad input, 3 too few boards found, 4 not solvable, 5 result not to be trusted, 130 interrupted.
    """


for _command in (demo, board, synth, calibrate, undistort, verify):
    cli.add_command(_command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code; expected failures become one line on stderr.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows `camcal` on the command line; from `sys.argv` by default.
    """
    # Parallel work runs on one thread per image; BLAS threads would only compete with them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        cli.main(args=arguments, prog_name="camcal", standalone_mode=False)
    except click.ClickException as error:
        error.show()
        return error.exit_code
    except CamcalError as error:
        click.echo(f"camcal: {error}", err=True)
        return error.exit_code
    except (click.Abort, KeyboardInterrupt):
        click.echo("camcal: interrupted; every file that was written is whole.", err=True)
        return INTERRUPTED_EXIT_CODE
    except BrokenPipeError:
        # Whoever read our output has gone; nothing more can be said, and Python must not try at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0
