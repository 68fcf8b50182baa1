"""Waiting for what another process does."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable

_LONGEST_S = 60
_BETWEEN_S = 0.002


def wait_for(condition: Callable[[], bool], process: subprocess.Popen | None = None) -> None:
    """Wait until something is true: a minute at most, and no longer than the process runs that is to bring it about."""
    deadline = time.monotonic() + _LONGEST_S
    while not condition():
        assert process is None or process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(_BETWEEN_S)
