"""Images through maps: what fills the rim, what alpha and light are worth, and into which buffers."""

from __future__ import annotations

import numpy as np
import pytest
from undistortion_scenes import COORDINATE_PX, camera_of, noise, shifted_pair

from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.undistortion.maps import dense_map, undistort_image, undistort_map, valid_mask
from camcal.undistortion.target import target_camera


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("shape", [(), (3,), (4,)])
def test_fill_per_channel(shape, samples):
    """One value, or one for each channel; a value that no pixel can have is refused."""
    source, target = shifted_pair((70, 50), (30.0, 0.0))
    undistort = undistort_map(source, target, samples=samples)
    fill = list(range(10, 10 + len(shape) * 4))[: shape[0]] if shape else 9
    result = undistort_image(np.full((50, 70, *shape), 200, np.uint8), undistort, fill=fill, alpha=False)
    # Where a pixel has two samples each way, those of the outermost pixels reach past the rim.
    assert (result[1:-1, :39] == 200).all()
    assert (result[:, 41:] == fill).all()
    assert (result[[0, -1], :39] == (200 if samples == 1 else fill)).all()
    for wrong in (-1, 256, 0.5, [1, 2], float("nan")):
        with pytest.raises(InputError, match="--fill"):
            undistort_image(np.zeros((50, 70, *shape), np.uint8), undistort, fill=wrong)


def test_a_colour_without_an_alpha_fills_with_nothing():
    """Three values for a picture of colours and an alpha: the alpha is 0 where nothing is seen; other channels need four."""
    camera = Camera((70, 50), [[60, 0, 34.5], [0, 60, 24.5], [0, 0, 1]])
    undistort = undistort_map(camera, Camera((70, 50), [[60, 0, 5], [0, 60, 24.5], [0, 0, 1]]))
    image = np.full((50, 70, 4), 200, np.uint8)
    result = undistort_image(image, undistort, fill=(1, 2, 3))
    assert (result[:, 41:] == (1, 2, 3, 0)).all()
    assert (result[:, :40] == 200).all()
    with pytest.raises(InputError, match="got 3 numbers, expected one whole number from 0 to 255, or 4 of them"):
        undistort_image(image, undistort, fill=(1, 2, 3), alpha=False)


