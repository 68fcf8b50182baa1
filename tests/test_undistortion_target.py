"""The camera of the undistorted image: what alpha promises, pixel by pixel, and sizes, fields of view and crops."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import CAMERA
from undistortion_scenes import FOLDED, LENSES, camera_of, lies_within, pixel_grid, seen_by

from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.undistortion.maps import undistort_map
from camcal.undistortion.target import target_camera

# A frame that touches the rim is told from one that crosses it up to this; rounding in float64 is a thousand times less.
ROUNDING_PX = 1e-8


def widened(camera: Camera, factor: float, shift: tuple[float, float] = (0.0, 0.0)) -> Camera:
    """The pinhole that shows `factor` times as much, around a centre moved by shift times half the frame."""
    width, height = camera.size
    K = camera.K.copy()
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    K[[0, 1], [0, 1]] /= factor
    K[:2, 2] = middle + (K[:2, 2] - middle) / factor - np.array(shift) * middle
    return Camera(camera.size, K)


def rim_is_valid(camera: Camera, target: Camera) -> bool:
    """Whether the outermost pixels of the target all look between the source's outermost pixel centres."""
    pixels = pixel_grid(target.size)
    rim = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
    return bool(lies_within(camera.project(target.unproject(rim)), camera.size, ROUNDING_PX).all())


def whole_pixels_are_valid(camera: Camera, target: Camera) -> np.ndarray:
    """Whether (height, width) all samples of each pixel of the target look between the source's outermost pixel centres."""
    (width, height), n = target.size, undistort_map(camera, target).samples
    samples = target.unproject((pixel_grid((n * width, n * height)) + 0.5) / n - 0.5)
    valid = lies_within(camera.project(samples), camera.size, ROUNDING_PX)
    return valid.reshape(height, n, width, n).all(axis=(1, 3))


@pytest.mark.parametrize("lens", LENSES)
def test_alpha_zero_has_no_invalid_pixel(lens):
    """Every pixel looks between the source's outermost pixel centres, by the float64 model."""
    camera = camera_of(lens)
    assert lies_within(seen_by(camera, target_camera(camera)), camera.size, ROUNDING_PX).all()


@pytest.mark.parametrize("lens", LENSES)
def test_alpha_zero_is_the_largest_frame_around_its_centre(lens):
    """A frame that is wider by a hundredth of a pixel on each side holds an invalid pixel."""
    camera = camera_of(lens)
    wider = widened(target_camera(camera), 1 + 2 * 0.01 / camera.size[1])
    assert not rim_is_valid(camera, wider)


@pytest.mark.parametrize("lens", LENSES)
def test_alpha_zero_has_a_good_centre(lens):
    """No frame moved by 1, 3 or 10 % of its half size is valid if it is larger by as much as a move must gain, and 0.1 %."""
    camera = camera_of(lens)
    target = target_camera(camera)
    for step in (0.01, 0.03, 0.1):
        for shift in ((step, 0), (-step, 0), (0, step), (0, -step), (step, step), (step, -step), (-step, step), (-step, -step)):
            moved = widened(target, 1.001 + 0.01 * step, shift)
            assert not rim_is_valid(camera, moved), shift


@pytest.mark.parametrize("lens", LENSES)
def test_alpha_one_shows_every_source_pixel(lens):
    """Every pixel that has a ray lands between the outermost pixel centres, and one to within a pixel of two sides."""
    camera = camera_of(lens)
    target = target_camera(camera, 1.0)
    landed = target.project(camera.unproject(pixel_grid(camera.size)))
    seen = np.isfinite(landed[..., 0])
    assert seen.all() != (lens in FOLDED)
    assert lies_within(landed[seen], target.size, ROUNDING_PX).all()
    low, high = landed[seen].min(axis=0), np.array(target.size) - 1 - landed[seen].max(axis=0)
    # Next to a fold the ideal plane is stretched without bound: there the outermost pixel need not come near the frame.
    assert min((low + high).tolist()) < (2 if lens not in FOLDED else 60)


@pytest.mark.parametrize("lens", ["barrel", "fold"])
def test_alpha_in_between(lens):
    """Frames grow with alpha."""
    shown = [1 / target_camera(camera_of(lens), alpha).K[0, 0] for alpha in (0, 0.25, 0.5, 1)]
    assert np.all(np.diff(shown) > 0)


def test_principal_point_outside_the_image():
    """A crop from the side of an image: alpha 0 and 1 keep their promises."""
    whole = camera_of("barrel")
    camera = Camera((200, 300), whole.K - [[0, 0, 420], [0, 0, 100], [0, 0, 0]], whole.lens)
    assert lies_within(seen_by(camera, target_camera(camera)), camera.size, ROUNDING_PX).all()
    everything = target_camera(camera, 1.0)
    assert lies_within(everything.project(camera.unproject(pixel_grid(camera.size))), camera.size, ROUNDING_PX).all()


def test_widest_frame_is_160_degrees():
    """A camera that sees more than 80° to the side: its target stops there."""
    camera = Camera((400, 30), [[20, 0, 199.5], [0, 20, 14.5], [0, 0, 1]])
    skewed = Camera(camera.size, [[20, 1e-9, 199.5], [0, 20, 14.5], [0, 0, 1]])
    assert np.degrees(np.arctan(skewed.unproject([0, 15])[0])) < -84
    left = np.degrees(np.arctan(target_camera(skewed, 1.0, size=(400, 100)).unproject([0, 50])[0]))
    assert left == pytest.approx(-80, abs=1e-3)


def test_no_distortion_changes_nothing():
    """A pinhole is its own target; skew is taken out."""
    camera = Camera((64, 48), [[50, 0, 31], [0, 50, 24], [0, 0, 1]])
    assert target_camera(camera) is camera
    skewed = Camera((64, 48), [[50, 3, 31], [0, 50, 24], [0, 0, 1]])
    assert target_camera(skewed).K[0, 1] == 0


