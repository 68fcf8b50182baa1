"""Progress of the steps under way, one row each on the last lines of a terminal, with everything else printed above."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from camcal.cli.style import in_colour
from camcal.cli.width import shortened

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

    from camcal.workflows.reporting import Advance

_PATIENCE_S = 0.5
"""A step that takes less shows no row: nobody could read it, and rich takes a while to import."""
_LONGEST_LABEL = 20
_LONGEST_BAR, _SHORTEST_BAR = 24, 4
_REST = 61
"""Columns of a row without its bar, at most."""
_FEW_PER_SECOND = 1.0
_MANY_PER_SECOND = 10.0


@dataclass(slots=True)
class Step:
    """A step under way.

    Attributes
    ----------
    label : str
    total : int or None
        How many items it has, if they can be counted.
    started_s : float
        On the monotonic clock.
    done : int
        Items that are finished.
    """

    label: str
    total: int | None
    started_s: float = field(default_factory=time.monotonic)
    done: int = 0
    task: TaskID | None = None

    @property
    def elapsed_s(self) -> float:
        """Seconds since it began."""
        return time.monotonic() - self.started_s

    @property
    def count(self) -> str:
        """How many items are done of how many."""
        return f"{self.done}/{self.total}" if self.total else ""

    @property
    def pace(self) -> str:
        """How fast it goes and how long it will take; only how long it has taken if that cannot be known."""
        elapsed_s = self.elapsed_s
        if not self.total or not self.done or not elapsed_s:
            return clock(elapsed_s)
        left_s = (self.total - self.done) * elapsed_s / self.done
        return f"{rate(self.done, elapsed_s)}, {clock(left_s)} left"


def rate(count: int, seconds: float) -> str:
    """Write how many items are done in a second, or how many seconds one takes.

    Examples
    --------
    >>> rate(300, 2.0), rate(5, 2.0), rate(3, 12.0)
    ('150/s', '2.5/s', '4.0 s each')
    """
    per_second = count / max(seconds, 1e-6)
    if per_second < _FEW_PER_SECOND:
        return f"{1 / per_second:.1f} s each"
    return f"{per_second:.0f}/s" if per_second >= _MANY_PER_SECOND else f"{per_second:.1f}/s"


def clock(seconds: float) -> str:
    """Write a duration as minutes and seconds, with hours if there are any.

    Examples
    --------
    >>> clock(7.6), clock(83.0), clock(3723.0)
    ('0:08', '1:23', '1:02:03')
    """
    minutes, whole = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{whole:02d}" if hours else f"{minutes}:{whole:02d}"


class Display:
    """The rows of all steps that are under way; they come up when one has taken a moment, and leave nothing behind."""

    def __init__(self) -> None:
        # Items finish on any thread, and the rows come up on one of their own.
        self._lock = threading.RLock()
        self._steps: list[Step] = []
        self._rows: Progress | None = None
        self._timer: threading.Timer | None = None

    @contextmanager
    def step(self, label: str, total: int | None) -> Iterator[tuple[Step, Advance]]:
        """Show a row while the block runs."""
        step = Step(shortened(label, _LONGEST_LABEL), total)
        self._open(step)
        try:
            yield step, lambda: self._advance(step)
        finally:
            self._close(step)

    def print_above(self, line: str) -> bool:
        """Print a line above the rows; tell whether there are any."""
        with self._lock:
            if self._rows is None:
                return False
            from rich.text import Text

            self._rows.console.print(Text.from_ansi(line), soft_wrap=True)
            return True

    def _open(self, step: Step) -> None:
        with self._lock:
            self._steps.append(step)
            if self._rows is not None:
                self._add(self._rows, step)
            elif self._timer is None:
                self._timer = threading.Timer(_PATIENCE_S, self._come_up)
                self._timer.daemon = True
                self._timer.start()

    def _advance(self, step: Step) -> None:
        with self._lock:
            step.done += 1
            if self._rows is not None and step.task is not None:
                self._rows.update(step.task, completed=step.done)

    def _close(self, step: Step) -> None:
        with self._lock:
            self._steps.remove(step)
            if self._rows is not None and step.task is not None:
                self._rows.remove_task(step.task)
            if self._steps:
                return
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            if self._rows is not None:
                self._rows.stop()
                self._rows = None

    def _come_up(self) -> None:
        """Show the rows of what is still under way."""
        new = _rows()
        with self._lock:
            if self._timer is not threading.current_thread():
                return
            self._rows = new
            for step in self._steps:
                self._add(new, step)
            new.start()

    @staticmethod
    def _add(rows: Progress, step: Step) -> None:
        step.task = rows.add_task(step.label, total=step.total, completed=step.done, step=step)


def _rows() -> Progress:
    """Return rich's display: label, bar, count, rate and remaining time."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    console: Console = Console(stderr=True, no_color=not in_colour(sys.stderr), highlight=False)
    bar = max(_SHORTEST_BAR, min(_LONGEST_BAR, console.width - _REST))
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=bar),
        TextColumn("{task.fields[step].count}", markup=False),
        TextColumn("{task.fields[step].pace}", markup=False),
        console=console,
        transient=True,
        # What is written to stdout belongs there, not above the rows.
        redirect_stdout=False,
    )
