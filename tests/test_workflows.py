"""The Python API: nothing is lost, nothing untrusted passes as trusted, every image is written or named."""

from __future__ import annotations

import logging
import shutil
import threading

import cv2
import numpy as np
import pytest

import camcal
from camcal.compare.parameters import parameter_errors
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.records import Intrinsics
from camcal.threads import single_threaded
from camcal.verdict import Finding, Verdict

BOARD = "checkerboard:7x6:20mm"
ABSURD = Verdict((Finding("large_rms", "rejected", 1.0, "RMS is absurd", "Look."),))


@pytest.fixture
def untrusted(calibrated, tmp_path):
    """A copy of the calibration whose camera file says that it must not be trusted."""
    folder = tmp_path / "untrusted"
    shutil.copytree(calibrated, folder)
    known = load_intrinsics(folder)
    marked = Intrinsics(known.camera, free=known.free, covariance=known.covariance, verdict=ABSURD)
    save_intrinsics(folder / "camera.yaml", marked)
    return folder


def test_calibration_is_not_replaced_by_its_undistorted_camera(dataset, calibrated, tmp_path):
    """Undistorting into the folder of a calibration is refused, with force too, and its camera stays."""
    folder = tmp_path / "calib"
    shutil.copytree(calibrated, folder)
    before = (folder / "camera.yaml").read_bytes()
    with pytest.raises(camcal.InputError, match="holds a calibration"):
        camcal.undistort(dataset / "images", folder, folder, force=True)
    assert (folder / "camera.yaml").read_bytes() == before


def test_undistorted_images_of_an_untrusted_camera_are_marked(dataset, untrusted, tmp_path, caplog):
    """The mark and its reason go on into the camera of the undistorted images, and a warning is given."""
    with caplog.at_level(logging.WARNING, logger="camcal"):
        camcal.undistort(dataset / "images", untrusted, tmp_path / "flat")
    assert load_intrinsics(tmp_path / "flat").verdict == ABSURD
    assert "not to be trusted: RMS is absurd. Look." in caplog.text


def test_untrusted_estimate_does_not_verify(dataset, untrusted):
    """However close it is, an estimate that is marked fails verification with the reason."""
    assert camcal.verify(untrusted, dataset).problems == ("the estimate is marked as not to be trusted: RMS is absurd. Look.",)


def test_two_estimates_differ_by_both_their_sigmas(dataset, calibrated):
    """Against another estimate the standard deviation is that of the difference: √2 of one's own for two alike."""
    estimate = load_intrinsics(calibrated)
    alone = parameter_errors(load_intrinsics(dataset), estimate)
    both = parameter_errors(estimate, estimate)
    assert [e.sigma for e in both] == pytest.approx([np.sqrt(2) * e.sigma for e in alone])


def test_a_lens_that_turns_back_in_the_image_fails_the_gate(dataset, tmp_path):
    """Pixels that only the truth sees cannot be compared; the gate says so instead of leaving them out."""
    truth = load_intrinsics(dataset).camera
    save_intrinsics(tmp_path / "folded.yaml", Intrinsics(camcal.Camera(truth.size, truth.K, [-0.9])))
    assert camcal.verify(tmp_path / "folded.yaml", dataset).problems == ()
    (problem,) = camcal.verify(tmp_path / "folded.yaml", dataset, max_diff_px=1e9).problems
    assert "turns back" in problem


def test_force_keeps_files_that_are_not_views(scene_file, tmp_path):
    """Rendering over an earlier dataset removes its views, and nothing else."""
    images = tmp_path / "data/images"
    camcal.synth(scene_file, tmp_path / "data")
    (images / "view_holiday.png").write_bytes(b"mine")
    (images / "view_0099.png").write_bytes(b"an older view")
    camcal.synth(scene_file, tmp_path / "data", force=True)
    assert (images / "view_holiday.png").read_bytes() == b"mine"
    assert not (images / "view_0099.png").exists()


