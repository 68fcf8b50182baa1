"""OpenCV's log, kept from telling what is raised as an error anyway."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial

import cv2

from camcal.process_wide import ProcessWide


def _silence() -> Callable[[], object]:
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    return partial(cv2.utils.logging.setLogLevel, before)


_SILENT = ProcessWide(_silence)


def quiet() -> AbstractContextManager[None]:
    """Keep OpenCV from logging what is raised as an error anyway."""
    return _SILENT.held()
