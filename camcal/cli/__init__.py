"""The command line: one small module per command that parses, calls its workflow and prints."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import NoReturn

from camcal.errors import INTERRUPTED_EXIT_CODE, TERMINATED_EXIT_CODE


class Terminated(KeyboardInterrupt):
    """The system asks to end: cleaned up after as after Ctrl-C."""


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
        with _termination_raised():
            # Start-up is mostly this import, so that Ctrl-C has to be expected here too.
            from camcal.cli.app import run

            return run(sys.argv[1:] if arguments is None else arguments)
    except KeyboardInterrupt as interrupt:
        from camcal.cli.console import complain

        complain("interrupted; every file that was written is whole.")
        return TERMINATED_EXIT_CODE if isinstance(interrupt, Terminated) else INTERRUPTED_EXIT_CODE


@contextmanager
def _termination_raised() -> Iterator[None]:
    """Raise `Terminated` where SIGTERM would end the process at once; do nothing where it is ignored or a caller's affair."""
    if signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return
    # On any thread but the main one no handler can be set.
    with suppress(ValueError):
        signal.signal(signal.SIGTERM, _terminate)
    try:
        yield
    finally:
        with suppress(ValueError):
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _terminate(number: int, _: FrameType | None) -> NoReturn:
    """Unwind, once: some senders send it twice, and the second one would interrupt the cleaning."""
    signal.signal(number, signal.SIG_IGN)
    raise Terminated


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