def test_field_of_view_by_hand():
    """90° across 1000 pixels is a focal length of 500; the pixel aspect stays, the optical axis is in the middle."""
    camera = Camera((1000, 800), [[900, 0, 480], [0, 450, 410], [0, 0, 1]], [-0.2])
    target = target_camera(camera, fov_deg=90)
    np.testing.assert_allclose(target.K, [[500, 0, 499.5], [0, 250, 399.5], [0, 0, 1]], rtol=1e-12)
    assert target.field_of_view_deg[0] == pytest.approx(90)


def test_size_and_scale():
    """The result has the size asked for, valid throughout; twice the scale shows the same frame by twice the pixels."""
    camera = camera_of("barrel")
    square = target_camera(camera, size=(500, 500))
    assert square.size == (500, 500)
    assert square.K[1, 1] / square.K[0, 0] == pytest.approx(424 / 420)
    assert lies_within(seen_by(camera, square), camera.size, ROUNDING_PX).all()
    double = target_camera(camera, scale=2.0)
    assert double.size == (1280, 960)
    ends = double.unproject([[0, 0], [1279, 959]]) - target_camera(camera).unproject([[0, 0], [639, 479]])
    # 1279 / 959 and 639 / 479 differ by 0.025 %: so do the frames.
    assert np.abs(ends).max() < 2.5e-4


def test_small_results_see_the_source_with_their_whole_pixels():
    """Where a pixel averages several samples, every point of its area is valid at alpha 0."""
    camera = camera_of("barrel")
    target = target_camera(camera, scale=0.25)
    edges = np.array([[-0.5, -0.5], [159.5, -0.5], [-0.5, 119.5], [159.5, 119.5], [80, -0.5], [80, 119.5]])
    assert lies_within(camera.project(target.unproject(edges)), camera.size, 0.01).all()


@pytest.mark.parametrize(("alpha", "scale"), [(1, 1), (0.5, 0.5), (0.5, 0.25), (1, 0.25)])
@pytest.mark.parametrize("lens", LENSES)
def test_crop_is_valid_and_cannot_grow(lens, alpha, scale):
    """Every pixel of the crop sees with all its samples, a row or column more does not, and its pixels are the target's."""
    camera = camera_of(lens)
    target, crop = (target_camera(camera, alpha, scale=scale, crop=crop) for crop in ("none", "valid"))
    left, top = (target.K - crop.K)[:2, 2].round().astype(int)
    np.testing.assert_allclose(target.K - crop.K, [[0, 0, left], [0, 0, top], [0, 0, 0]], atol=1e-9)
    valid = whole_pixels_are_valid(camera, target)
    right, bottom = left + crop.size[0], top + crop.size[1]
    assert valid[top:bottom, left:right].all()
    grown = [
        (top - 1, bottom, left, right),
        (top, bottom + 1, left, right),
        (top, bottom, left - 1, right),
        (top, bottom, left, right + 1),
    ]
    for t, b, lf, r in grown:
        outside = t < 0 or lf < 0 or b > valid.shape[0] or r > valid.shape[1]
        assert outside or not valid[t:b, lf:r].all()


def test_crop_by_hand():
    """A pinhole shown within a wider frame of the same focal length: the crop is the source itself."""
    camera = Camera((201, 101), [[100, 0, 100], [0, 100, 50], [0, 0, 1]])
    fov_deg = 2 * np.degrees(np.arctan(2.0))
    crop = target_camera(camera, fov_deg=fov_deg, size=(400, 300), crop="valid")
    # The frame's principal point is at (199.5, 149.5): of the pixels on half places, 200 x 100 see the source.
    assert crop.size == (200, 100)
    np.testing.assert_allclose(crop.K, [[100, 0, 99.5], [0, 100, 49.5], [0, 0, 1]], atol=1e-9)


def test_crop_at_alpha_zero_takes_nothing():
    """Where every pixel is valid, the crop is the target."""
    camera = camera_of("tangential")
    np.testing.assert_array_equal(target_camera(camera, crop="valid").K, target_camera(camera).K)
    assert target_camera(camera, crop="valid").size == camera.size


@pytest.mark.parametrize("alpha", [-0.1, 1.5, float("nan")])
def test_alpha_out_of_range(alpha):
    """Alpha lies within 0..1."""
    with pytest.raises(InputError, match="--alpha"):
        target_camera(CAMERA, alpha)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"fov_deg": 0}, "--fov: out of range"),
        ({"fov_deg": 180}, "--fov: out of range"),
        ({"fov_deg": 90, "alpha": 0.5}, "--fov and --alpha"),
        ({"size": (100, 100), "scale": 2.0}, "--size and --scale"),
        ({"size": (1, 100)}, "--size: no image size"),
        ({"size": (100, 70_000)}, "--size: no image size"),
        ({"scale": 0.0001}, "--scale: no image size"),
        ({"scale": 0}, "--scale: out of range"),
        ({"scale": float("inf")}, "--scale: out of range"),
        ({"crop": "all"}, "--crop: unknown"),
    ],
)
def test_contradictions_are_refused(options, match):
    """Values out of range and pairs that say different things."""
    with pytest.raises(InputError, match=match):
        target_camera(CAMERA, **options)


def test_nothing_valid_is_refused():
    """A lens that has folded before it reaches the image, here a corner of a larger one."""
    camera = Camera((100, 100), [[420, 0, 900], [0, 420, 900], [0, 0, 1]], [-0.6, 0.1])
    for alpha in (0.0, 1.0):
        with pytest.raises(InputError, match="no valid pixel"):
            target_camera(camera, alpha)
