"""The Python API on arrays and cameras in memory: what the commands do to files."""

from __future__ import annotations

import dataclasses
import logging

import cv2
import numpy as np
import pytest
from array_scene import BOARD, POSE, TRUTH

import camcal
from camcal.formats.images import read_image
from camcal.observations import Detection, Rejected
from camcal.records import Intrinsics
from camcal.verdict import Finding, Verdict


def test_load_camera_works_with_cv2(tmp_path):
    """K and dist go into cv2 as they are: the same projections, to float64 rounding, and undistortion runs."""
    camcal.save_intrinsics(tmp_path / "camera.yaml", Intrinsics(TRUTH))
    camera = camcal.load_camera(tmp_path)
    assert camera.size == (640, 480)
    assert (camera.K.dtype, camera.K.shape) == (np.float64, (3, 3))
    assert (camera.dist.dtype, camera.dist.shape) == (np.float64, (8,))
    points = np.random.default_rng(0).uniform([-0.4, -0.3, 1], [0.4, 0.3, 2], (50, 3))
    seen, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.K, camera.dist)
    np.testing.assert_allclose(camera.project(points), seen.reshape(-1, 2), atol=1e-9)
    image = camcal.render(camera, BOARD, POSE)
    assert cv2.undistort(image, camera.K, camera.dist).shape == image.shape


def test_load_camera_warns_of_a_camera_that_was_rejected(tmp_path, caplog):
    """What must not be trusted is never handed over silently."""
    finding = Finding("large_rms", "rejected", 1.0, "RMS reprojection error is 9 px", "Look at the photographs.")
    camcal.save_intrinsics(tmp_path / "camera.yaml", Intrinsics(TRUTH, verdict=Verdict((finding,))))
    with caplog.at_level(logging.WARNING, "camcal"):
        camcal.load_camera(tmp_path / "camera.yaml")
    assert "not to be trusted" in caplog.text
    assert "9 px" in caplog.text


