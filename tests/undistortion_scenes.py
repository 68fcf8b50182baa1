"""Lenses, cameras and arithmetic that the tests of undistortion share."""

from __future__ import annotations

import cv2
import numpy as np

from camcal.geometry.camera import Camera

LENSES = {
    "barrel": [-0.25, 0.08, 0, 0, -0.01],
    "pincushion": [0.2, 0.05],
    "wide": [-0.38, 0.15, 0, 0, -0.02],
    "tangential": [-0.2, 0.05, 0.002, -0.003, 0],
    "rational": [0.2, 0.05, 0, 0, 0, 0.5, 0.3, 0.1],
    "fold": [-0.6, 0.1],
    "tangential fold": [-0.6, 0.1, 0.01, -0.008],
}
FOLDED = ("rational", "fold", "tangential fold")
"""Lenses that turn back within the image, the first only just."""
COORDINATE_PX = 2.5e-4
"""How far a map's coordinates may be from the float64 model."""


def camera_of(lens: str, size: tuple[int, int] = (640, 480)) -> Camera:
    """A camera behind one of the lenses, with a focal length of 420 pixels at 640x480 and the centre a little off."""
    factor = size[0] / 640
    K = [[420 * factor, 0, 322.3 * factor], [0, 424 * factor, 236.1 * factor], [0, 0, 1]]
    return Camera(size, K, LENSES[lens])


def pixel_grid(size: tuple[int, int]) -> np.ndarray:
    """Coordinates (height, width, 2) of every pixel."""
    return np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), axis=-1).astype(np.float64)


def seen_by(source: Camera, target: Camera) -> np.ndarray:
    """Source coordinates (height, width, 2) of every pixel of the target by the float64 model; NaN where nothing is seen."""
    return source.project(target.unproject(pixel_grid(target.size)))


def lies_within(coordinates: np.ndarray, size: tuple[int, int], slack_px: float = 0.0) -> np.ndarray:
    """Which coordinates lie between the outermost pixel centres, give or take the slack."""
    return ((coordinates >= -slack_px) & (coordinates <= np.array(size) - 1 + slack_px)).all(axis=-1)


def bilinear(image: np.ndarray, coordinates: np.ndarray) -> np.ndarray:
    """Linear interpolation in float64 by its formula, at coordinates (..., 2) that must lie within the image."""
    height, width = image.shape[:2]
    x, y = np.clip(coordinates[..., 0], 0, width - 1), np.clip(coordinates[..., 1], 0, height - 1)
    left, top = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    shape = x.shape + (1,) * (image.ndim - 2)
    a, b = (x - left).reshape(shape), (y - top).reshape(shape)
    pixels = image.astype(np.float64)
    upper = (1 - a) * pixels[top, left] + a * pixels[top, left + 1]
    lower = (1 - a) * pixels[top + 1, left] + a * pixels[top + 1, left + 1]
    return (1 - b) * upper + b * lower


def shifted_pair(size: tuple[int, int], by: tuple[float, float]) -> tuple[Camera, Camera]:
    """Two pinhole cameras: pixel (u, v) of the second sees what (u, v) + by of the first sees."""
    K = np.array([[100.0, 0, 10], [0, 100, 10], [0, 0, 1]])
    moved = K.copy()
    moved[:2, 2] -= by
    return Camera(size, K), Camera(size, moved)


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
