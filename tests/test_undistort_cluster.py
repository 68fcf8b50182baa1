"""`camcal undistort --scheduler`: a real Dask scheduler and workers on this machine, of which some die."""

from __future__ import annotations

import csv
import ctypes
import json
import os
import pickle
import signal
import struct
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from waiting import wait_for

import camcal
from camcal.errors import InputError
from camcal.formats.camera_file import save_intrinsics
from camcal.formats.ledger_file import LEDGER_NAME, Stamp
from camcal.geometry.camera import Camera
from camcal.observations import Rejected
from camcal.records import Intrinsics
from camcal.workflows.undistort import cluster as undistort_cluster
from camcal.workflows.undistort.cluster import Task, do_task
from camcal.workflows.undistort.geometry import Geometry
from camcal.workflows.undistort.image import ImageOptions
from camcal.workflows.undistort.work import Finished, Job, Setting

SIZE = (640, 480)
CAMERA = Camera(SIZE, [[500, 0, 303], [0, 510, 247], [0, 0, 1]], [-0.2, 0.05, 0.001, -0.002, 0])
SETTING = Setting(Geometry().cameras(CAMERA), ImageOptions())
COUNT = 40
_MOVED_TO = 0x80


@pytest.fixture(scope="module")
def workplace(tmp_path_factory) -> Path:
    """A camera, and images that take some hundredths of a second each."""
    folder = tmp_path_factory.mktemp("cluster")
    save_intrinsics(folder / "camera.yaml", Intrinsics(CAMERA))
    (folder / "photos").mkdir()
    image = np.random.default_rng(0).integers(0, 256, (*SIZE[::-1], 3), dtype=np.uint8)
    for index in range(COUNT):
        image[0, 0] = index
        assert cv2.imwrite(str(folder / f"photos/{index:02}.png"), image)
    return folder


