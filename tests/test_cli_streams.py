"""The command line when its streams are closed, full or broken, and when it is interrupted."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest
from videos import make_video
from waiting import wait_for

from camcal.cli import main

CAMCAL = [sys.executable, "-m", "camcal"]
needs_dev_full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")


def camcal(*arguments: object, stdout=subprocess.PIPE, stderr=subprocess.PIPE, closed=(), text=True, **environment: str):
    """Run the command in a process of its own; `closed` lists file descriptors that it finds closed."""

    def close() -> None:
        for descriptor in closed:
            os.close(descriptor)

    return subprocess.run(
        [*CAMCAL, *map(str, arguments)],
        stdout=stdout,
        stderr=stderr,
        text=text,
        check=False,
        preexec_fn=close if closed else None,
        env={**os.environ, **environment},
    )


@pytest.fixture
def broken_pipe():
    """A pipe that nobody reads any more."""
    read, write = os.pipe()
    os.close(read)
    yield write
    os.close(write)


@pytest.fixture(params=["", "1"], ids=["buffered", "unbuffered"])
def unbuffered(request) -> str:
    """Both ways in which Python may write: what a failed write leaves behind differs."""
    return request.param


def test_closed_stdout(dataset, calibrated):
    """`>&-`: the command works, says nothing, and keeps its exit code."""
    finished = camcal("verify", calibrated, "--truth", dataset, closed=(1,))
    assert (finished.returncode, finished.stderr) == (0, "")
    finished = camcal("verify", calibrated, "--truth", dataset, "--max-diff", "1e-9", closed=(1,))
    assert finished.returncode == 5
    assert camcal("demo", "--help", closed=(1,)).returncode == 0


def test_closed_stderr(dataset, tmp_path):
    """`2>&-`: warnings and failures are lost, exit codes and results are not."""
    assert camcal("verify", "nowhere", "--truth", "nowhere", closed=(2,)).returncode == 2
    finished = camcal(
        "calibrate", dataset / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "c", closed=(2,)
    )
    assert finished.returncode == 0
    assert "RMS" in finished.stdout
    assert camcal("frobnicate", closed=(1, 2)).returncode == 2


@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("verify", "--help")])
def test_help_into_a_broken_pipe(broken_pipe, unbuffered, arguments):
    """A reader that has gone is no failure of ours: exit 0, nothing said."""
    finished = camcal(*arguments, stdout=broken_pipe, PYTHONUNBUFFERED=unbuffered)
    assert (finished.returncode, finished.stderr) == (0, "")


@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_results_into_a_broken_pipe(dataset, calibrated, broken_pipe, unbuffered, flags):
    """The command goes on to its own end: 0 or, with a gate that fails, 5 and its line."""
    arguments = ("verify", calibrated, "--truth", dataset, *flags)
    finished = camcal(*arguments, stdout=broken_pipe, PYTHONUNBUFFERED=unbuffered)
    assert (finished.returncode, finished.stderr) == (0, "")
    finished = camcal(*arguments, "--max-diff", "1e-9", stdout=broken_pipe, PYTHONUNBUFFERED=unbuffered)
    assert finished.returncode == 5
    assert len(finished.stderr.splitlines()) == 1


def test_files_are_written_in_spite_of_a_broken_pipe(dataset, broken_pipe, tmp_path):
    """Calibrate prints after writing: the files are all there."""
    arguments = (dataset / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "c")
    assert camcal("calibrate", *arguments, stdout=broken_pipe, stderr=broken_pipe).returncode == 0
    assert (tmp_path / "c/camera.yaml").is_file()


@needs_dev_full
@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("verify",), ("verify", "--json")])
def test_full_stdout(dataset, calibrated, unbuffered, arguments):
    """A result that cannot be written is exit 2 with one line, whatever else the exit code would have been."""
    if arguments[0] == "verify":
        arguments = ("verify", calibrated, "--truth", dataset, "--max-diff", "1e-9", *arguments[1:])
    with Path("/dev/full").open("w") as full:
        finished = camcal(*arguments, stdout=full, PYTHONUNBUFFERED=unbuffered)
    assert finished.returncode == 2
    assert len(finished.stderr.splitlines()) == 1
    assert finished.stderr.startswith("camcal: standard output: cannot be written (no space left on device)")


@needs_dev_full
def test_full_stderr():
    """Nobody can be told, but the exit code stands."""
    with Path("/dev/full").open("w") as full:
        assert camcal("verify", "nowhere", "--truth", "nowhere", stderr=full).returncode == 2


@pytest.mark.parametrize("flags", [(), ("--json",)])
@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "latin-1", "cp1252"])
def test_names_that_are_no_utf8(dataset, tmp_path, encoding, flags):
    """A folder whose name is not UTF-8 is no reason for a traceback, whatever the terminal's encoding; JSON has its bytes."""
    folder = tmp_path / "c\udcff"
    arguments = ("calibrate", dataset / "corners.csv", "--board", dataset / "board.yaml", "-o", folder, *flags)
    finished = camcal(*arguments, PYTHONIOENCODING=encoding, text=False)
    assert (finished.returncode, finished.stderr) == (0, b"")
    if flags:
        assert json.loads(finished.stdout)["folder"] == str(folder)
    elif encoding == "utf-8":
        assert rb"c\udcff" in finished.stdout


