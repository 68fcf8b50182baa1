"""How a workflow tells its caller what happens while it runs: progress, warnings, and details for who asks for them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Protocol

Advance = Callable[[], None]
"""Called once for every finished item."""


class Reporter(Protocol):
    """Where progress, warnings and details go."""

    def warn(self, text: str) -> None:
        """Pass on one line that a person should read."""
        ...

    def detail(self, text: str) -> None:
        """Pass on one line for a person who wants to know what was decided and how."""
        ...

    def progress(self, label: str, total: int | None) -> AbstractContextManager[Advance]:
        """Open a step of `total` items, None if they cannot be counted; the context gives the function that advances it.

        Steps may lie within each other.
        """
        ...


class LogReporter:
    """The reporter of the Python API: warnings and details go to the `camcal` logger, progress nowhere."""

    def warn(self, text: str) -> None:
        """Log one warning."""
        # The command line, which has a reporter of its own, need not wait for it.
        import logging

        logging.getLogger("camcal").warning(text)

    def detail(self, text: str) -> None:
        """Log one detail, as information."""
        import logging

        logging.getLogger("camcal").info(text)

    def progress(self, label: str, total: int | None) -> AbstractContextManager[Advance]:  # noqa: ARG002
        """Show nothing."""
        return nullcontext(lambda: None)


class SilentReporter:
    """The reporter of a step whose caller looks at the result instead."""

    def warn(self, text: str) -> None:
        """Say nothing."""

    def detail(self, text: str) -> None:
        """Say nothing."""

    def progress(self, label: str, total: int | None) -> AbstractContextManager[Advance]:  # noqa: ARG002
        """Show nothing."""
        return nullcontext(lambda: None)


@dataclass(frozen=True, slots=True)
class ProgressOnly:
    """The reporter of a step within another one: its progress is shown, its caller looks at the result for the rest.

    Attributes
    ----------
    outer : Reporter
        Of the step around it.
    """

    outer: Reporter

    def warn(self, text: str) -> None:
        """Say nothing."""

    def detail(self, text: str) -> None:
        """Say nothing."""

    def progress(self, label: str, total: int | None) -> AbstractContextManager[Advance]:
        """Show the progress below that of the step around it."""
        return self.outer.progress(label, total)
