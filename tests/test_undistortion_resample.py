"""Images through maps: interpolation by its formula, in every depth and number of channels."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from undistortion_scenes import COORDINATE_PX, bilinear, camera_of, noise, pixel_grid, seen_by, shifted_pair, steepest

from camcal.geometry.camera import Camera
from camcal.undistortion.maps import distort_map, undistort_image, undistort_map, valid_mask
from camcal.undistortion.target import target_camera


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [(), (1,), (2,), (3,), (4,)])
def test_linear_is_the_formula(dtype, channels):
    """Every valid pixel is the bilinear mean at the exact coordinates; what rounds is the coordinates and the result."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera, 1.0))
    image = noise((480, 640, *channels), dtype)
    valid = valid_mask(undistort) > 0
    result = undistort_image(image, undistort, fill=1, alpha=False)
    expected = bilinear(image, np.nan_to_num(seen_by(camera, undistort.target)))
    rounding = 1e-6 if dtype == np.float32 else 0.51
    assert result.dtype == dtype
    assert np.abs(result.astype(np.float64) - expected)[valid].max() <= rounding + 2 * COORDINATE_PX * steepest(image)
    assert (result[~valid] == 1).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("interpolation", ["linear", "cubic", "lanczos"])
def test_constant_images_stay_what_they_are(dtype, interpolation):
    """Gray and colour of one value keep it; pixels that see nothing are filled; twice over in one call and in two."""
    camera = camera_of("tangential fold")
    undistort = undistort_map(camera, target_camera(camera, 1.0))
    valid = valid_mask(undistort) > 0
    for shape in ((480, 640), (480, 640, 3), (480, 640, 4)):
        result = undistort_image(np.full(shape, 77, dtype), undistort, interpolation=interpolation, fill=5)
        assert result.shape == (*valid.shape, *shape[2:])
        # A float32 sum of some thirty weights that make 1.
        np.testing.assert_allclose(result[valid], 77, rtol=1e-5)
        assert (result[~valid] == 5).all()


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "lanczos"])
def test_no_distortion_changes_no_byte(interpolation):
    """The map of a pinhole to itself returns the image, bit for bit."""
    camera = Camera((64, 48), [[50, 0, 31], [0, 50, 24], [0, 0, 1]])
    undistort = undistort_map(camera, camera)
    image = np.random.default_rng(0).integers(0, 256, (48, 64, 3), dtype=np.uint8)
    np.testing.assert_array_equal(undistort_image(image, undistort, interpolation=interpolation), image)


def test_cubic_is_the_spline():
    """SciPy's cubic spline through the pixels, mirrored at the border, at the exact coordinates, up to the very rim."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera))
    image = noise((480, 640), np.float32)
    seen = seen_by(camera, undistort.target)
    expected = map_coordinates(image.astype(np.float64), [seen[..., 1], seen[..., 0]], order=3, mode="mirror")
    # Pixels of noise of this blur differ by less than 0.4; the prefilter leaves out 1.4e-6, float32 rounds by 1e-6.
    assert steepest(image) < 0.4
    result = undistort_image(image, undistort, interpolation="cubic")
    assert np.abs(result - expected).max() <= 2 * COORDINATE_PX * 0.4 + 1e-5


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "lanczos"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_channels_are_resampled_alike(dtype, interpolation):
    """Each channel of two, three and four is what it is alone, to the last bits of float32."""
    camera = camera_of("tangential")
    undistort = undistort_map(camera, target_camera(camera, 0.5))
    image = noise((480, 640, 4), dtype)
    for count in (2, 3, 4):
        together = undistort_image(image[..., :count], undistort, interpolation=interpolation, alpha=False)
        for channel in range(count):
            alone = undistort_image(np.ascontiguousarray(image[..., channel]), undistort, interpolation=interpolation)
            # A sum that falls on half a level may be rounded either way.
            off = np.abs(together[..., channel].astype(np.float64) - alone)
            assert off.max() <= (1e-6 if dtype == np.float32 else 1)
            assert dtype == np.float32 or (off > 0).mean() < 1e-3


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "lanczos"])
def test_ramps_are_kept(interpolation):
    """The value of a ramp is the coordinate itself: off by no more than the map, away from the border."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera))
    ramp = np.ascontiguousarray(pixel_grid(camera.size)[..., 0], dtype=np.float32)
    seen = seen_by(camera, undistort.target)[..., 0]
    inside = np.abs(seen - 319.5) < 290
    result = undistort_image(ramp, undistort, interpolation=interpolation)
    # float32 holds 640 to 3e-5, and sums of thirty such to a few times that.
    assert np.abs(result - seen)[inside].max() <= COORDINATE_PX + 3e-4


