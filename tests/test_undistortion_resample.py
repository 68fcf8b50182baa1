"""Images through maps: interpolation by its formula, depths and channels, fill, alpha, light, buffers."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from undistortion_scenes import bilinear, camera_of, pixel_grid, seen_by, shifted_pair

from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.undistortion.maps import dense_map, distort_map, undistort_image, undistort_map, valid_mask
from camcal.undistortion.target import target_camera

COORDINATE_PX = 2.5e-4
"""How far a map's coordinates may be from the float64 model."""


def noise(shape: tuple[int, ...], dtype, seed: int = 0) -> np.ndarray:
    """Blurred noise over most of the range of a dtype (0..1 for floats)."""
    rng = np.random.default_rng(seed)
    smooth = cv2.GaussianBlur(rng.normal(size=shape), (0, 0), 1.5)
    share = 0.5 + 0.15 * smooth / smooth.std()
    full = 1.0 if dtype == np.float32 else np.iinfo(dtype).max
    return np.clip(full * share, 0, full).astype(dtype)


def steepest(image: np.ndarray) -> float:
    """Largest difference between neighbouring pixels along an axis."""
    pixels = image.astype(np.float64)
    return float(max(np.abs(np.diff(pixels, axis=0)).max(), np.abs(np.diff(pixels, axis=1)).max()))


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
