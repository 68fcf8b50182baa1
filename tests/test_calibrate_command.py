"""`camcal calibrate`: from images or corners to a camera that is the truth's, and what its options change."""

from __future__ import annotations

import json
import math
import re
import shutil

import cv2
import pytest
import yaml
from every_command import COMMANDS
from messages import one_line

from camcal.formats.camera_file import load_intrinsics
from camcal.workflows.observe import REFINEMENTS


def test_calibrate_finds_the_truth(run, dataset, tmp_path):
    """Rendered pixels to a camera within 4 standard deviations of the truth, four files, and a table.

    What the corners are off by shows in the residuals, less what the 7 + 6 x 8 parameters take up; 4 standard deviations of
    that share allow for chance.
    """
    code, out, _ = run("calibrate", dataset / "images", "--board", dataset / "board.yaml", "-o", tmp_path / "calib")
    assert code == 0
    assert "RMS" in out
    assert "8 of 8 used" in out
    assert sorted(p.name for p in (tmp_path / "calib").iterdir()) == ["board.yaml", "camera.yaml", "corners.csv", "views.yaml"]
    code, out, _ = run("verify", tmp_path / "calib", "--truth", dataset, "--max-sigma", "4", "--json")
    assert code == 0
    result = json.loads(out)
    assert result["problems"] == []
    assert result["views"]["corners"] == 336
    values, parameters = 2 * 336, 7 + 6 * 8
    residual_px = load_intrinsics(tmp_path / "calib").rms_px / math.sqrt(2)
    expected_px = residual_px / math.sqrt(1 - parameters / values)
    assert result["views"]["corner_rms_px"] == pytest.approx(expected_px, rel=4 / math.sqrt(2 * values))


def test_calibrate_json(run, dataset, tmp_path):
    """--json prints one document and nothing else on stdout."""
    code, out, _ = run(
        "calibrate",
        dataset / "images",
        "--board",
        "checkerboard:7x6:20mm",
        "-o",
        tmp_path / "calib",
        "--json",
        "--distortion",
        "k1",
    )
    assert code == 0
    result = json.loads(out)
    assert list(result["standard_deviations"]) == ["fx", "fy", "cx", "cy", "k1"]
    assert result["views"] == 8


def test_calibrate_replays_its_corners_bit_for_bit(run, dataset, calibrated, tmp_path):
    """Calibrating from the corners.csv of a run, in which no view was rejected, gives the same four files."""
    code, *_ = run("calibrate", calibrated / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "again")
    assert code == 0
    for name in ("camera.yaml", "views.yaml", "corners.csv", "board.yaml"):
        assert (tmp_path / "again" / name).read_bytes() == (calibrated / name).read_bytes(), name


def test_calibrate_is_the_same_on_any_number_of_threads(run, dataset, calibrated, tmp_path):
    """One thread or two, images named in any order: the same bytes."""
    images = sorted((dataset / "images").iterdir(), reverse=True)
    assert run("calibrate", *images, "--board", dataset / "board.yaml", "-o", tmp_path / "again", "-j", "1")[0] == 0
    for name in ("camera.yaml", "corners.csv", "views.yaml", "board.yaml"):
        assert (tmp_path / "again" / name).read_bytes() == (calibrated / name).read_bytes(), name


def test_calibrate_from_exact_corners_is_exact(run, dataset, tmp_path):
    """The truth's corners.csv gives the truth back: f and c within 1e-6 px, k1 and k2 within 1e-9, k3 within 1e-8."""
    assert run("calibrate", dataset / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "calib")[0] == 0
    _, out, _ = run("verify", tmp_path / "calib", "--truth", dataset, "--json")
    errors = {p["name"]: abs(p["error"]) for p in json.loads(out)["parameters"]}
    assert max(errors[name] for name in ("fx", "fy", "cx", "cy")) < 1e-6
    assert max(errors["k1"], errors["k2"]) < 1e-9
    assert errors["k3"] < 1e-8


def test_calibrate_with_undistort(run, dataset, tmp_path):
    """--undistort writes the undistorted images and the camera that belongs to them."""
    code, *_ = run("calibrate", dataset / "images", "--board", dataset / "board.yaml", "-o", tmp_path / "calib", "--undistort")
    assert code == 0
    written = sorted(p.name for p in (tmp_path / "calib/undistorted").iterdir())
    assert written == ["camera.yaml", "undistorted.csv", *(f"view_{i:04d}.png" for i in range(8))]
    camera = yaml.safe_load((tmp_path / "calib/undistorted/camera.yaml").read_text())
    assert camera["distortion_coefficients"]["data"] == [0] * 5