def test_folder_with_unusable_images_is_undistorted_all_the_same(dataset, tmp_path, caplog):
    """Damaged images and those of another size are passed over by name; named ones are errors."""
    folder = tmp_path / "images"
    shutil.copytree(dataset / "images", folder)
    (folder / "torn.png").write_bytes((folder / "view_0000.png").read_bytes()[:1000])
    cv2.imwrite(str(folder / "small.png"), np.zeros((10, 10), np.uint8))
    with caplog.at_level(logging.WARNING, logger="camcal"):
        done = camcal.undistort(folder, dataset, tmp_path / "flat")
    assert [r.source for r in done.rejected] == ["small.png", "torn.png"]
    assert len(done.images) == 8
    assert (tmp_path / "flat/camera.yaml").exists()
    assert "small.png: passed over: not the camera's image size (got 10x10, expected 640x480)" in caplog.text
    with pytest.raises(camcal.InputError, match=r"small\.png: not the camera's image size"):
        camcal.undistort([folder / "small.png"], dataset, tmp_path / "named")


def test_folder_without_any_usable_image_is_an_error(dataset, tmp_path):
    """If nothing fits the camera there is no result."""
    (tmp_path / "images").mkdir()
    cv2.imwrite(str(tmp_path / "images/small.png"), np.zeros((10, 10), np.uint8))
    with pytest.raises(camcal.InputError, match="no usable image"):
        camcal.undistort(tmp_path / "images", dataset, tmp_path / "flat")


def test_undistort_option_writes_images_without_a_board_too(dataset, tmp_path):
    """An image of the camera's size is undistorted whether its board was found or not; one of another size is not."""
    folder = tmp_path / "images"
    shutil.copytree(dataset / "images", folder)
    cv2.imwrite(str(folder / "empty.png"), np.full((480, 640), 90, np.uint8))
    cv2.imwrite(str(folder / "small.png"), np.full((48, 64), 90, np.uint8))
    camcal.calibrate(folder, BOARD, tmp_path / "calib", undistort=True, report=False)
    written = {path.name for path in (tmp_path / "calib/undistorted").iterdir()}
    assert written == {"camera.yaml", "undistorted.csv", "empty.png", *(f"view_{i:04d}.png" for i in range(8))}


def test_one_path_needs_no_list(dataset):
    """A single folder is taken as a string or a path; nothing is written without an output."""
    run = camcal.calibrate(str(dataset / "images"), BOARD)
    assert run.folder is None
    assert len(run.calibration.detections) == 8


def test_rejections_for_the_same_reason_are_one_warning(dataset, tmp_path, caplog):
    """Six images without a board are one line that names the first four."""
    folder = tmp_path / "images"
    shutil.copytree(dataset / "images", folder)
    for index in range(6):
        cv2.imwrite(str(folder / f"empty_{index}.png"), np.full((480, 640), 90, np.uint8))
    with caplog.at_level(logging.WARNING, logger="camcal"):
        camcal.calibrate(folder, BOARD)
    lines = [record.message for record in caplog.records if "rejected" in record.message]
    assert len(lines) == 1
    assert lines[0].startswith("empty_0.png, empty_1.png, empty_2.png, empty_3.png and 2 more: rejected: ")


def test_thread_limits_of_overlapping_blocks():
    """Two overlapping blocks on two threads: OpenCV stays on one thread until both have ended, then gets its own back."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(2)
    inside, leave = threading.Event(), threading.Event()

    def other() -> None:
        with single_threaded():
            inside.set()
            leave.wait(10)

    thread = threading.Thread(target=other)
    thread.start()
    inside.wait(10)
    with single_threaded():
        assert cv2.getNumThreads() == 1
    assert cv2.getNumThreads() == 1
    leave.set()
    thread.join()
    assert cv2.getNumThreads() == 2
    cv2.setNumThreads(before)
