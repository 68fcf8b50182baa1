"""Settings of the whole process that are held while some block of code runs, on however many threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class ProcessWide:
    """A setting that blocks of code hold; they may overlap, and only the last one out restores what was before.

    Parameters
    ----------
    hold : callable
        Makes the setting, and returns what restores it.
    """

    def __init__(self, hold: Callable[[], Callable[[], object]]) -> None:
        self._hold = hold
        self._lock = threading.Lock()
        self._depth = 0
        self._restore: Callable[[], object] | None = None

    @contextmanager
    def held(self) -> Iterator[None]:
        """Hold the setting."""
        with self._lock:
            if not self._depth:
                self._restore = self._hold()
            self._depth += 1
        try:
            yield
        finally:
            with self._lock:
                self._depth -= 1
                if not self._depth and self._restore is not None:
                    self._restore()
