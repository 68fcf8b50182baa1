"""The command line: one small module per command that parses, calls its workflow and prints."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from camcal.errors import INTERRUPTED_EXIT_CODE


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code; expected failures become one line on stderr.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows `camcal` on the command line; from `sys.argv` by default.
    """
    # Parallel work runs on one thread per image; BLAS threads would only compete with them.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _replace_closed_streams()
    try:
        # Start-up is mostly this import, so that Ctrl-C has to be expected here too.
        from camcal.cli.app import run

        return run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt:
        from camcal.cli.console import complain

        complain("interrupted; every file that was written is whole.")
        return INTERRUPTED_EXIT_CODE


def _replace_closed_streams() -> None:
    """Let go nowhere what is written to a stream that the caller closed (`>&-`), which Python shows as None."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, PTH123 - stays open; pathlib imports slowly


def __getattr__(name: str) -> object:
    """Import the click group `cli` when it is asked for."""
    if name != "cli":
        raise AttributeError(f"module 'camcal.cli' has no attribute {name!r}")
    from camcal.cli.app import cli

    return cli
