"""Maps: where every pixel looks, against the float64 model and OpenCV, and which pixels are valid."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from undistortion_scenes import FOLDED, LENSES, camera_of, lies_within, seen_by

from camcal.geometry.camera import Camera
from camcal.undistortion.maps import OUTSIDE_PX, RIM_PX, dense_map, distort_map, undistort_map, valid_mask
from camcal.undistortion.target import target_camera

# Interpolation between nodes is within 1e-4 at cells' centres, a float32 of up to 1000 rounds by 3e-5, and twice.
TOLERANCE_PX = 2.5e-4


def assert_follows_the_model(undistort) -> None:
    """Every pixel's coordinates and validity are those of the float64 model."""
    true = seen_by(undistort.source, undistort.target)
    map_x, map_y = dense_map(undistort)
    mask = valid_mask(undistort)
    surely = lies_within(true, undistort.source.size, RIM_PX - TOLERANCE_PX)
    maybe = lies_within(true, undistort.source.size, RIM_PX + TOLERANCE_PX)
    assert set(np.unique(mask)) <= {0, 255}
    assert (mask[surely] == 255).all()
    assert (mask[~maybe] == 0).all()
    assert (np.abs(np.stack([map_x, map_y], axis=-1) - true)[mask == 255] <= TOLERANCE_PX).all()
    assert (map_x[mask == 0] == OUTSIDE_PX).all()
    assert (map_y[mask == 0] == OUTSIDE_PX).all()


@pytest.mark.parametrize("alpha", [0.0, 1.0])
@pytest.mark.parametrize("lens", LENSES)
def test_maps_follow_the_model(lens, alpha):
    """Undistortion, for every kind of lens, with and without pixels that see nothing."""
    camera = camera_of(lens)
    assert_follows_the_model(undistort_map(camera, target_camera(camera, alpha), samples=1))


@pytest.mark.parametrize("lens", LENSES)
def test_maps_the_other_way_follow_the_model(lens):
    """Distortion: where each pixel of the camera looks in the ideal image."""
    camera = camera_of(lens, (320, 240))
    assert_follows_the_model(distort_map(camera, target_camera(camera, 0.5), samples=1))


def test_any_camera_is_a_target():
    """Two different lenses, sizes, pixel aspects and skew."""
    target = Camera((700, 333), [[300, 2, 340], [0, 350, 180], [0, 0, 1]], [0.1, -0.05, 0.001, 0.002])
    assert_follows_the_model(undistort_map(camera_of("barrel"), target, samples=1))


def test_large_maps_are_as_exact():
    """An image 40,000 pixels wide: coordinates count from each tile, so float32 rounds them no more than in a small one."""
    camera = Camera((40_000, 32), [[20_000, 0, 19_999.5], [0, 20_000, 15.5], [0, 0, 1]], [-0.05])
    undistort = undistort_map(camera, Camera(camera.size, camera.K))
    true = seen_by(camera, undistort.target)
    for tile in undistort.tiles:
        rows, columns = slice(tile.top, tile.top + tile.height), slice(tile.left, tile.left + tile.width)
        coordinates = np.moveaxis(tile.coordinates().astype(np.float64), 0, -1) + tile.window[:2]
        assert np.abs(coordinates - true[rows, columns]).max() <= TOLERANCE_PX


@pytest.mark.parametrize("lens", [lens for lens in LENSES if lens not in FOLDED])
def test_maps_agree_with_opencv(lens):
    """OpenCV's map in float32, to its rounding, for lenses without a fold."""
    camera = camera_of(lens)
    target = target_camera(camera)
    map_x, map_y = dense_map(undistort_map(camera, target))
    expected = cv2.initUndistortRectifyMap(camera.K, camera.dist, None, target.K, target.size, cv2.CV_32FC1)
    assert np.abs(map_x - expected[0]).max() <= TOLERANCE_PX
    assert np.abs(map_y - expected[1]).max() <= TOLERANCE_PX


@pytest.mark.parametrize("lens", FOLDED)
def test_folded_lens_shows_no_ring(lens):
    """Past the fold nothing is valid: where pixels and their neighbours are, the picture is never mirrored or turned over."""
    camera = camera_of(lens)
    undistort = undistort_map(camera, target_camera(camera, 1.0), samples=1)
    map_x, map_y = (m.astype(np.float64) for m in dense_map(undistort))
    valid = valid_mask(undistort) > 0
    assert not valid.all()
    together = valid[:-1, :-1] & valid[1:, :-1] & valid[:-1, 1:]
    x_u, y_u = map_x[:-1, 1:] - map_x[:-1, :-1], map_y[:-1, 1:] - map_y[:-1, :-1]
    x_v, y_v = map_x[1:, :-1] - map_x[:-1, :-1], map_y[1:, :-1] - map_y[:-1, :-1]
    determinant = (x_u * y_v - x_v * y_u)[together]
    # Pixels are a few apart in the source, so an area is rounded by a few times the coordinates' error.
    assert determinant.min() > -4 * TOLERANCE_PX
    assert (determinant > 0).mean() > 0.999


def test_valid_pixels_read_the_source_alone():
    """All that linear interpolation reads for a valid pixel, weights below a thousandth apart, lies inside the source."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera, 1.0))
    valid = valid_mask(undistort) > 0
    for coordinate, side in zip(dense_map(undistort), camera.size, strict=True):
        position = coordinate[valid].astype(np.float64)
        first, weight = np.floor(position), position % 1
        assert (first[weight < 1 - RIM_PX] >= 0).all()
        assert (first[weight > RIM_PX] + 1 <= side - 1).all()


def test_samples_follow_the_spacing():
    """One sample a pixel at full size, 4 x 4 at a quarter of it; a number that is none is refused."""
    camera = camera_of("barrel")
    assert undistort_map(camera, target_camera(camera)).samples == 1
    quarter = undistort_map(camera, target_camera(camera, scale=0.25))
    assert quarter.samples == 4
    assert valid_mask(quarter).shape == (120, 160)
    assert valid_mask(quarter).all()
    assert dense_map(quarter)[0].shape == (120, 160)
    with pytest.raises(ValueError, match="samples"):
        undistort_map(camera, camera, samples=3)


def test_maps_are_small():
    """The map of 12 megapixels takes less than 12 MB; as float32 images it would take 96."""
    camera = camera_of("barrel", (4000, 3000))
    tiles = undistort_map(camera, target_camera(camera)).tiles
    assert sum(tile.smooth.down.nbytes + tile.smooth.across.nbytes for tile in tiles) < 12e6