def wave_errors(frequency: float, shift: float) -> dict[str, float]:
    """What each interpolation errs on a wave (cycles per pixel) moved by a shift, as a share of it, by their formulas.

    An interpolation of weights w_k turns exp(iωx) into itself times G = Σ w_k exp(iωk), which should be exp(iωt). The
    spline divides that by what the prefilter undoes, (4 + 2 cos ω) / 6. Lanczos's kernel errs where it makes half pixels,
    and the spline through those once more.
    """

    def gain(weights: list[float], first: int, omega: float) -> complex:
        return sum(w * np.exp(1j * omega * (first + k)) for k, w in enumerate(weights))

    def spline_error(omega: float, t: float) -> float:
        weights = [(1 - t) ** 3 / 6, 2 / 3 - t * t + t**3 / 2, 2 / 3 - (1 - t) ** 2 + (1 - t) ** 3 / 2, t**3 / 6]
        return abs(gain(weights, -1, omega) / ((4 + 2 * np.cos(omega)) / 6) - np.exp(1j * omega * t))

    omega = 2 * np.pi * frequency
    away = np.arange(12) - 5.5
    taps = np.sinc(away) * np.sinc(away / 6)
    between = abs(1 - (taps * np.cos(omega * away)).sum() / taps.sum())
    linear = abs(gain([1 - shift, shift], 0, omega) - np.exp(1j * omega * shift))
    return {
        "linear": linear,
        "cubic": spline_error(omega, shift),
        "lanczos": between + spline_error(omega / 2, 2 * shift % 1),
    }


@pytest.mark.parametrize("frequency", [0.05, 0.1, 0.2, 0.3])
@pytest.mark.parametrize("along", [0, 1])
def test_waves_err_as_the_formulas_say(frequency, along):
    """Linear and cubic to 1 %, Lanczos at most that; and up to waves of five pixels cubic errs a tenth of linear or less."""
    shift = 0.37
    source, target = shifted_pair((200, 200), (shift, 0.0) if along == 0 else (0.0, shift))
    position = pixel_grid(source.size)[..., along]
    wave, true = np.cos(2 * np.pi * frequency * position), np.cos(2 * np.pi * frequency * (position + shift))
    expected = wave_errors(frequency, shift)
    for interpolation, share in expected.items():
        result = undistort_image(wave.astype(np.float32), undistort_map(source, target), interpolation=interpolation)
        error = np.sqrt(((result - true)[20:-20, 20:-20] ** 2).mean() / 0.5)
        # Coordinates and float32 add up to a few times 1e-6.
        assert error <= 1.01 * share + 5e-6
        assert interpolation == "lanczos" or error >= 0.99 * share - 5e-6
    assert frequency > 0.2 or expected["cubic"] < 0.1 * expected["linear"]


def test_small_results_do_not_alias():
    """A wave of 2.5 pixels, shown at a quarter: too fine to be seen, so its mean is left and no moiré."""
    camera = Camera((400, 400), [[300, 0, 199.5], [0, 300, 199.5], [0, 0, 1]])
    quarter = camera.scaled((100, 100))
    wave = 128 + 100 * np.cos(2 * np.pi * 0.4 * pixel_grid(camera.size)[..., 0])
    undistort = undistort_map(camera, quarter)
    assert undistort.samples == 4
    seen = undistort_image(wave.astype(np.float32), undistort)[1:-1, 1:-1]
    # The mean of 4 pixels passes sin(0.4 π 4) / (4 sin(0.4 π)) = 25 % of it: no more than the source's own pixels would give.
    assert np.abs(seen - 128).max() <= 100 * abs(np.sin(1.6 * np.pi) / (4 * np.sin(0.4 * np.pi))) + 0.1
    one_sample = undistort_image(wave.astype(np.float32), undistort_map(camera, quarter, samples=1))
    assert np.abs(one_sample - 128).max() > 29


def test_there_and_back():
    """Adding the lens again returns a smooth image, as far as the undistorted one shows it."""
    camera = camera_of("barrel")
    target = target_camera(camera, 1.0)
    image = cv2.GaussianBlur(noise((480, 640), np.float32), (0, 0), 4)
    undistorted = undistort_image(image, undistort_map(camera, target), interpolation="cubic", fill=float("nan"))
    again = undistort_image(np.nan_to_num(undistorted), distort_map(camera, target), interpolation="cubic")
    # Twelve pixels from where nothing was seen, the filled ones no longer ring.
    known = cv2.erode(
        undistort_image(np.isfinite(undistorted).astype(np.float32), distort_map(camera, target)), np.ones((33, 33))
    )
    assert (known == 1).mean() > 0.7
    assert np.abs(again - image)[known == 1].max() < 1e-4 * np.ptp(image)


def test_many_columns():
    """An image wider than OpenCV's own remap takes."""
    K = [[20_000, 0, 19_999.5], [0, 20_000, 15.5], [0, 0, 1]]
    camera = Camera((40_000, 32), K, [-0.001])
    undistort = undistort_map(camera, Camera((40_000, 32), K))
    image = noise((32, 40_000), np.uint8)
    seen = seen_by(camera, undistort.target)
    result = undistort_image(image, undistort)
    valid = valid_mask(undistort) > 0
    assert np.abs(result - bilinear(image, np.nan_to_num(seen)))[valid].max() <= 0.51 + 2 * COORDINATE_PX * steepest(image)