@contextmanager
def program(*arguments: object) -> Iterator[subprocess.Popen]:
    """One of Dask's programs in the background, killed in the end."""
    command = [sys.executable, "-m", *map(str, arguments), "--no-dashboard"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def scheduler(folder: Path) -> Iterator[tuple[str, subprocess.Popen]]:
    """A scheduler: its address and process."""
    file = folder / "scheduler.json"
    flags = ("--host", "127.0.0.1", "--port", 0, "--scheduler-file", file)
    with program("distributed.cli.dask_scheduler", *flags) as process:
        wait_for(lambda: file.exists() and file.read_text().endswith("}"))
        yield json.loads(file.read_text())["address"], process


@contextmanager
def worker(address: str) -> Iterator[subprocess.Popen]:
    """A worker of one thread."""
    flags = (address, "--host", "127.0.0.1", "--nthreads", 1, "--no-nanny", "--memory-limit", 0)
    with program("distributed.cli.dask_worker", *flags) as process:
        yield process


def undistort(workplace: Path, address: str, *flags: object) -> subprocess.Popen:
    """Start the command in the background."""
    command = [sys.executable, "-m", "camcal", "undistort", workplace / "photos", "--camera", workplace / "camera.yaml"]
    every = [*command, "--scheduler", address, *flags]
    return subprocess.Popen([str(part) for part in every], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


class Watch:
    """Counts how often each name was given to a file in a folder, as the kernel tells."""

    def __init__(self, folder: Path) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        self._file = libc.inotify_init()
        assert libc.inotify_add_watch(self._file, os.fsencode(folder), _MOVED_TO) >= 0

    def counts(self) -> Counter[str]:
        """All of them, once."""
        found: Counter[str] = Counter()
        content = os.read(self._file, 1 << 20)
        os.close(self._file)
        while content:
            length = struct.unpack_from("iIII", content)[3]
            found[content[16 : 16 + length].rstrip(b"\0").decode()] += 1
            content = content[16 + length :]
        return found


def ledger_names(folder: Path) -> list[str]:
    """The results that the ledger names."""
    with (folder / LEDGER_NAME).open(newline="") as file:
        return sorted(row["output"] for row in csv.DictReader(file))


@pytest.mark.skipif(sys.platform != "linux", reason="inotify is Linux's")
def test_a_worker_that_dies_half_way(workplace, tmp_path):
    """Two workers that come late, of which one is killed: nothing is lost, nothing is written twice, nothing differs."""
    out, here = tmp_path / "out", tmp_path / "here"
    out.mkdir()
    names = [f"{index:02}.png" for index in range(COUNT)]
    watch = Watch(out)
    with scheduler(tmp_path) as (address, _):
        command = undistort(workplace, address, "-o", out)
        assert command.stderr is not None
        assert f"--scheduler: {address} has no workers yet; waiting for one." in command.stderr.readline()
        with worker(address) as first, worker(address):
            wait_for(lambda: len(list(out.glob("*.png"))) >= COUNT // 3)
            first.send_signal(signal.SIGKILL)
            text, err = command.communicate(timeout=120)
            assert (command.returncode, text) == (0, f"{out}: {COUNT} undistorted images and their camera.yaml.\n"), err
            again = undistort(workplace, address, "-o", out, "--resume")
            text, err = again.communicate(timeout=120)
            assert (again.returncode, text) == (0, f"{out}: nothing new ({COUNT} done before) and their camera.yaml.\n"), err
    assert {name: count for name, count in watch.counts().items() if name.endswith(".png")} == dict.fromkeys(names, 1)
    assert ledger_names(out) == names
    camcal.undistort(workplace / "photos", workplace / "camera.yaml", here)
    assert sorted(path.name for path in out.iterdir()) == sorted(path.name for path in here.iterdir())
    assert all((out / name).read_bytes() == (here / name).read_bytes() for name in [*names, "camera.yaml"])


def test_a_scheduler_that_dies(workplace, tmp_path):
    """One line and exit code 2; what is finished stays, and this machine goes on with the rest."""
    out = tmp_path / "out"
    with scheduler(tmp_path) as (address, process), worker(address):
        command = undistort(workplace, address, "-o", out)
        wait_for(lambda: len(list(out.glob("*.png"))) >= 3)
        process.kill()
        text, err = command.communicate(timeout=120)
    assert (command.returncode, text) == (2, ""), err
    assert err.splitlines()[-1] == ("camcal: --scheduler: the connection was lost. Go on with --resume when it is there again.")
    noted = ledger_names(out)
    assert not (out / "camera.yaml").exists()
    done = camcal.undistort(workplace / "photos", workplace / "camera.yaml", out, resume=True)
    assert sorted(job.name for job in done.already_done) == noted
    assert len(done.outputs) == COUNT - len(noted)


def test_interrupted(workplace, tmp_path):
    """Ctrl-C: exit code 130 and one line; tasks that had not begun are taken back."""
    out = tmp_path / "out"
    with scheduler(tmp_path) as (address, _), worker(address):
        command = undistort(workplace, address, "-o", out)
        wait_for(lambda: len(list(out.glob("*.png"))) >= 3)
        command.send_signal(signal.SIGINT)
        text, err = command.communicate(timeout=60)
        assert (command.returncode, text) == (130, "")
        assert err.splitlines()[-1] == "camcal: interrupted; every file that was written is whole."
        time.sleep(0.5)
        written = len(list(out.glob("*.png")))
        time.sleep(1)
        assert written == len(list(out.glob("*.png"))) < COUNT


# --- what a worker does, in this process ------------------------------------------------------------------------------


@pytest.fixture
def task(workplace, tmp_path) -> Task:
    """The first image's."""
    return Task(Job(workplace / "photos/00.png", tmp_path / "00.png", "00.png"), before=None)


def test_a_task_travels(task, workplace):
    """Task and setting survive the way to a worker, on which the source's stamp is taken; its map is built once."""
    built = []
    for _ in range(2):
        there, setting = pickle.loads(pickle.dumps((replace(task, before=Stamp.of(task.job.target)), SETTING)))
        report = pickle.loads(pickle.dumps(do_task(there, setting)))
        assert report.outcome == Finished(task.job)
        assert report.read == Stamp.of(workplace / "photos/00.png")
        built.append(undistort_cluster._undistorter(setting).map)
    assert built[0] is built[1]
    other = replace(SETTING, cameras=Geometry(alpha=1).cameras(CAMERA))
    assert undistort_cluster._undistorter(other).map is not built[0]


def test_a_result_that_a_lost_worker_left_is_left_alone(task):
    """If the place of the result has changed since the task was handed out, it is there; if not, it is made."""
    do_task(task, SETTING)
    made = task.job.target.stat()
    assert isinstance(do_task(task, SETTING).outcome, Finished)
    assert task.job.target.stat().st_ino == made.st_ino
    do_task(replace(task, before=Stamp.of(task.job.target)), SETTING)
    assert task.job.target.stat().st_ino != made.st_ino


def test_a_file_of_no_use_is_one_rejection(task):
    """It is the task's outcome, not its failure, so that the others go on."""
    torn = task.job.target.with_name("torn.png")
    torn.write_bytes(task.job.source.read_bytes()[:1000])
    report = do_task(replace(task, job=replace(task.job, source=torn)), SETTING)
    assert isinstance(report.outcome, Rejected)
    assert "truncated" in report.outcome.reason


def test_a_worker_that_cannot_do_such_work(task):
    """Another version of camcal, or a folder that is not there: an error that ends the run, and says where."""
    with pytest.raises(InputError, match=r"worker on .*: another version of camcal \(got .*, expected 9\.9\)"):
        do_task(replace(task, version="9.9"), SETTING)
    away = replace(task.job, target=Path("/nowhere/at/all/00.png"))
    with pytest.raises(InputError, match=r"worker on .*: does not see /nowhere/at/all\. Use a folder that all machines share"):
        do_task(replace(task, job=away), SETTING)


def test_few_tasks_at_a_time(monkeypatch):
    """However many jobs there are, the cluster has a few for each of its threads, and workers that come later count."""
    clock, threads = [0.0], {"a": 1}
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])

    class Client:
        def nthreads(self) -> dict[str, int]:
            return threads

    room = undistort_cluster._Room(Client())
    assert room.tasks == 16
    threads["b"] = 24
    assert room.tasks == 16
    clock[0] = 3.0
    assert room.tasks == 100
