"""One thread per job: OpenCV and BLAS held to a single thread, because their last bits depend on how many they use.

Whoever works on several images at once runs several such jobs; more threads inside each of them would only compete.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import cv2
from threadpoolctl import threadpool_limits

_lock = threading.Lock()
# The limit belongs to the whole process: blocks may overlap on several threads, and only the last one out lifts it.
_held: list[tuple[int, Any]] = []
_depth = 0


@contextmanager
def single_threaded() -> Iterator[None]:
    """Hold OpenCV and BLAS to one thread while any such block runs, then restore what was set before."""
    global _depth  # noqa: PLW0603
    with _lock:
        _depth += 1
        if _depth == 1:
            _held.append((cv2.getNumThreads(), threadpool_limits(limits=1, user_api="blas")))
            cv2.setNumThreads(1)
    try:
        yield
    finally:
        with _lock:
            _depth -= 1
            if _depth == 0:
                before, limits = _held.pop()
                cv2.setNumThreads(before)
                limits.restore_original_limits()
