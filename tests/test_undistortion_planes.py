"""Planes of YCbCr images: where chroma lies, and that resampling planes is no worse than the way through BGR."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from undistortion_scenes import LENSES, camera_of, lies_within, pixel_grid, seen_by

from camcal.undistortion.maps import UndistortMap, undistort_image, undistort_map, valid_mask
from camcal.undistortion.planes import SITINGS, plane_camera, plane_map
from camcal.undistortion.target import target_camera


@pytest.mark.parametrize(
    ("subsampling", "siting", "expected"),
    [
        # Sample i of JPEG's chroma lies between pixels 2i and 2i + 1: pixel 100 is sample (100 - 0.5) / 2 = 49.75.
        ((2, 2), "center", [49.75, 29.75]),
        ((2, 2), "left", [50, 29.75]),
        ((2, 2), "topleft", [50, 30]),
        ((2, 2), "bottom", [49.75, 29.5]),
        ((2, 1), "left", [50, 60]),
        ((4, 1), "center", [24.625, 60]),
        ((1, 1), "center", [100, 60]),
    ],
)
def test_siting_by_hand(subsampling, siting, expected):
    """Where pixel (100, 60) lies in planes of several layouts."""
    camera = camera_of("barrel")
    ray = camera.unproject([100, 60])
    np.testing.assert_allclose(plane_camera(camera, subsampling, siting).project(ray), expected, atol=1e-9)


def test_odd_sizes_round_up():
    """A JPEG of 641x479 has chroma of 321x240."""
    camera = camera_of("barrel", (641, 479))
    assert plane_camera(camera, (2, 2)).size == (321, 240)


@pytest.mark.parametrize("siting", SITINGS)
@pytest.mark.parametrize("subsampling", [(2, 2), (2, 1)])
def test_planes_stay_together(subsampling, siting):
    """Coordinates written into luma and into chroma come out where the map says, for each plane at its own samples."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera))
    chroma = plane_map(undistort, subsampling, siting)
    factor, first = np.array(subsampling), np.array(SITINGS[siting]) * (np.array(subsampling) - 1)
    at_samples = pixel_grid(chroma.source.size) * factor + first
    for axis in (0, 1):
        plane = np.ascontiguousarray(at_samples[..., axis], dtype=np.float32)
        result = undistort_image(plane, chroma)
        looked = camera.project(undistort.target.unproject(at_samples))[..., axis]
        inside = np.abs(looked - camera.size[axis] / 2) < camera.size[axis] / 2 - 2
        assert np.abs(result - looked)[inside].max() < 1e-3


@pytest.mark.parametrize("siting", SITINGS)
@pytest.mark.parametrize("lens", ["barrel", "pincushion", "wide"])
def test_samples_see_up_to_the_edges_of_the_picture(lens, siting):
    """By the model in float64: half a sample past the outermost ones, plus what a map rounds, and no farther."""
    camera = camera_of(lens, (641, 479))
    chroma = plane_map(undistort_map(camera, target_camera(camera, 1.0)), (2, 2), siting)
    looked, mask = seen_by(chroma.source, chroma.target), valid_mask(chroma) > 0
    assert mask[lies_within(looked, chroma.source.size, 0.5)].all()
    assert lies_within(looked, chroma.source.size, 0.5 + 2e-3)[mask].all()


def test_full_planes_use_the_map_itself():
    """4:4:4 needs no other map; layouts that there are not are refused."""
    camera = camera_of("barrel")
    undistort = undistort_map(camera, target_camera(camera))
    assert plane_map(undistort, (1, 1), "left") is undistort
    with pytest.raises(ValueError, match="unknown layout"):
        plane_map(undistort, (0, 2))
    with pytest.raises(ValueError, match="unknown layout"):
        plane_map(undistort, (2, 2), "right")


def by_planes(planes: list[np.ndarray], undistort: UndistortMap, siting: str = "center") -> list[np.ndarray]:
    """Y, Cb and Cr of 4:2:0 resampled each by itself."""
    chroma = plane_map(undistort, (2, 2), siting)
    return [undistort_image(plane, used) for plane, used in zip(planes, (undistort, chroma, chroma), strict=True)]


def to_planes(bgr: np.ndarray) -> list[np.ndarray]:
    """Y, Cb, Cr of JPEG (JFIF: BT.601, full range), float64."""
    blue, green, red = np.moveaxis(bgr.astype(np.float64), -1, 0)
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    return [luma, (blue - luma) / 1.772 + 128, (red - luma) / 1.402 + 128]


def to_bgr(luma: np.ndarray, cb: np.ndarray, cr: np.ndarray) -> np.ndarray:
    """The inverse, with chroma of half size brought up linearly between the samples' centres."""
    cb, cr = (cv2.resize(c.astype(np.float64), luma.shape[::-1], interpolation=cv2.INTER_LINEAR) for c in (cb, cr))
    red, blue = luma + 1.402 * (cr - 128), luma + 1.772 * (cb - 128)
    return np.stack([blue, (luma - 0.299 * red - 0.114 * blue) / 0.587, red], axis=-1)


def halved(plane: np.ndarray) -> np.ndarray:
    """Means of 2 x 2 pixels."""
    height, width = plane.shape
    return plane.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3))


def rounded(values: np.ndarray) -> np.ndarray:
    """To uint8."""
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def psnr_db(image: np.ndarray, truth: np.ndarray) -> float:
    """Peak signal-to-noise ratio for a peak of 255."""
    return float(10 * np.log10(255**2 / ((image - truth) ** 2).mean()))


@pytest.mark.parametrize("blur_px", [1.0, 3.0])
@pytest.mark.parametrize("lens", [lens for lens in LENSES if lens in ("barrel", "pincushion", "wide")])
def test_planes_are_closer_to_the_truth_than_bgr(lens, blur_px):
    """Against the float BGR of the decoded image, resampled: planes of 4:2:0 err less than 8-bit BGR put back into 4:2:0."""
    camera = camera_of(lens)
    undistort = undistort_map(camera, target_camera(camera))
    rng = np.random.default_rng(1)
    blurred = cv2.GaussianBlur(rng.normal(size=(480, 640, 3)), (0, 0), blur_px)
    luma, cb, cr = to_planes(128 + 30 * blurred / blurred.std())
    planes = [rounded(luma), rounded(halved(cb)), rounded(halved(cr))]
    decoded = to_bgr(*planes)
    truth = undistort_image(decoded.astype(np.float32), undistort).astype(np.float64)
    resampled = to_bgr(*by_planes(planes, undistort))
    luma, cb, cr = to_planes(undistort_image(rounded(decoded), undistort))
    by_bgr = to_bgr(rounded(luma), rounded(halved(cb)), rounded(halved(cr)))
    assert psnr_db(resampled, truth) > psnr_db(by_bgr, truth)
    # Chroma of a wrong siting is half a pixel off.
    wrong = to_bgr(*by_planes(planes, undistort, "bottomleft"))
    assert psnr_db(wrong, truth) < psnr_db(resampled, truth)


def test_maps_of_planes_follow_the_model():
    """The chroma map is that of its cameras, within the tolerance of every map."""
    camera = camera_of("tangential")
    chroma = plane_map(undistort_map(camera, target_camera(camera)), (2, 2), "left")
    true = seen_by(chroma.source, chroma.target)
    for tile in chroma.tiles:
        rows, columns = slice(tile.top, tile.top + tile.height), slice(tile.left, tile.left + tile.width)
        coordinates = np.moveaxis(tile.coordinates().astype(np.float64), 0, -1) + tile.window[:2]
        assert np.abs(coordinates - true[rows, columns]).max() <= 2.5e-4