def test_fill_of_floats_may_be_nan():
    """NaN marks pixels that see nothing, and no valid pixel takes it in; NaN of the source stays near where it was."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera, 1.0))
    valid = valid_mask(undistort) > 0
    image = noise((480, 640), np.float32)
    np.testing.assert_array_equal(np.isnan(undistort_image(image, undistort, fill=float("nan"))), ~valid)
    image[200, 300] = np.nan
    spoilt = np.isnan(undistort_image(image, undistort)) & valid
    map_x, map_y = dense_map(undistort)
    assert spoilt.any()
    assert (np.maximum(np.abs(map_x - 300), np.abs(map_y - 200))[spoilt] <= 1 + COORDINATE_PX).all()


def test_transparent_pixels_do_not_bleed():
    """Half a pixel between opaque blue and transparent red is blue, half transparent; without alpha it is purple."""
    source, target = shifted_pair((40, 30), (0.5, 0.0))
    undistort = undistort_map(source, target)
    image = np.zeros((30, 40, 4), np.uint8)
    image[:, :20] = 255, 0, 0, 255
    image[:, 20:] = 0, 0, 255, 0
    between = undistort_image(image, undistort)[10, 19].tolist()
    assert between[:3] == [255, 0, 0]
    assert between[3] in (127, 128)
    assert undistort_image(image, undistort)[10, 30].tolist() == [0, 0, 0, 0]
    bled = undistort_image(image, undistort, alpha=False)[10, 19].tolist()
    assert bled[0] in (127, 128)
    assert bled[2] in (127, 128)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_alpha_with_gray(dtype):
    """Two channels: a light value of full opacity beside a dark one of a third counts three times as much."""
    source, target = shifted_pair((40, 30), (0.5, 0.0))
    image = np.zeros((30, 40, 2), dtype)
    image[:, :20] = 200, 240
    image[:, 20:] = 100, 80
    gray, opacity = undistort_image(image, undistort_map(source, target))[10, 19].tolist()
    assert gray == pytest.approx(175, abs=1e-4)
    assert opacity == pytest.approx(160, abs=1e-4)


@pytest.mark.parametrize(
    ("gamma", "expected"),
    # Half the light of white: 1.055 0.5^(1 / 2.4) - 0.055 = 0.735357; 0.5^(1 / 2.2) = 0.729740; and plain averages.
    [("srgb", 0.735357), (2.2, 0.729740), (1.0, 0.5), (None, 0.5)],
)
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_linear_light_by_hand(dtype, gamma, expected):
    """Half a pixel between black and white, alone and in colour; alpha has no curve."""
    source, target = shifted_pair((40, 30), (0.5, 0.0))
    undistort = undistort_map(source, target)
    full = 1.0 if dtype == np.float32 else np.iinfo(dtype).max
    rounding = 1e-5 if dtype == np.float32 else 0.51
    for channels in ((), (3,), (4,)):
        image = np.zeros((30, 40, *channels), dtype)
        image[:, 20:] = full
        result = undistort_image(image, undistort, gamma=gamma, alpha=False)
        np.testing.assert_allclose(result[10, 19], expected * full, atol=rounding + 1e-5 * full)
        assert (result[:, :19] == 0).all()
        np.testing.assert_allclose(result[:, 20:39], full, atol=rounding)
    image[..., 3] = full
    image[:, :20, 3] = full / 2
    assert undistort_image(image, undistort, gamma=gamma)[10, 19, 3] == pytest.approx(0.75 * full, rel=0.01)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_light_and_back_is_every_value(dtype):
    """Decoding and encoding returns every pixel value of either depth."""
    camera = Camera((256, 256), [[100, 0, 127.5], [0, 100, 127.5], [0, 0, 1]])
    image = np.arange(65536).reshape(256, 256).astype(dtype)
    for gamma in ("srgb", 2.2):
        np.testing.assert_array_equal(undistort_image(image, undistort_map(camera, camera), gamma=gamma), image)


def test_options_are_checked():
    """Unknown interpolations and curves."""
    source, target = shifted_pair((40, 30), (0.5, 0.0))
    image, undistort = np.zeros((30, 40), np.uint8), undistort_map(source, target)
    with pytest.raises(InputError, match="--interpolation: unknown"):
        undistort_image(image, undistort, interpolation="nearest")
    for curve in ("rec709", 0, 20, float("nan")):
        with pytest.raises(InputError, match="--gamma"):
            undistort_image(image, undistort, gamma=curve)


def test_wrong_images_are_refused():
    """Another size than the camera's, a dtype or a number of channels that is no image."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera))
    with pytest.raises(ValueError, match="wrong size"):
        undistort_image(np.zeros((10, 10), np.uint8), undistort)
    with pytest.raises(ValueError, match="not an image"):
        undistort_image(np.zeros((480, 640), np.float64), undistort)
    with pytest.raises(ValueError, match="too many channels"):
        undistort_image(np.zeros((480, 640, 5), np.uint8), undistort)


def test_result_into_a_buffer():
    """The buffer is written and returned, also one with gaps between its rows; the same bytes as without."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera, 1.0))
    image = noise((480, 640, 3), np.uint8)
    expected = undistort_image(image, undistort, fill=7)
    frame = np.zeros((480, 672, 3), np.uint8)
    view = frame[:, :640]
    assert undistort_image(image, undistort, fill=7, out=view) is view
    np.testing.assert_array_equal(view, expected)
    assert (frame[:, 640:] == 0).all()


def test_wrong_buffers_are_refused():
    """Another shape or dtype, gaps between pixels, read-only, the image itself."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera))
    image = np.zeros((480, 640, 3), np.uint8)
    fixed = np.zeros_like(image)
    fixed.flags.writeable = False
    for out in (np.zeros((480, 640), np.uint8), np.zeros((480, 640, 3), np.uint16)):
        with pytest.raises(ValueError, match="out: wrong"):
            undistort_image(image, undistort, out=out)
    for out in (np.zeros((480, 640, 4), np.uint8)[..., :3], np.zeros((480, 640, 3), np.uint8)[..., ::-1], fixed, image):
        with pytest.raises(ValueError, match="cannot be written"):
            undistort_image(image, undistort, out=out)


def test_sources_of_any_layout():
    """RGB views of BGR arrays, every other row, arrays upside down: read as they are meant."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera))
    image = noise((480, 640, 3), np.uint8)
    for view in (image[..., ::-1], image[::-1], np.repeat(image, 2, axis=0)[::2], np.asfortranarray(image)):
        expected = undistort_image(np.ascontiguousarray(view), undistort)
        np.testing.assert_array_equal(undistort_image(view, undistort), expected)
