"""The report made again from the files of a calibration alone: the same page, the same record, the same camera."""

from __future__ import annotations

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from report_pages import noisy_file, undated
from scenes import BOARD

from camcal.formats.views_file import load_views_and_options
from camcal.workflows import report as report_workflow
from camcal.workflows.calibrate import calibrate
from camcal.workflows.report import record_of
from camcal.workflows.restore import restore


def test_report_makes_the_same_page_again(reported, tmp_path):
    """From the folder's files alone, in another process: byte for byte, its date excepted."""
    command = [sys.executable, "-m", "camcal", "report", str(reported), "-o", str(tmp_path / "again.html")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert undated(tmp_path / "again.html") == undated(reported / "report.html")


def test_page_can_be_made_again_after_moving_house(run, reported, photographed, tmp_path):
    """Calibration and photographs moved together are found together; the page in the folder is replaced without asking."""
    shutil.copytree(reported, tmp_path / "calib")
    shutil.copytree(photographed, tmp_path / "photos")
    page = tmp_path / "calib/report.html"
    page.write_text(page.read_text(encoding="utf-8")[:1000], encoding="utf-8")
    assert run("report", tmp_path / "calib")[0] == 0
    assert undated(tmp_path / "calib/report.html") == undated(reported / "report.html")


@pytest.mark.parametrize(
    "options", [{}, {"warp": True, "scale": True}, {"distortion": "k1,k2,p1,p2"}, {"distortion": "k1,k2", "warp": True}]
)
def test_restored_calibration_is_the_one_that_was_written(tmp_path, options):
    """Corners, poses and residuals bit for bit, the joint covariance to the last digits that its inverse keeps.

    Without weights the same equations are built at the same state but for the last bits of the rotations; the condition of
    the scaled system is far below 1e8, so that eight of sixteen digits are left.
    """
    noisy_file(tmp_path / "seen.csv", moved_view=True)
    made = calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "calib", report=False, **options)
    known, again = made.calibration, restore(tmp_path / "calib").calibration
    assert made.calibration.outliers
    assert [seen.source for seen in again.detections] == [seen.source for seen in known.detections]
    for mine, theirs in zip(again.detections, known.detections, strict=True):
        assert np.array_equal(mine.ids, theirs.ids)
        assert np.array_equal(mine.corners_px, theirs.corners_px)
    assert all(np.array_equal(a, b) for a, b in zip(again.residuals_px, known.residuals_px, strict=True))
    assert all(np.array_equal(a.R, b.R) and np.array_equal(a.t, b.t) for a, b in zip(again.poses, known.poses, strict=True))
    scale = np.sqrt(np.diag(known.joint_covariance))
    np.testing.assert_allclose(
        again.joint_covariance / np.outer(scale, scale), known.joint_covariance / np.outer(scale, scale), atol=1e-8
    )
    np.testing.assert_allclose(again.pose_sigmas, known.pose_sigmas, rtol=1e-8)
    assert again.shape.names == known.shape.names
    assert again.rejected == known.rejected
    used = {seen.source for seen in known.detections}
    by_place = {(outlier.source, outlier.id): outlier for outlier in known.outliers}
    assert {(outlier.source, outlier.id) for outlier in again.outliers} == set(by_place)
    for outlier in again.outliers:
        before = by_place[outlier.source, outlier.id]
        assert (outlier.corner_px, outlier.residual_px) == (before.corner_px, before.residual_px)
        assert outlier.reason == before.reason or outlier.source not in used


def test_options_and_paths_are_remembered(dataset, tmp_path):
    """What differs from the defaults stands in views.yaml, with the way to each image; a replay takes both over."""
    options = {"distortion": "k1,k2", "refine": "saddle", "anamorphic": True}
    calibrate(dataset / "images", str(dataset / "board.yaml"), tmp_path / "one", report=False, **options)
    views, told = load_views_and_options(tmp_path / "one")
    assert told == ("--distortion", "k1,k2", "--refine", "saddle", "--anamorphic")
    assert all((tmp_path / "one" / view.path).resolve() == (dataset / "images" / view.source).resolve() for view in views)
    assert not any(Path(view.path).is_absolute() for view in views)
    calibrate(tmp_path / "one/corners.csv", str(dataset / "board.yaml"), tmp_path / "two", distortion="k1,k2", report=False)
    again, told = load_views_and_options(tmp_path / "two")
    assert told == ("--refine", "saddle", "--distortion", "k1,k2")
    assert [view.path for view in again] == [view.path for view in views]


def test_commands_on_the_page_give_the_same_camera(run, dataset, tmp_path, monkeypatch):
    """Both command lines, typed in the calibration's folder, give camera.yaml bit for bit."""
    calibrate(
        dataset / "images", str(dataset / "board.yaml"), tmp_path / "calib", distortion="k1,k2", name="left eye", report=False
    )
    monkeypatch.chdir(tmp_path / "calib")
    commands = report_workflow.commands(restore("."))
    lines = [shlex.split(line) for _, line in commands if line.startswith("camcal calibrate")]
    assert len(lines) == 2
    for number, (program, *arguments) in enumerate(lines):
        assert program == "camcal"
        arguments[-1] = f"../again{number}"
        assert run(*arguments)[0] == 0
        assert (tmp_path / f"again{number}/camera.yaml").read_bytes() == Path("camera.yaml").read_bytes()


def test_record_tells_what_was_asked_for(reported):
    """Board, free parameters and options for people; notes by view."""
    record = record_of(restore(reported))
    assert record.settings["Board"] == "checkerboard:7x6:20mm"
    assert record.settings["Solved for"] == "fx, fy, cx, cy, k1, k2, k3"
    assert record.settings["Options"] == "the defaults"
    assert set(record.notes) <= {seen.source for seen in record.calibration.detections}
