"""Jobs handed to an existing Dask cluster: one file per task, a few tasks ahead of its workers, each result written once.

A worker that dies loses the file it was working on, which then goes to another one, and what it had finished but not yet
reported, which the other one finds in its place and leaves alone. Maps are built by each worker when it first needs them.
"""

from __future__ import annotations

import logging
import os
import socket
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camcal import __version__
from camcal.errors import InputError
from camcal.formats.ledger_file import Stamp
from camcal.observations import Rejected
from camcal.threads import single_threaded
from camcal.workflows.reporting import Reporter
from camcal.workflows.undistort.work import Finished, Job, Note, Outcome, Setting, Undistorter

if TYPE_CHECKING:
    from distributed import Client, Future

_CONNECTING_S = 10
_TASKS_PER_THREAD = 4
_FEWEST_TASKS = 16
_COUNTED_AGAIN_S = 2.0
_LOGGERS = ("distributed", "tornado", "asyncio")


@dataclass(frozen=True, slots=True)
class Task:
    """A job as it travels to a worker.

    Attributes
    ----------
    job : Job
        With absolute paths.
    before : Stamp or None
        Of what stood in the place of the result when the task was handed out.
    version : str
        Of the camcal that hands it out.
    """

    job: Job
    before: Stamp | None
    version: str = __version__


@dataclass(frozen=True, slots=True)
class Report:
    """What a worker says of a task: its outcome, and what the source was like before it was read."""

    outcome: Outcome
    read: Stamp | None


def carry_out_on_cluster(address: str, jobs: Sequence[Job], setting: Setting, note: Note, reporter: Reporter) -> list[Outcome]:
    """Do jobs on a cluster.

    Parameters
    ----------
    address : str
        Of its scheduler, such as `tcp://host:8786`.
    jobs : sequence of Job
    setting : Setting
    note : callable
        Told of each finished job.
    reporter : Reporter

    Raises
    ------
    InputError
        If the extra is not installed, the scheduler does not answer, or its workers cannot do such work; what is finished
        by then stays.
    """
    with _connected(address) as client, reporter.progress("Undistorting", len(jobs)) as advance:
        if not client.nthreads():
            reporter.warn(f"--scheduler: {address} has no workers yet; waiting for one.")
        outcomes = []
        for job, report in _reports(client, jobs, setting):
            outcome = report.outcome
            if isinstance(outcome, Finished):
                outcome = replace(outcome, job=job)
                note(job, report.read)
            outcomes.append(outcome)
            advance()
        return outcomes


def do_task(task: Task, setting: Setting) -> Report:
    """Do a task, on a worker.

    Raises
    ------
    InputError
        If no task can be done here: another version of camcal, the output folder not in sight, or the disk full.
    """
    job, where = task.job, f"worker on {socket.gethostname()}"
    if task.version != __version__:
        raise InputError(
            f"{where}: another version of camcal (got {__version__}, expected {task.version}). Update one of them."
        )
    if not job.target.parent.is_dir():
        raise InputError(f"{where}: does not see {job.target.parent}. Use a folder that all machines share, by the same path.")
    read, now = Stamp.of(job.source), Stamp.of(job.target)
    if now is not None and now != task.before:
        # Another worker finished it and was lost before it could say so.
        return Report(Finished(job), read)
    with single_threaded():
        return Report(_undistorter(setting).do(job), read)


_lock = threading.Lock()
_held: dict[str, Undistorter] = {}


def _undistorter(setting: Setting) -> Undistorter:
    """Return this process's undistorter for a setting; only that of the last one is kept."""
    key = setting.key(is_video=False) + setting.key(is_video=True)
    with _lock:
        if key not in _held:
            _held.clear()
            _held[key] = Undistorter(setting)
        return _held[key]


def _reports(client: Client, jobs: Sequence[Job], setting: Setting) -> Iterator[tuple[Job, Report]]:
    """Hand out the jobs, never many more than there are threads, and give each one's report when it comes."""
    from distributed import as_completed

    run = os.urandom(8).hex()
    waiting = iter(enumerate(jobs))
    handed_out: dict[str, Job] = {}
    room = _Room(client)
    completed: Any = as_completed([], loop=client.loop)

    def hand_out() -> None:
        for index, job in islice(waiting, max(room.tasks - len(handed_out), 0)):
            far = replace(job, source=_absolute(job.source), target=_absolute(job.target))
            key = f"camcal-undistort-{run}-{index}"
            handed_out[key] = job
            completed.add(client.submit(do_task, Task(far, Stamp.of(far.target)), setting, key=key, pure=False))

    hand_out()
    for future in completed:
        job = handed_out.pop(future.key)
        yield job, _report(job, future)
        future.release()
        hand_out()


def _report(job: Job, future: Future[Report]) -> Report:
    """Return what a task gave; an error that would meet every other task too is raised."""
    from distributed import KilledWorker

    try:
        return future.result()
    except KilledWorker:
        return Report(Rejected(job.label, "every worker that tried it died (out of memory?)"), None)
    except ModuleNotFoundError as error:
        raise InputError(f"--scheduler: a worker lacks a module ({error}). Install camcal on every worker.") from None


class _Room:
    """How many tasks may be with the cluster at once; workers that come later are counted too."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._threads = 0
        self._counted_s = float("-inf")

    @property
    def tasks(self) -> int:
        """Several for each thread, so that none has to wait for the next."""
        if time.monotonic() > self._counted_s + _COUNTED_AGAIN_S:
            self._threads = sum(self._client.nthreads().values())
            self._counted_s = time.monotonic()
        return max(_FEWEST_TASKS, _TASKS_PER_THREAD * self._threads)


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    """Connect to a scheduler; whatever happens, tasks that have not begun are taken back in the end."""
    try:
        from distributed import CancelledError, Client
        from distributed.comm.addressing import get_address_host_port
        from distributed.comm.core import CommClosedError
    except ImportError:
        raise InputError(
            "--scheduler: needs Dask, which is not installed. Install it with pip install 'camcal[distributed]'."
        ) from None
    with _quiet():
        try:
            # Dask itself would try again and again for a while, and leave a client behind that cannot be closed.
            socket.create_connection(get_address_host_port(address), _CONNECTING_S).close()
            client = Client(address, timeout=_CONNECTING_S, set_as_default=False)
        except (OSError, ValueError) as error:
            cause = getattr(error, "strerror", None) or " ".join(str(error).split()) or type(error).__name__
            raise InputError(f"--scheduler: {address} does not answer ({cause}). Check the address.") from None
        try:
            yield client
        except (CommClosedError, CancelledError):
            raise InputError("--scheduler: the connection was lost. Go on with --resume when it is there again.") from None
        finally:
            client.close()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask from logging, and warning of, what is raised as an error anyway."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith(_LOGGERS)]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _absolute(path: Path) -> Path:
    """Return a path that means the same in another process, links left as they are."""
    return Path(os.path.abspath(path))  # noqa: PTH100 - pathlib's own keeps ".."
