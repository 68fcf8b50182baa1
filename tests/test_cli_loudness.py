"""--quiet and --verbose: before and behind the name of every command, without a change to any result."""

from __future__ import annotations

import re
import shutil

import pytest
from every_command import COMMANDS
from messages import Listener, one_line

from camcal.workflows.telling import tell_unrefined


@pytest.fixture
def verbose_calibration(run, dataset, tmp_path):
    """Calibrate a folder with a file that is passed over, and return exit code, stdout and lines of stderr."""
    folder = tmp_path / "photos"
    shutil.copytree(dataset / "images", folder)
    (folder / "torn.png").write_bytes(b"\x89PNG\r\n\x1a\n")

    def call(*before: str, behind: tuple[str, ...] = ()) -> tuple[int, str, list[str]]:
        arguments = ("calibrate", *behind, folder, "--board", dataset / "board.yaml", "-o", tmp_path / "calib")
        code, out, err = run(*before, *arguments, "--force", "--no-report")
        return code, out, err.splitlines()

    return call


@pytest.mark.parametrize("name", ["", *sorted(COMMANDS)])
def test_every_command_has_both(run, name):
    """And the help says so."""
    code, out, _ = run(*([name] if name else []), "-h")
    assert code == 0
    assert "-q, --quiet" in out
    assert "-v, --verbose" in out


@pytest.mark.parametrize(
    ("before", "behind"), [(("-q",), ()), ((), ("--quiet",)), (("-qq",), ("-v",)), (("-v", "-qq"), ()), (("-q", "-v"), ("-q",))]
)
def test_quiet_keeps_warnings(verbose_calibration, before, behind):
    """What is passed over is named; one --verbose takes back one --quiet, wherever they stand."""
    plain = verbose_calibration()
    quiet = verbose_calibration(*before, behind=behind)
    assert quiet == plain
    assert [line for line in plain[2] if "torn.png" in line]


@pytest.mark.parametrize(("before", "behind"), [(("-qq",), ()), (("-q",), ("-q",)), ((), ("-q", "--quiet", "-q"))])
def test_very_quiet_leaves_the_result(verbose_calibration, before, behind):
    """No line on stderr; the result and the exit code are the same."""
    code, out, err = verbose_calibration(*before, behind=behind)
    assert (code, err) == (0, [])
    assert out == verbose_calibration()[1]


def test_failures_are_told_however_quiet(run):
    """One line, and the exit code."""
    code, _, err = run("-qqq", "verify", "nowhere", "--truth", "nowhere")
    assert code == 2
    assert one_line(err)


@pytest.mark.parametrize(("before", "behind"), [(("-v",), ()), ((), ("--verbose",))])
def test_verbose(verbose_calibration, before, behind):
    """Versions first; times of each stage; what was solved; one line for each image; time in all last; the same result."""
    code, out, err = verbose_calibration(*before, behind=behind)
    assert code == 0
    assert out == verbose_calibration()[1]
    assert all(line.startswith("camcal: ") for line in err)
    text = [line.removeprefix("camcal: ") for line in err]
    assert re.fullmatch(r"camcal \S+, Python 3\.\S+, OpenCV 5\.\S+, numpy \S+; \d+ processors", text[0])
    for stage in (r"Detecting: 9 in [\d.]+ s, .*", r"Refining: 8 in [\d.]+ s, .*", r"Cross-validating: [\d.]+ s"):
        assert [line for line in text if re.fullmatch(stage, line)], stage
    assert len([line for line in text if line.startswith("solved fx, fy, cx, cy, k1, k2, k3 from 336 corners of 8 views")]) == 2
    views = [line for line in text if re.match(r"\w+\.png: (used|rejected)", line)]
    assert [line.partition(":")[0] for line in views] == ["torn.png", *(f"view_{i:04d}.png" for i in range(8))]
    assert re.fullmatch(r"calibrate: [\d.]+ s in all \([\d.]+ s of processor time\)", text[-1])


def test_verbose_undistort(run, dataset, tmp_path):
    """One line for each file that is written."""
    code, _, err = run("undistort", dataset / "images", "--camera", dataset, "-o", tmp_path / "u", "-v")
    assert code == 0
    assert len(re.findall(r"^camcal: \S+view_\d{4}\.png: written to ", err, flags=re.MULTILINE)) == 8


def test_why_corners_are_not_refined():
    """The reason that stands first is among the details."""
    listener = Listener()
    tell_unrefined(["RMS is 7 px. Look.", "more"], listener)
    assert listener.details == [
        "corners stay as they were fitted, because the first calibration is not to be trusted: RMS is 7 px. Look."
    ]
