"""What a person reads after calibrate and verify: digits, facts and the next command."""

from __future__ import annotations

import math
import re
import shlex
import shutil

import cv2
import numpy as np
import pytest

from camcal.boards.checkerboard import Checkerboard
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.corners_file import load_corners, save_corners
from camcal.geometry.camera import Camera
from camcal.observations import Detection
from camcal.records import Intrinsics
from camcal.rounding import decimals, plus_minus, rounded, spread

NAN = float("nan")


@pytest.fixture
def printed(run, dataset, tmp_path):
    """Calibrate and return what is printed on stdout."""

    def call(*inputs: object, board: object = dataset / "board.yaml", output: object = tmp_path / "calib") -> str:
        return run("calibrate", *inputs, "--board", board, "-o", output, page=True)[1]

    return call


@pytest.fixture
def summary(printed):
    """The same with each fact on one line, however long: what a shell makes of backslashes, and a reader of indents."""

    def call(*inputs: object, **settings: object) -> str:
        return re.sub(r"(?: \\)?\n {7,}(?=\S)", " ", printed(*inputs, **settings))

    return call


@pytest.mark.parametrize(
    ("value", "sigma", "shown", "its_sigma"),
    [
        (912.3686, 0.0516, "912.369", "0.052"),
        (0.060937308, 0.000165, "0.06094", "0.00016"),
        (912.3686, 0.0996, "912.37", "0.10"),
        (912.3686, 1.0, "912.4", "1.0"),
        (912.3686, 12.4, "912", "12"),
        (912.3686, 456.0, "912", "456"),
        (-0.0004, 0.04, "-0.000", "0.040"),
        (912.4, 3e-13, "912.4", "3e-13"),
        (912.4, 0.0, "912.4", "0"),
        (912.4, NAN, "912.4", "-"),
        (0.00107908653494, NAN, "0.00107909", "-"),
        (912.36861234, 0.0, "912.369", "0"),
    ],
)
def test_values_have_the_digits_of_their_sigma(value, sigma, shown, its_sigma):
    """Two significant digits of the standard deviation, and the value to the same decimal, worked by hand."""
    assert rounded(value, sigma) == shown
    assert spread(sigma) == its_sigma


def test_decimals_are_bounded():
    """More than nine decimals are none."""
    assert decimals(1.2e-8) == 9
    assert decimals(1.2e-9) is None


def test_plus_minus_in_line():
    """Decimal points and ± stand below each other; nothing gives nothing."""
    lines = plus_minus([(1234.5678, 0.23), (-0.5, 0.0012)])
    assert lines == ["1234.57   ± 0.23  ", "  -0.5000 ± 0.0012"]
    assert plus_minus([]) == []


def test_summary_fits_a_screen(printed, dataset, tmp_path, monkeypatch):
    """At most 26 lines of at most 80 columns."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(dataset / "images", "photographs-of-the-front-camera")
    lines = printed("photographs-of-the-front-camera", output="calib").splitlines()
    assert len(lines) <= 26
    assert max(map(len, lines)) <= 80


def test_summary_shows_what_the_camera_file_holds(summary, dataset, tmp_path):
    """Every free parameter to half a unit of its last digit, its standard deviation likewise, and RMS, corners and views."""
    out = summary(dataset / "images")
    known = load_intrinsics(tmp_path / "calib")
    values = dict(zip(known.camera.intrinsic_names, known.camera.intrinsics.tolist(), strict=True))
    shown = re.findall(r"(\w+) +(-?[\d.]+) +± ([\d.]+)", out)
    assert sorted(name for name, _, _ in shown) == sorted(known.free)
    for name, *texts in shown:
        for text, exact in zip(texts, (values[name], known.sigma[name]), strict=True):
            half = 0.5 * 10.0 ** -len(text.partition(".")[2])
            assert float(text) == pytest.approx(exact, abs=half * (1 + 1e-9))
        assert len(texts[0].partition(".")[2]) == len(texts[1].partition(".")[2])
    assert f"RMS    {known.rms_px:.3g} px over 336 corners" in out
    assert "views  8 of 8 used\n" in out
    assert "worst" not in out
    assert "lens" not in out


def test_summary_field_of_view(summary, dataset):
    """Degrees between the middles of opposite image edges, as OpenCV's inverse of the lens has them."""
    out = summary(dataset / "corners.csv")
    camera = load_intrinsics(dataset).camera
    edges = np.array([[-0.5, 239.5], [639.5, 239.5], [319.5, -0.5], [319.5, 479.5]])
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-12)
    ideal = cv2.undistortPoints(edges[:, None], camera.K, camera.dist, criteria=criteria)[:, 0]
    rays = np.column_stack([ideal, np.ones(4)])
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    expected = [math.degrees(math.acos(rays[i] @ rays[i + 1])) for i in (0, 2)]
    found = re.search(r"field of view ([\d.]+)° x ([\d.]+)°", out)
    assert found is not None
    # Half of the last digit shown.
    assert [float(text) for text in found.groups()] == pytest.approx(expected, abs=0.05 + 1e-9)


