"""Whole processes, start-up included, that run in turn, with the time and the memory that each took."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median


@dataclass(frozen=True, slots=True)
class Run:
    """What a process and its children took: seconds of CPU and wall, and bytes of memory at the peak."""

    cpu_s: float
    wall_s: float
    peak_bytes: float


def alternating(commands: list[list[str]], runs: int) -> list[list[Run]]:
    """Run commands in turn, A B A B ..., each once uncounted first."""
    found: list[list[Run]] = [[] for _ in commands]
    for turn in range(runs + 1):
        for results, arguments in zip(found, commands, strict=True):
            run = measured(arguments)
            if turn:
                results.append(run)
    return found


def measured(arguments: list[str]) -> Run:
    """Run a command to its end; end this program if it fails."""
    start = time.perf_counter()
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{' '.join(arguments)}: exit code {process.returncode}")
    return Run(usage.ru_utime + usage.ru_stime, time.perf_counter() - start, usage.ru_maxrss * 1024)


def ratio(above: Iterable[Run], below: Iterable[Run], what: str) -> float:
    """Return the median over pairs of runs."""
    return median(getattr(a, what) / getattr(b, what) for a, b in zip(above, below, strict=True))
