"""What is said: a command's line on stderr, and what a workflow tells its reporter."""

from __future__ import annotations

from camcal.workflows.reporting import SilentReporter


class Listener(SilentReporter):
    """A reporter that remembers what it is told."""

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self.details: list[str] = []

    def warn(self, text: str) -> None:
        """Remember one warning."""
        self.warnings.append(text)

    def detail(self, text: str) -> None:
        """Remember one detail."""
        self.details.append(text)


def one_line(err: str) -> str:
    """Return the single line that stderr must consist of."""
    lines = err.splitlines()
    assert len(lines) == 1, err
    return lines[0]