def test_calibrate_only_used(run, dataset, tmp_path):
    """--only-used solves what the rows marked as used alone would give; without it every row is a candidate."""
    header, *rows = (dataset / "corners.csv").read_text().splitlines()
    kept = [row for index, row in enumerate(rows) if index % 7]
    marked = [row if index % 7 else row.removesuffix("1") + "0" for index, row in enumerate(rows)]
    for name, lines in (("marked", marked), ("kept", kept)):
        (tmp_path / f"{name}.csv").write_text("\n".join([header, *lines]) + "\n")
    counts = {}
    for name, source, flags in (("all", "marked", ()), ("used", "marked", ("--only-used",)), ("kept", "kept", ())):
        arguments = (tmp_path / f"{source}.csv", "--board", dataset / "board.yaml", "-o", tmp_path / name, *flags)
        assert run("calibrate", *arguments)[0] == 0
        counts[name] = load_intrinsics(tmp_path / name).corners
    assert counts == {"all": 336, "used": 288, "kept": 288}
    assert (tmp_path / "used/camera.yaml").read_bytes() == (tmp_path / "kept/camera.yaml").read_bytes()


def test_calibrate_anamorphic(run, dataset, tmp_path):
    """Images twice as wide: written and marked with exit 5 but for --anamorphic, which gives twice the fx."""
    header, *rows = (dataset / "corners.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[1] = str(2 * int(row[1]))
        # Pixel centres are whole numbers.
        row[4] = repr(2 * (float(row[4]) + 0.5) - 0.5)
    wide = tmp_path / "wide.csv"
    wide.write_text("\n".join([header, *(",".join(row) for row in cells)]) + "\n")
    code, _, err = run("calibrate", wide, "--board", dataset / "board.yaml", "-o", tmp_path / "a")
    assert code == 5
    assert "--anamorphic" in err
    code, _, _ = run("calibrate", wide, "--board", dataset / "board.yaml", "-o", tmp_path / "b", "--anamorphic")
    assert code == 0
    K, true = load_intrinsics(tmp_path / "b").camera.K, load_intrinsics(dataset).camera.K
    # The bound that exact corners are solved to (1e-6 px), twice for the stretched axis.
    assert K[0, 0] == pytest.approx(2 * true[0, 0], abs=2e-6)
    assert K[1, 1] == pytest.approx(true[1, 1], abs=1e-6)


def test_calibrate_name(run, dataset, tmp_path):
    """--name is the camera's name in the file, umlauts and spaces included."""
    arguments = (dataset / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "c")
    assert run("calibrate", *arguments, "--name", "Türkamera 2")[0] == 0
    assert load_intrinsics(tmp_path / "c").name == "Türkamera 2"


@pytest.mark.parametrize("name", ["bytes \udcff", "line\nbreak", "escape \x1b[31m", "x" * 1001])
def test_calibrate_refuses_a_name_that_no_file_can_hold(run, dataset, tmp_path, name):
    """Bytes that are not UTF-8, control characters and endless names are exit 2 before anything is written."""
    arguments = (dataset / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "c")
    code, _, err = run("calibrate", *arguments, "--name", name)
    assert code == 2
    assert "--name" in one_line(err)
    assert one_line(err).isprintable()
    assert not (tmp_path / "c").exists()


def test_calibrate_refine(run, dataset, tmp_path):
    """--refine chooses between the ways that its help names, each with an answer of its own; another one is exit 2."""
    option = next(p for p in COMMANDS["calibrate"].params if p.name == "refine")
    assert tuple(option.type.choices) == REFINEMENTS
    cameras = set()
    for way in REFINEMENTS:
        arguments = (dataset / "images", "--board", dataset / "board.yaml", "-o", tmp_path / way, "--refine", way)
        assert run("calibrate", *arguments)[0] == 0
        cameras.add(tuple(load_intrinsics(tmp_path / way).camera.intrinsics))
    assert len(cameras) == len(REFINEMENTS)
    arguments = (dataset / "images", "--board", dataset / "board.yaml", "-o", tmp_path / "x", "--refine", "warp")
    code, _, err = run("calibrate", *arguments)
    assert code == 2
    assert "--refine" in one_line(err)


def test_calibrate_warns_of_a_blurred_view(run, dataset, tmp_path):
    """A view blurred by 2.5 pixels (edges 6 pixels wide) is used, and named in one warning."""
    folder = tmp_path / "images"
    shutil.copytree(dataset / "images", folder)
    path = str(folder / "view_0003.png")
    cv2.imwrite(path, cv2.GaussianBlur(cv2.imread(path, cv2.IMREAD_UNCHANGED), (0, 0), 2.5))
    code, out, err = run("calibrate", folder, "--board", dataset / "board.yaml", "-o", tmp_path / "c", "--json")
    assert code == 0
    assert re.search(r"^camcal: warning: view_0003\.png: blurred", err, flags=re.MULTILINE)
    assert json.loads(out)["views"] == 8
