"""One thread per job: OpenCV and BLAS held to a single thread, because their last bits depend on how many they use.

Whoever works on several images at once runs several such jobs; more threads inside each of them would only compete.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import cv2
from threadpoolctl import threadpool_limits


@contextmanager
def single_threaded() -> Iterator[None]:
    """Hold OpenCV and BLAS to one thread for the duration of the block, then restore what was set before."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(limits=1, user_api="blas"):
            yield
    finally:
        cv2.setNumThreads(before)
