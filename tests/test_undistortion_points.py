"""Points through the lens and back, and cameras for images of another size."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from undistortion_scenes import FOLDED, LENSES, camera_of, pixel_grid

from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.undistortion.points import distort_points, undistort_points
from camcal.undistortion.sizes import rescaled_camera
from camcal.undistortion.target import target_camera


@pytest.mark.parametrize("lens", LENSES)
def test_round_trip_from_the_image(lens):
    """Distorting what was undistorted returns every pixel within 1e-9; pixels that no ray reaches are NaN."""
    camera = camera_of(lens)
    target = target_camera(camera, 1.0)
    pixels = pixel_grid(camera.size)[::7, ::7]
    back = distort_points(undistort_points(pixels, camera, target), camera, target)
    seen = np.isfinite(back[..., 0])
    assert seen.all() != (lens in FOLDED)
    assert np.abs(back - pixels)[seen].max() <= 1e-9


@pytest.mark.parametrize("lens", [lens for lens in LENSES if lens not in FOLDED])
def test_round_trip_from_the_undistorted_image(lens):
    """Undistorting what was distorted returns every pixel within 1e-9, where the lens is not about to fold."""
    camera = camera_of(lens)
    target = target_camera(camera)
    pixels = pixel_grid(target.size)[::7, ::7]
    assert np.abs(undistort_points(distort_points(pixels, camera, target), camera, target) - pixels).max() <= 1e-9


def test_points_agree_with_opencv():
    """cv2.undistortPoints, run until it has converged."""
    camera = camera_of("tangential")
    target = target_camera(camera)
    pixels = pixel_grid(camera.size)[::31, ::31].reshape(-1, 2)
    expected = cv2.undistortPoints(pixels, camera.K, camera.dist, None, None, target.K, (3, 200, 1e-15)).reshape(-1, 2)
    np.testing.assert_allclose(undistort_points(pixels, camera, target), expected, atol=1e-8)


def test_points_by_hand():
    """With k1 = -0.1, the ray 0.5 to the side lands at 0.5 (1 - 0.025) = 0.4875."""
    camera = Camera((1000, 1000), [[1000, 0, 500], [0, 1000, 500], [0, 0, 1]], [-0.1])
    pinhole = Camera((1000, 1000), [[800, 0, 400], [0, 800, 400], [0, 0, 1]])
    np.testing.assert_allclose(distort_points([800, 400], camera, pinhole), [987.5, 500], atol=1e-12)
    np.testing.assert_allclose(undistort_points([987.5, 500], camera, pinhole), [800, 400], atol=1e-10)


def test_rescaled_by_hand():
    """Half the size: the centre of pixel c moves to (c + 0.5) / 2 - 0.5."""
    camera = Camera((640, 480), [[400, 0, 319.5], [0, 420, 200], [0, 0, 1]], [-0.1])
    half = rescaled_camera(camera, (320, 240))
    np.testing.assert_allclose(half.K, [[200, 0, 159.5], [0, 210, 99.75], [0, 0, 1]])
    assert rescaled_camera(camera, (640, 480)) is camera


@pytest.mark.parametrize("size", [(1333, 1000), (1334, 1000), (1332, 999), (8000, 6000), (3, 2)])
def test_rounded_sizes_are_accepted(size):
    """4000x3000 by one factor and rounded: 1333.3x1000 is one of them, and so is all that half a pixel allows."""
    assert rescaled_camera(camera_of("barrel", (4000, 3000)), size).size == size


@pytest.mark.parametrize("size", [(1335, 1000), (1331, 1000), (1920, 1080), (4000, 3002), (0, 0)])
def test_other_aspects_are_refused(size):
    """More than half a pixel from any one factor: the images were cropped."""
    with pytest.raises(InputError, match=r"aspect ratio differs.*calibrated at this"):
        rescaled_camera(camera_of("barrel", (4000, 3000)), size)


def test_turned_images_are_named():
    """Portrait images for a landscape camera."""
    with pytest.raises(InputError, match="turned by 90°"):
        rescaled_camera(camera_of("barrel", (4000, 3000)), (3000, 4000))
