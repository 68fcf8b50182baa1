"""Maps without interpolation: every position by the model itself, and otherwise the same map."""

from __future__ import annotations

import numpy as np
import pytest
from undistortion_scenes import FOLDED, LENSES, bilinear, camera_of, lies_within, seen_by

from camcal.undistortion.exact import exact_map
from camcal.undistortion.maps import OUTSIDE_PX, RIM_PX, dense_map, undistort_image, undistort_map, valid_mask
from camcal.undistortion.target import target_camera

SIZE = (320, 240)
# A float32 between 256 and 512 is rounded by up to 2**-16, once within its tile and once in the whole.
ROUNDED_PX = 2 * 2.0**-16


def positions(undistort) -> np.ndarray:
    """Source coordinates (height, width, 2) of a map."""
    return np.stack(dense_map(undistort), axis=-1)


@pytest.mark.parametrize("alpha", [0.0, 1.0])
@pytest.mark.parametrize("lens", LENSES)
def test_every_position_is_the_model_s(lens, alpha):
    """To float32's last bit, where the pixel sees the source, and which do is the model's answer too."""
    camera = camera_of(lens, SIZE)
    undistort = exact_map(undistort_map(camera, target_camera(camera, alpha), samples=1))
    true, mask = seen_by(camera, undistort.target), valid_mask(undistort)
    assert (np.abs(positions(undistort) - true)[mask == 255] <= ROUNDED_PX).all()
    assert (positions(undistort)[mask == 0] == OUTSIDE_PX).all()
    assert (mask[lies_within(true, SIZE, RIM_PX - ROUNDED_PX)] == 255).all()
    assert (mask[~lies_within(true, SIZE, RIM_PX + ROUNDED_PX)] == 0).all()


def test_interpolated_positions_are_not_as_exact():
    """Otherwise this would be for nothing: they are off by some 1e-4 pixels somewhere."""
    camera = camera_of("wide", SIZE)
    undistort = undistort_map(camera, target_camera(camera, 1.0), samples=1)
    seen = valid_mask(undistort) == 255
    off = np.abs(positions(undistort) - seen_by(camera, undistort.target))[seen].max()
    assert 2 * ROUNDED_PX < off <= 2.5e-4


@pytest.mark.parametrize("lens", LENSES)
def test_pixels_are_interpolated_there(lens):
    """A ramp of floats, interpolated linearly, shows the positions themselves; what sees nothing is filled."""
    camera = camera_of(lens, SIZE)
    undistort = exact_map(undistort_map(camera, target_camera(camera, 1.0), samples=1))
    ramp = np.tile(np.arange(SIZE[0], dtype=np.float32), (SIZE[1], 1))
    result, mask = undistort_image(ramp, undistort, fill=-1.0), valid_mask(undistort)
    # Weights are float32, and so are the products of the four neighbours with them: as many roundings of 2**-16 again.
    assert (
        np.abs(result - np.clip(seen_by(camera, undistort.target)[..., 0], 0, SIZE[0] - 1))[mask == 255].max() <= 6 * 2.0**-16
    )
    assert (result[mask == 0] == -1).all()


def test_smaller_results_average_exact_samples():
    """With several samples per pixel each of them is exact, and their mean is the pixel."""
    camera = camera_of("wide", SIZE)
    small = target_camera(camera, scale=0.25)
    undistort = exact_map(undistort_map(camera, small))
    assert undistort.samples == 4
    image = np.random.default_rng(0).normal(100, 20, (SIZE[1], SIZE[0])).astype(np.float32)
    samples = bilinear(image, seen_by(camera, small.scaled((small.size[0] * 4, small.size[1] * 4))))
    expected = samples.reshape(small.size[1], 4, small.size[0], 4).mean(axis=(1, 3))
    # The steepest slope is some 6 standard deviations a pixel, and a position is off by less than `ROUNDED_PX`.
    assert np.abs(undistort_image(image, undistort) - expected).max() <= 6 * 20 * ROUNDED_PX


@pytest.mark.parametrize("lens", FOLDED)
def test_a_fold_shows_no_ring(lens):
    """Past the fold nothing is seen: no position lies there, and no pixel has another value than the fill."""
    camera = camera_of(lens, SIZE)
    wide = target_camera(camera, fov_deg=150)
    undistort = exact_map(undistort_map(camera, wide, samples=1))
    blind = np.isnan(seen_by(camera, wide)[..., 0])
    assert blind.any()
    assert (undistort_image(np.full(SIZE[::-1], 200, np.uint8), undistort, fill=7)[blind] == 7).all()
    assert (valid_mask(undistort)[blind] == 0).all()
