"""The same work on many items, on several threads, in order.

Threads, not processes: OpenCV and numpy release the interpreter lock where the time goes, and nothing has to be copied.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from camcal.errors import InputError
from camcal.threads import single_threaded
from camcal.workflows.reporting import Advance

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(function: Callable[[Item], Result], items: Sequence[Item], jobs: int | None, advance: Advance) -> list[Result]:
    """Apply a function to every item; the results keep the order of the items.

    Parameters
    ----------
    function : callable
        Called once per item, on any thread.
    items : sequence
    jobs : int or None
        How many threads; None is one per available processor.
    advance : callable
        Called after each item.

    Raises
    ------
    InputError
        If `jobs` is below 1.
    Exception
        The first one that an item raises; items that have not begun are dropped, also on Ctrl-C.
    """
    workers = available_processors() if jobs is None else jobs
    if workers < 1:
        raise InputError(f"--jobs: too few (got {workers}, expected at least 1).")

    def run(item: Item) -> Result:
        result = function(item)
        advance()
        return result

    with single_threaded():
        if workers == 1 or len(items) < 2:
            return [run(item) for item in items]
        pool = ThreadPoolExecutor(workers, thread_name_prefix="camcal")
        try:
            return list(pool.map(run, items))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def available_processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