def test_summary_names_views_that_stand_out(summary, dataset, tmp_path):
    """Corners of one view made four times as bad as the others': that view is named as the worst one, and no other."""
    seen = list(load_corners(dataset / "corners.csv"))
    rng = np.random.default_rng(5)
    noisy = [
        Detection(d.source, d.size, d.ids, d.corners_px + rng.normal(0, 0.8 if i == 4 else 0.2, (len(d), 2)), d.sigma_px)
        for i, d in enumerate(seen)
    ]
    save_corners(tmp_path / "noisy.csv", noisy)
    worst = [line for line in summary(tmp_path / "noisy.csv").splitlines() if line.startswith("worst")]
    assert len(worst) == 1
    assert re.findall(r"\w+\.png", worst[0]) == [seen[4].source]


def test_summary_counts_rejected_views(summary, dataset, tmp_path):
    """An image without a board is one of the total, and rejected."""
    folder = tmp_path / "images"
    shutil.copytree(dataset / "images", folder)
    cv2.imwrite(str(folder / "blank.png"), np.full((480, 640), 128, np.uint8))
    assert "views  8 of 9 used, 1 rejected\n" in summary(folder)


def test_summary_tells_where_the_lens_turns_back(summary, tmp_path):
    """With k1 alone the model turns back at r² = 1 / (-3 k1), so at 2/3 r f pixels; the image reaches to its far corner."""
    board, f, k1 = Checkerboard(7, 6, 0.02), 400.0, -0.45
    camera = Camera((640, 480), [[f, 0, 310], [0, f, 235], [0, 0, 1]], [k1])
    rng = np.random.default_rng(3)
    middle = board.object_points.mean(axis=0)
    seen = []
    for index in range(8):
        R = cv2.Rodrigues(rng.normal(0, 0.4, 3))[0]
        points = (board.object_points - middle) @ R.T + np.array([0, 0, 0.28])
        seen.append(Detection(f"{index}.png", camera.size, np.arange(42), camera.project(points), np.full(42, NAN)))
    save_corners(tmp_path / "corners.csv", seen)
    out = summary(tmp_path / "corners.csv", "--distortion", "k1", board="checkerboard:7x6:20mm")
    radius = 2 / 3 * f / math.sqrt(-3 * k1)
    reach = math.hypot(639.5 - 310, 479.5 - 235)
    assert f"lens   model valid up to {radius:.0f} px from the principal point; the image reaches {reach:.0f} px\n" in out
    assert "field of view unknown x " in out


def test_summary_names_files_and_a_next_command_that_runs(run, summary, dataset, tmp_path, monkeypatch):
    """The files written are those named; what it says to run next runs as it stands, spaces in names included."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(dataset / "images", tmp_path / "my images")
    out = summary("my images")
    files = re.search(r"^files  (.*): (.*)$", out, flags=re.MULTILINE)
    assert files is not None
    assert sorted(files.group(2).split(", ")) == sorted(p.name for p in (tmp_path / "calib").iterdir())
    command = re.search(r"^next   camcal (.*)$", out, flags=re.MULTILINE)
    assert command is not None
    assert run(*shlex.split(command.group(1)))[0] == 0
    assert (tmp_path / "undistorted/camera.yaml").is_file()


@pytest.mark.parametrize("inputs", ["corners", "undistorted"])
def test_summary_suggests_verify_when_nothing_is_left_to_undistort(summary, dataset, inputs):
    """After a replay, or with --undistort."""
    out = summary(dataset / "corners.csv") if inputs == "corners" else summary(dataset / "images", "--undistort")
    assert re.search(r"^next   camcal verify \S+ --truth ", out, flags=re.MULTILINE)
    assert ("undistorted/" in out) == (inputs == "undistorted")


def test_summary_of_an_untrusted_result_suggests_nothing(summary, dataset, tmp_path):
    """Who must not trust a result is not told how to use it."""
    seen = load_corners(dataset / "corners.csv")
    rng = np.random.default_rng(0)
    save_corners(
        tmp_path / "bad.csv",
        [Detection(d.source, d.size, d.ids, d.corners_px + rng.normal(0, 6, (len(d), 2)), d.sigma_px) for d in seen],
    )
    out = summary(tmp_path / "bad.csv")
    assert "RMS" in out
    assert "next" not in out


def test_verify_rounds_to_the_standard_deviation(run, dataset, calibrated):
    """Estimate and difference have the decimals of the standard deviation beside them; the truth is as the scenario has it."""
    code, out, _ = run("verify", calibrated, "--truth", dataset)
    assert code == 0
    rows = re.findall(r"^ (\w+) +([-\d.]+) +([-\d.]+) +± ([\d.]+) +([-+\d.]+) +([-+\d.]+)$", out, flags=re.MULTILINE)
    assert [row[0] for row in rows] == ["fx", "fy", "cx", "cy", "k1", "k2", "k3"]
    for row in rows:
        assert len({len(text.partition(".")[2]) for text in row[2:5]}) == 1, row
    assert [row[1] for row in rows] == ["520", "523", "322", "236", "-0.18", "0.06", "0"]
    assert max(len(line) for line in out.splitlines()) <= 80


def test_verify_without_standard_deviations(run, dataset, tmp_path):
    """Two camera files of unknown quality: numbers in full, a dash where a standard deviation would stand."""
    save_intrinsics(tmp_path / "camera.yaml", Intrinsics(load_intrinsics(dataset).camera))
    code, out, _ = run("verify", tmp_path, "--truth", dataset / "camera.yaml")
    assert code == 0
    rows = [line.split() for line in out.splitlines() if line.startswith((" fx ", " k1 "))]
    assert rows == [["fx", "520", "520", "±", "-", "+0", "-"], ["k1", "-0.18", "-0.18", "±", "-", "+0", "-"]]
