"""OpenCV's log, kept from telling what is raised as an error anyway."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import cv2

_lock = threading.Lock()
# The level belongs to the whole process: blocks may overlap on several threads, and only the last one out restores it.
_levels: list[int] = []
_depth = 0


@contextmanager
def quiet() -> Iterator[None]:
    """Keep OpenCV from logging what is raised as an error anyway."""
    global _depth  # noqa: PLW0603
    with _lock:
        _depth += 1
        if _depth == 1:
            _levels.append(cv2.utils.logging.getLogLevel())
            cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        with _lock:
            _depth -= 1
            if _depth == 0:
                cv2.utils.logging.setLogLevel(_levels.pop())
