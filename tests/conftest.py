"""Fixtures that several test files share."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from capture_scenes import ordinary_poses
from report_pages import NAME, ODD_IMAGE
from undistort_files import CAMERA, make_images

from camcal.cli import main
from camcal.formats.camera_file import save_intrinsics
from camcal.records import Intrinsics
from camcal.report.record import Record
from camcal.workflows.calibrate import calibrate
from camcal.workflows.synth import synth

SMALL_SCENE = """\
name: small
seed: 3
camera: {size: [640, 480], fx: 520.0, fy: 523.0, cx: 322.0, cy: 236.0, distortion: {k1: -0.18, k2: 0.06}}
board: "checkerboard:7x6:20mm"
views: {count: 8, tilt_deg: [10, 40], fill: [0.5, 0.8]}
"""


@pytest.fixture
def run(capsys) -> Callable[..., tuple[int, str, str]]:
    """Run a command in this process: exit code, stdout, stderr.

    Calibrations go without their page, which takes its time, unless `page` asks for it.
    """

    def call(*arguments: object, page: bool = False) -> tuple[int, str, str]:
        no_page = ["--no-report"] if arguments[:1] == ("calibrate",) and not page else []
        code = main([*(str(argument) for argument in arguments), *no_page])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


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
    calibrate([dataset / "images"], str(dataset / "board.yaml"), folder, report=False)
    return folder


@pytest.fixture(scope="session")
def photographed(dataset, tmp_path_factory) -> Path:
    """The small dataset with an odd file name, a photograph without a board, and a file that is no image.

    Not to be written into.
    """
    folder = tmp_path_factory.mktemp("report") / "photos"
    shutil.copytree(dataset / "images", folder)
    (folder / "view_0003.png").rename(folder / ODD_IMAGE)
    cv2.imwrite(str(folder / "street.png"), np.random.default_rng(0).integers(0, 255, (480, 640), dtype=np.uint8))
    (folder / "torn.png").write_bytes((folder / "view_0000.png").read_bytes()[:500])
    return folder


@pytest.fixture(scope="session")
def reported(photographed, dataset) -> Path:
    """The folder of a calibration from the command line, with its page. Not to be written into."""
    folder = photographed.parent / "calib"
    arguments = ["calibrate", photographed, "--board", dataset / "board.yaml", "-o", folder, "--name", NAME]
    assert main([str(argument) for argument in arguments]) == 0
    return folder


@pytest.fixture(scope="session")
def record() -> Record:
    """Twelve made views of a checkerboard, for figures."""
    from figure_records import made

    return made(ordinary_poses(12, 3))


@pytest.fixture(scope="session")
def photos() -> Path:
    """The folder of photographs that CAMCAL_PHOTOS names; tests that need it are skipped where there is none."""
    folder = os.environ.get("CAMCAL_PHOTOS")
    if not folder:
        pytest.skip("CAMCAL_PHOTOS is not set: no photographs here")
    return Path(folder)


@pytest.fixture(scope="session")
def mrcal_python() -> Path:
    """The Python that has mrcal; tests that need it are skipped where there is none."""
    python = Path("/usr/bin/python3")
    if not python.exists() or subprocess.run([python, "-c", "import mrcal"], check=False, capture_output=True).returncode:
        pytest.skip("mrcal is not installed")
    return python


@pytest.fixture(scope="session")
def camera_file(tmp_path_factory) -> Path:
    """The file of a small camera with a lens. Not to be written into."""
    path = tmp_path_factory.mktemp("camera") / "small.yaml"
    save_intrinsics(path, Intrinsics(CAMERA, name="small"))
    return path


@pytest.fixture
def undistort(run, tmp_path, monkeypatch) -> Callable[..., tuple[int, str, str]]:
    """Run the command in a folder with a camera.yaml and three photos: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    save_intrinsics("camera.yaml", Intrinsics(CAMERA))
    make_images(tmp_path / "photos", "a.png", "b.png", "c.png")

    def call(*arguments: object, camera: str = "camera.yaml") -> tuple[int, str, str]:
        return run("undistort", *arguments, "--camera", camera)

    return call
