"""Undistortion: maps that equal the geometry, frames that keep what alpha promises, images as a pinhole would see them."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import BOARD, CAMERA
from skimage.metrics import structural_similarity

from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light
from camcal.undistortion.maps import undistort_image, undistort_map
from camcal.undistortion.target import target_camera

LENSES = {
    "barrel": [-0.25, 0.08, 0, 0, -0.01],
    "pincushion": [0.2, 0.05],
    "wide": [-0.38, 0.15, 0, 0, -0.02],
    "tangential": [-0.2, 0.05, 0.002, -0.003, 0],
    "folds inside the image": [-0.6, 0.1],
}


def camera_of(lens: str) -> Camera:
    """A 640x480 camera behind one of the lenses; each but the last is valid over the whole image."""
    return Camera((640, 480), [[420, 0, 322.3], [0, 424, 236.1], [0, 0, 1]], LENSES[lens])


@pytest.mark.parametrize("lens", LENSES)
def test_alpha_zero_has_no_invalid_pixel_and_is_maximal(lens):
    """Every pixel sees the source, and the frame cannot be widened by half a percent without losing that."""
    camera = camera_of(lens)
    target = target_camera(camera, 0.0)
    assert undistort_map(camera, target).valid.all()
    wider = Camera(target.size, target.K * [[0.995, 1, 1], [1, 0.995, 1], [1, 1, 1]])
    assert not undistort_map(camera, wider).valid.all()


@pytest.mark.parametrize("lens", [name for name in LENSES if name != "folds inside the image"])
def test_alpha_one_shows_every_source_pixel(lens):
    """Every pixel of the source lands inside the frame, on at least one side to within a pixel of the border."""
    camera = camera_of(lens)
    target = target_camera(camera, 1.0)
    u, v = np.meshgrid(np.arange(camera.size[0]), np.arange(camera.size[1]))
    landed = target.project(camera.unproject(np.stack([u, v], axis=-1)))
    assert target.contains(landed, margin_px=0.5 - 1e-6).all()
    low, high = landed.reshape(-1, 2).min(axis=0), landed.reshape(-1, 2).max(axis=0)
    gaps = np.concatenate([low, np.array(camera.size) - 1 - high])
    assert gaps.min() < 1


def test_folded_lens_shows_no_ring():
    """Past the fold nothing is shown: what the map reads always projects back to where it stands."""
    camera = camera_of("folds inside the image")
    target = target_camera(camera, 1.0)
    undistort = undistort_map(camera, target)
    rows, columns = np.nonzero(undistort.valid)
    source = np.stack([undistort.map_x[rows, columns], undistort.map_y[rows, columns]], axis=-1)
    back = target.project(camera.unproject(source))
    away_from_fold = (
        np.linalg.norm(target.unproject(np.stack([columns, rows], axis=-1))[:, :2], axis=1) < 0.98 * camera.lens.valid_radius
    )
    assert np.abs(back - np.stack([columns, rows], axis=-1))[away_from_fold].max() < 0.05
    assert not undistort.valid.all()


def test_no_distortion_changes_nothing():
    """A pinhole's target is itself and its undistorted image the same bytes."""
    camera = Camera((64, 48), [[50, 0, 31], [0, 50, 24], [0, 0, 1]])
    assert target_camera(camera) is camera
    image = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
    assert (undistort_image(image, undistort_map(camera, camera)) == image).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_depth_and_channels_are_kept(dtype):
    """Gray and colour, 8 and 16 bit and float stay what they are; pixels that see nothing are filled."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera, 1.0))
    for shape in ((480, 640), (480, 640, 3), (480, 640, 4)):
        result = undistort_image(np.full(shape, 77, dtype), undistort, fill=5)
        assert result.dtype == dtype
        assert result.shape == shape
        assert (result[undistort.valid] == 77).all()
        assert (result[~undistort.valid] == 5).all()


@pytest.mark.parametrize("lens", ["barrel", "pincushion", "wide"])
def test_undistorted_render_equals_the_pinhole_render(lens):
    """Undistorting a render equals rendering through the target camera: SSIM >= 0.995, mean difference <= 1 level."""
    camera = camera_of(lens)
    target = target_camera(camera, 0.0)
    pose = Pose.from_rvec([0.2, -0.3, 0.1], np.zeros(3))
    pose = Pose(pose.R, np.array([0, 0, 0.36]) - pose.R @ BOARD.object_points.mean(axis=0))
    distorted, direct = (
        (255 * render_ideal(c, BOARD, pose, Light(), blur_sigma_px=1.0)).astype(np.float32) for c in (camera, target)
    )
    undistorted = undistort_image(distorted, undistort_map(camera, target))
    assert structural_similarity(undistorted, direct, data_range=255) >= 0.995
    assert np.abs(undistorted - direct).mean() <= 1


def test_wrong_size_is_refused():
    """An image of another size than the camera's."""
    camera = camera_of("barrel")
    with pytest.raises(ValueError, match="wrong size"):
        undistort_image(np.zeros((10, 10), np.uint8), undistort_map(camera, target_camera(camera)))


@pytest.mark.parametrize("alpha", [-0.1, 1.5, float("nan")])
def test_alpha_out_of_range(alpha):
    """Alpha lies within 0..1."""
    with pytest.raises(InputError, match="--alpha"):
        target_camera(CAMERA, alpha)
