"""How a workflow tells its caller what happens while it runs: progress and warnings."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol

Advance = Callable[[], None]
"""Called once for every finished item."""


class Reporter(Protocol):
    """Where progress and warnings go."""

    def warn(self, text: str) -> None:
        """Pass on one line that a person should read."""
        ...

    def progress(self, label: str, total: int) -> AbstractContextManager[Advance]:
        """Open a progress bar of `total` items; the context gives the function that advances it."""
        ...


class LogReporter:
    """The reporter of the Python API: warnings go to the `camcal` logger, progress nowhere."""

    def warn(self, text: str) -> None:
        """Log one warning."""
        # The command line, which has a reporter of its own, need not wait for it.
        import logging

        logging.getLogger("camcal").warning(text)

    def progress(self, label: str, total: int) -> AbstractContextManager[Advance]:  # noqa: ARG002
        """Show nothing."""
        return nullcontext(lambda: None)


class SilentReporter:
    """The reporter of a step whose caller looks at the result instead."""

    def warn(self, text: str) -> None:
        """Say nothing."""

    def progress(self, label: str, total: int) -> AbstractContextManager[Advance]:  # noqa: ARG002
        """Show nothing."""
        return nullcontext(lambda: None)
