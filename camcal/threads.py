"""One thread per job: OpenCV and BLAS held to a single thread, because their last bits depend on how many they use.

Whoever works on several images at once runs several such jobs; more threads inside each of them would only compete.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

import cv2
from threadpoolctl import threadpool_limits

from camcal.process_wide import ProcessWide


def _hold_to_one() -> Callable[[], None]:
    before, limits = cv2.getNumThreads(), threadpool_limits(limits=1, user_api="blas")
    cv2.setNumThreads(1)

    def restore() -> None:
        cv2.setNumThreads(before)
        limits.restore_original_limits()

    return restore


_SINGLE = ProcessWide(_hold_to_one)


def single_threaded() -> AbstractContextManager[None]:
    """Hold OpenCV and BLAS to one thread while any such block runs, then restore what was set before."""
    return _SINGLE.held()
