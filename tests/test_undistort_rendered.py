"""Rendered images undistorted on the command line: no lens is left, alpha keeps what it says, what goes wrong is one line."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
from messages import one_line

from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.verdict import Finding, Verdict


def test_undistort(run, dataset, tmp_path):
    """Names and sizes are kept, and no lens is left.

    A calibration of the undistorted images with k1..k3 free finds the camera written beside them, and 0 for each coefficient,
    within 4 standard deviations.
    """
    code, out, _ = run("undistort", dataset / "images", "--camera", dataset / "camera.yaml", "-o", tmp_path / "flat")
    assert code == 0
    assert "8 undistorted images" in out
    image = cv2.imread(str(tmp_path / "flat/view_0000.png"), cv2.IMREAD_UNCHANGED)
    assert image.shape == cv2.imread(str(dataset / "images/view_0000.png"), cv2.IMREAD_UNCHANGED).shape
    assert run("calibrate", tmp_path / "flat", "--board", dataset / "board.yaml", "-o", tmp_path / "c")[0] == 0
    code, out, _ = run("verify", tmp_path / "c", "--truth", tmp_path / "flat/camera.yaml", "--max-sigma", "4", "--json")
    assert code == 0
    assert [p["truth"] for p in json.loads(out)["parameters"] if p["name"].startswith("k")] == [0, 0, 0]


def test_undistort_alpha(run, dataset, tmp_path):
    """Alpha 1 keeps every pixel of the source in the picture; alpha 0 leaves no pixel that sees nothing of it."""
    source = load_intrinsics(dataset).camera
    targets = {}
    for alpha in ("0", "1"):
        out = tmp_path / alpha
        arguments = (dataset / "images/view_0000.png", "--camera", dataset, "-o", out, "--alpha", alpha)
        assert run("undistort", *arguments)[0] == 0
        targets[alpha] = load_intrinsics(out).camera
    edge = np.array([[0, 0], [639, 0], [0, 479], [639, 479], [320, 0], [320, 479], [0, 240], [639, 240]])
    # Both ends of every ray are at pixel centres; a thousandth of a pixel is far above rounding.
    assert targets["1"].contains(targets["1"].project(source.unproject(edge)), -0.501).all()
    assert not targets["0"].contains(targets["0"].project(source.unproject(edge))).all()
    assert source.contains(source.project(targets["0"].unproject(edge)), -0.501).all()
    assert not source.contains(source.project(targets["1"].unproject(edge))).all()


def test_undistort_with_an_untrusted_camera_warns(run, dataset, calibrated, tmp_path):
    """A camera marked as not to be trusted is used, with its first problem as a warning."""
    marked = tmp_path / "camera.yaml"
    verdict = Verdict((Finding("large_rms", "rejected", 1.0, "RMS is 7 px", "Look."),))
    save_intrinsics(marked, replace(load_intrinsics(calibrated), verdict=verdict))
    code, _, err = run("undistort", dataset / "images/view_0000.png", "--camera", marked, "-o", tmp_path / "flat")
    assert code == 0
    assert one_line(err).startswith("camcal: warning: ")
    assert "not to be trusted: RMS is 7 px." in err


def test_wrong_size_of_images_to_undistort(run, dataset, tmp_path):
    """A camera of another size than the images."""
    small = tmp_path / "small.png"
    cv2.imwrite(str(small), np.zeros((240, 320), np.uint8))
    code, _, err = run("undistort", small, "--camera", dataset / "camera.yaml", "-o", tmp_path / "o")
    assert code == 2
    assert "got 320x240, expected 640x480" in one_line(err)