def test_numbers_are_whole_on_a_narrow_terminal(dataset, calibrated):
    """On a terminal of 40 columns every word of the wide output is there, in order; the terminal wraps it."""
    pty, fcntl, termios = (pytest.importorskip(name) for name in ("pty", "fcntl", "termios"))
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, (24).to_bytes(2, sys.byteorder) + (40).to_bytes(2, sys.byteorder) + bytes(4))
    arguments = ("verify", calibrated, "--truth", dataset)
    wide = camcal(*arguments).stdout
    assert camcal(*arguments, stdout=theirs, NO_COLOR="1").returncode == 0
    os.close(theirs)
    shown = b""
    try:
        while piece := os.read(ours, 65536):
            shown += piece
    except OSError:
        pass
    os.close(ours)
    narrow = shown.decode().replace("\x1b[1m", "").replace("\x1b[0m", "")
    assert narrow.split() == wide.split()


def interrupted(arguments: list[object], begun, sent: signal.Signals = signal.SIGINT, times: int = 1) -> str:
    """Send Ctrl-C, or another signal, to a command once `begun()` is true; return what it wrote to stderr."""
    process = subprocess.Popen([*CAMCAL, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    wait_for(begun, process)
    for _ in range(times):
        process.send_signal(sent)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 128 + sent
    return err


def check_interrupted(err: str, folder: Path) -> None:
    """One line, no temporary file, every image whole, and no camera that would say that all is there."""
    assert err == "camcal: interrupted; every file that was written is whole.\n"
    files = [path for path in folder.rglob("*") if path.is_file()]
    assert [path for path in files if path.suffix not in {".png", ".yaml", ".csv"}] == []
    for path in files:
        assert path.suffix != ".png" or cv2.imread(str(path)) is not None


@pytest.fixture(scope="module")
def many_images(dataset, tmp_path_factory) -> Path:
    """So many images that working on them takes seconds."""
    folder = tmp_path_factory.mktemp("many")
    content = (dataset / "images/view_0000.png").read_bytes()
    for index in range(600):
        (folder / f"{index:03d}.png").write_bytes(content)
    return folder


def test_ctrl_c_of_synth(tmp_path):
    """Interrupted while rendering."""
    out = tmp_path / "data"
    err = interrupted(["synth", "phone_12mp", "-o", out], lambda: any(out.glob("images/*.png")))
    check_interrupted(err, out)
    assert not (out / "camera.yaml").exists()


def test_ctrl_c_of_calibrate(many_images, dataset, tmp_path):
    """Interrupted while detecting, which begins when the folder is made."""
    out = tmp_path / "c"
    err = interrupted(["calibrate", many_images, "--board", dataset / "board.yaml", "-o", out, "-j", "1"], out.exists)
    check_interrupted(err, out)
    assert list(out.iterdir()) == []


def test_ctrl_c_of_undistort(many_images, dataset, tmp_path):
    """Interrupted while images are written."""
    out = tmp_path / "u"
    command = ["undistort", many_images, "--camera", dataset, "-o", out, "-j", "1"]
    err = interrupted(command, lambda: any(out.glob("*.png")))
    check_interrupted(err, out)
    assert 0 < len(list(out.iterdir())) < 600
    assert not (out / "camera.yaml").exists()


@pytest.fixture(scope="module")
def long_video(tmp_path_factory) -> Path:
    """So many frames that undistorting them takes a while."""
    path = tmp_path_factory.mktemp("long") / "long.mp4"
    black = np.zeros((480, 640, 3), np.uint8)
    return make_video(path, frames=120, size=(640, 480), options={"preset": "ultrafast"}, picture=lambda *_: black)


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", ["out", "out/new.mp4"])
def test_a_video_half_written_is_removed(long_video, dataset, tmp_path, sent, name):
    """Ended by Ctrl-C or by the system, which may ask twice: one line, an exit code of its own, nothing left."""
    out = tmp_path / "out"
    command = ["undistort", long_video, "--camera", dataset, "-o", tmp_path / name, "--preset", "veryslow"]
    times = 2 if sent == signal.SIGTERM else 1
    err = interrupted(command, lambda: any(out.glob(".camcal-*.tmp")), sent, times)
    assert err == "camcal: interrupted; every file that was written is whole.\n"
    assert [path.name for path in out.rglob("*") if path.suffix in {".tmp", ".mp4"}] == []


def test_sigterm_of_undistort(many_images, dataset, tmp_path):
    """As Ctrl-C: every image whole, no temporary file, exit code 128 + 15."""
    out = tmp_path / "u"
    command = ["undistort", many_images, "--camera", dataset, "-o", out, "-j", "1"]
    check_interrupted(interrupted(command, lambda: any(out.glob("*.png")), signal.SIGTERM), out)
    assert not (out / "camera.yaml").exists()


def test_sigterm_stays_the_caller_s_affair(capsys):
    """What a caller does about it is left alone, and as it was afterwards; on another thread no handler is set."""
    seen: list[object] = []

    def note(*_: object) -> None:
        seen.append("noted")

    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    assert main(["--version"]) == 0
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    thread = threading.Thread(target=lambda: seen.append(main(["--version"])))
    thread.start()
    thread.join()
    signal.signal(signal.SIGTERM, note)
    try:
        assert main(["--version"]) == 0
        assert signal.getsignal(signal.SIGTERM) is note
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
    assert seen == [0]
    assert capsys.readouterr().err == ""


def test_ctrl_c_of_demo(tmp_path):
    """Interrupted in the first of its steps."""
    out = tmp_path / "demo"
    err = interrupted(["demo", "-o", out, "-j", "1"], lambda: any(out.glob("data/images/*.png")))
    check_interrupted(err, out)
    assert not (out / "calib/camera.yaml").exists()


@pytest.mark.parametrize("module", ["click", "camcal.cli.verify", "numpy", "camcal.workflows.verify"])
def test_ctrl_c_while_importing(module):
    """Interrupted by an import at start-up or within a command: exit 130, one line."""
    script = f"""
import sys
class Interrupt:
    def find_spec(name, *_):
        if name == {module!r}:
            sys.meta_path.remove(Interrupt)
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupt)
from camcal.cli import main
sys.exit(main(["verify", "a", "--truth", "b"]))
"""
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert finished.returncode == 130
    assert finished.stderr == "camcal: interrupted; every file that was written is whole.\n"


def test_our_own_bugs_keep_their_traceback(monkeypatch):
    """What is no expected failure is not swallowed."""

    def broken(*_: object, **__: object) -> None:
        raise OSError("a bug")

    monkeypatch.setattr("camcal.workflows.verify.verify", broken)
    with pytest.raises(OSError, match="a bug"):
        main(["verify", "a", "--truth", "b"])