def test_render_shows_ink_and_paper_where_they_are():
    """The middle of a black square and of a white one have the light of ink and paper; the same seed, the same bytes."""
    image = camcal.render(TRUTH, BOARD, POSE, sensor=camcal.Sensor(read_noise_levels=0))
    # The square up-left of feature 0 is black, the one to its right white.
    middles = TRUTH.project(POSE.apply([[-0.01, -0.01, 0], [0.01, -0.01, 0]]))
    (ink_x, ink_y), (paper_x, paper_y) = np.rint(middles).astype(int)
    light = camcal.Light()
    assert image[ink_y, ink_x] == round(255 * light.black)
    assert image[paper_y, paper_x] == round(255 * light.white)
    first, again, other = (camcal.render(TRUTH, "checkerboard:7x6:20mm", POSE, seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    assert camcal.render(TRUTH, BOARD, POSE, sensor=camcal.Sensor(bits=16)).dtype == np.uint16


@pytest.mark.parametrize("colour", [False, True])
def test_detect_corners_finds_what_was_rendered(colour):
    """Every corner within five times the bound of its patch; grey or in colour."""
    image = camcal.render(TRUTH, BOARD, POSE)
    seen = camcal.detect_corners(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if colour else image, BOARD, name="left")
    assert isinstance(seen, Detection)
    assert (seen.source, len(seen)) == ("left", 42)
    bound = camcal.corner_bound(TRUTH, BOARD, POSE, blur_sigma_px=0.7, noise_levels=2.0, radius_px=8.0)
    error = seen.corners_px - TRUTH.project(POSE.apply(BOARD.object_points))
    assert (np.abs(error) < 5 * bound).all()


def test_detect_corners_says_why_not():
    """No board: a reason, not an exception; no image or an unknown refinement: an error that names it."""
    nothing = camcal.detect_corners(np.full((480, 640), 90, np.uint8), BOARD)
    assert isinstance(nothing, Rejected)
    assert nothing.reason
    with pytest.raises(camcal.InputError, match=r"int64 of shape \(2, 2\)"):
        camcal.detect_corners(np.eye(2, dtype=np.int64), BOARD)
    with pytest.raises(camcal.InputError, match="warped"):
        camcal.detect_corners(np.zeros((480, 640), np.uint8), BOARD, refine="warped")


def test_undistort_image_agrees_with_cv2():
    """Where OpenCV's own remap with the same cameras has an answer, grey values differ by its rounding at most."""
    image = camcal.render(TRUTH, BOARD, POSE, sensor=camcal.Sensor(blur_sigma_px=1.5, read_noise_levels=0))
    target = camcal.target_camera(TRUTH)
    # OpenCV rounds positions to 1/32 of a pixel for bytes; edges of this blur change by less than 60 levels a pixel.
    maps = cv2.initUndistortRectifyMap(TRUTH.K, TRUTH.dist, np.eye(3), target.K, target.size, cv2.CV_32FC1)
    expected = cv2.remap(image, *maps, cv2.INTER_LINEAR)
    difference = np.abs(camcal.undistort_image(image, TRUTH).astype(int) - expected)
    assert difference.max() <= 2
    np.testing.assert_array_equal(camcal.undistort_image(image, TRUTH, target), camcal.undistort_image(image, TRUTH))


def test_undistort_image_adds_a_lens_too():
    """From an image without the lens to one with it: the same as a render with the lens, but for interpolation."""
    soft = camcal.Sensor(blur_sigma_px=2.0, read_noise_levels=0)
    ideal = camcal.Camera(TRUTH.size, TRUTH.K)
    added = camcal.undistort_image(camcal.render(ideal, BOARD, POSE, sensor=soft), ideal, TRUTH)
    middle = (slice(100, 380), slice(150, 490))
    difference = added[middle].astype(int) - camcal.render(TRUTH, BOARD, POSE, sensor=soft)[middle]
    assert np.abs(difference).mean() < 1.5


def test_undistort_takes_cameras(dataset, tmp_path):
    """A camera in memory gives the same bytes as its file, also as the target; nothing of it has to be on disk."""
    known = camcal.load_intrinsics(dataset)
    camcal.undistort(dataset / "images", dataset, tmp_path / "file")
    target = camcal.load_camera(tmp_path / "file")
    camcal.undistort(dataset / "images", known, tmp_path / "known")
    camcal.undistort(dataset / "images", known.camera, tmp_path / "to", target=target)
    for name in [path.name for path in (dataset / "images").iterdir()]:
        first = (tmp_path / "file" / name).read_bytes()
        assert first == (tmp_path / "known" / name).read_bytes()
        assert first == (tmp_path / "to" / name).read_bytes()


def test_verify_takes_cameras(calibrated, dataset):
    """Cameras in memory differ by what their files do; views need folders; a rejected one is no better for being in memory."""
    estimate, truth = camcal.load_intrinsics(calibrated), camcal.load_camera(dataset)
    of_files, of_cameras = camcal.verify(calibrated, dataset), camcal.verify(estimate, truth)
    assert of_cameras.projection.max_px == of_files.projection.max_px
    assert of_cameras.parameters == of_files.parameters
    assert (of_files.views is None, of_cameras.views) == (False, None)
    with pytest.raises(camcal.InputError, match="no standard deviations known of this camera"):
        camcal.verify(estimate.camera, truth, max_sigma=4)
    finding = Finding("large_rms", "rejected", 1.0, "RMS reprojection error is 9 px", "Look at the photographs.")
    rejected = dataclasses.replace(estimate, verdict=Verdict((finding,)))
    assert "not to be trusted" in camcal.verify(rejected, truth).problems[0]


def test_calibrate_takes_arrays_and_gives_what_files_give(dataset, calibrated):
    """The same pixels in memory give the same camera to the last bit."""
    paths = sorted((dataset / "images").glob("*.png"))
    run = camcal.calibrate({path.name: read_image(path) for path in paths}, str(dataset / "board.yaml"))
    expected = camcal.load_intrinsics(calibrated)
    assert run.folder is None
    np.testing.assert_array_equal(run.intrinsics.camera.intrinsics, expected.camera.intrinsics)
    assert run.verdict == expected.verdict


def test_calibrate_names_arrays_without_names(dataset):
    """A list of arrays is called image_0000 and on; a stack is a list; the board may be an object."""
    stack = np.stack([read_image(path) for path in sorted((dataset / "images").glob("*.png"))])
    board = camcal.load_board(str(dataset / "board.yaml"))
    run = camcal.calibrate(list(stack), board, refine="opencv")
    assert [seen.source for seen in run.calibration.detections] == [f"image_{index:04d}" for index in range(len(stack))]
    again = camcal.calibrate(stack, board, refine="opencv")
    np.testing.assert_array_equal(again.intrinsics.camera.intrinsics, run.intrinsics.camera.intrinsics)


def test_calibrate_takes_views_from_any_detector(dataset):
    """Corners of `detect_corners` give what `calibrate` with the same refinement gives; a rejected view is kept by name."""
    board = camcal.load_board(str(dataset / "board.yaml"))
    images = {path.name: read_image(path) for path in sorted((dataset / "images").glob("*.png"))}
    seen = [camcal.detect_corners(image, board, name=name) for name, image in images.items()]
    blank = camcal.detect_corners(np.full((480, 640), 90, np.uint8), board, name="blank")
    run = camcal.calibrate([*seen, blank], board)
    np.testing.assert_array_equal(
        run.intrinsics.camera.intrinsics, camcal.calibrate(images, board, refine="saddle").intrinsics.camera.intrinsics
    )
    assert [rejected.source for rejected in run.calibration.rejected] == ["blank"]


def test_projection_sigma_of_a_run_is_what_its_file_tells(dataset):
    """At the image's middle and at the boards' range it is the figure that camera.yaml holds."""
    run = camcal.calibrate(dataset / "images", str(dataset / "board.yaml"), refine="opencv")
    known = run.intrinsics.uncertainty
    middle = (np.array(run.intrinsics.camera.size) - 1) / 2
    sigma = camcal.projection_sigma(run.calibration, [middle], known.range_m)
    np.testing.assert_allclose(sigma, [known.at_range.centre_px], rtol=1e-12)


def test_corners_of_another_detector_need_no_deviations():
    """Without them they are unknown; one number stands for every corner."""
    corners = np.zeros((3, 2))
    assert np.isnan(camcal.Detection("a", (640, 480), np.arange(3), corners).sigma_px).tolist() == [True] * 3
    assert camcal.Detection("a", (640, 480), np.arange(3), corners, sigma_px=0.1).sigma_px.tolist() == [0.1] * 3
    with pytest.raises(ValueError, match="sigma_px"):
        camcal.Detection("a", (640, 480), np.arange(3), corners, sigma_px=np.zeros(2))


def test_a_camera_in_memory_is_exported():
    """The same file as from the camera's own file, and a camera that is marked so in the warning."""
    made = camcal.export_camera(TRUTH, "colmap")
    assert made.content.splitlines()[-1] == "1 OPENCV 640 480 520.0 523.0 322.5 236.5 -0.18 0.06 0.001 -0.002"
    assert camcal.export_camera(camcal.Intrinsics(TRUTH, name="left"), "colmap").content.startswith("# Camera left, 640x480")
