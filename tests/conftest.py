"""Fixtures that several test files share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from undistort_files import CAMERA

from camcal.formats.camera_file import save_intrinsics
from camcal.records import Intrinsics
from camcal.workflows.calibrate import calibrate
from camcal.workflows.synth import synth

SMALL_SCENE = """\
name: small
seed: 3
camera: {size: [640, 480], fx: 520.0, fy: 523.0, cx: 322.0, cy: 236.0, distortion: {k1: -0.18, k2: 0.06}}
board: "checkerboard:7x6:20mm"
views: {count: 8, tilt_deg: [10, 40], fill: [0.5, 0.8]}
"""


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory) -> Path:
    """A small scenario, quick to render."""
    path = tmp_path_factory.mktemp("scene") / "small.yaml"
    path.write_text(SMALL_SCENE)
    return path


@pytest.fixture(scope="session")
def dataset(scene_file, tmp_path_factory) -> Path:
    """The small scenario, rendered: images/ and its truth. Not to be written into."""
    folder = tmp_path_factory.mktemp("dataset") / "data"
    synth(scene_file, folder)
    return folder


@pytest.fixture(scope="session")
def calibrated(dataset, tmp_path_factory) -> Path:
    """The rendered dataset, calibrated. Not to be written into."""
    folder = tmp_path_factory.mktemp("calibrated") / "calib"
    calibrate([dataset / "images"], str(dataset / "board.yaml"), folder)
    return folder


@pytest.fixture(scope="session")
def photos() -> Path:
    """The folder of photographs that CAMCAL_PHOTOS names; tests that need it are skipped where there is none."""
    folder = os.environ.get("CAMCAL_PHOTOS")
    if not folder:
        pytest.skip("CAMCAL_PHOTOS is not set: no photographs here")
    return Path(folder)


@pytest.fixture(scope="session")
def camera_file(tmp_path_factory) -> Path:
    """The file of a small camera with a lens. Not to be written into."""
    path = tmp_path_factory.mktemp("camera") / "small.yaml"
    save_intrinsics(path, Intrinsics(CAMERA, name="small"))
    return path
