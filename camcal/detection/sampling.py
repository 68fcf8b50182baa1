"""Images as detection wants them: 8-bit gray, reduced copies, and grey values between the pixels."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import FloatArray
from camcal.observations import Image

Gray = npt.NDArray[np.uint8]
"""An 8-bit gray image of shape (height, width)."""

_STRETCH_PERCENTILES = (0.05, 99.95)
_STRETCH_PIXELS = 250_000


def gray8(image: Image) -> Gray:
    """Turn any image into 8-bit gray; 16-bit and float images are stretched to their own range.

    Parameters
    ----------
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float; 1, 3 (BGR) or 4 (BGRA) channels, as OpenCV reads them. NaN counts as black.

    Returns
    -------
    ndarray of shape (height, width)
        uint8, contiguous.

    Raises
    ------
    ValueError
        If it is no image of these kinds.
    """
    if image.ndim not in {2, 3} or image.size == 0 or (image.ndim == 3 and image.shape[2] not in {1, 3, 4}):
        raise ValueError(f"image: not one that can be read as gray (got shape {image.shape}, expected 1, 3 or 4 channels)")
    is_float = np.issubdtype(image.dtype, np.floating)
    if not is_float and image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"image: unknown pixels (got {image.dtype}, expected uint8, uint16 or float)")
    pixels = np.nan_to_num(image.astype(np.float32), posinf=0.0, neginf=0.0) if is_float else image
    gray = _one_channel(np.ascontiguousarray(pixels))
    return gray if gray.dtype == np.uint8 else _stretched(gray)


def _one_channel(pixels: Image) -> Image:
    if pixels.ndim == 2:
        return pixels
    if pixels.shape[2] == 1:
        return np.ascontiguousarray(pixels[:, :, 0])
    return cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY if pixels.shape[2] == 3 else cv2.COLOR_BGRA2GRAY)


def _stretched(gray: Image) -> Gray:
    """Map the image's own range, but for a few stray pixels, to 0..255."""
    step = max(1, int(np.sqrt(gray.size / _STRETCH_PIXELS)))
    low, high = np.percentile(gray[::step, ::step], _STRETCH_PERCENTILES)
    gain = 255.0 / max(float(high - low), float(np.finfo(np.float32).tiny))
    stretched = (gray.astype(np.float32) - np.float32(low)) * np.float32(gain)
    result: Gray = np.clip(np.rint(stretched), 0, 255).astype(np.uint8)
    return result


@dataclass(frozen=True, slots=True, eq=False)
class Reduced:
    """A smaller (or enlarged) copy of an image, and the way back to the full one.

    Attributes
    ----------
    gray : ndarray of shape (height, width)
        uint8; the image itself where it is small enough.
    scale : ndarray of shape (2,)
        Reduced size over full size, along x and y.
    """

    gray: Gray
    scale: FloatArray

    def to_full(self, points_px: FloatArray) -> FloatArray:
        """Pixels (..., 2) of the reduced image as pixels of the full one."""
        full: FloatArray = (points_px + 0.5) / self.scale - 0.5
        return full

    def from_full(self, points_px: FloatArray) -> FloatArray:
        """Pixels (..., 2) of the full image as pixels of the reduced one."""
        small: FloatArray = (points_px + 0.5) * self.scale - 0.5
        return small


def reduced(gray: Gray, longest_px: float, most_enlarged: float = 1.0) -> Reduced:
    """Shrink an image until its longer side is at most `longest_px`, or enlarge it up to there (`most_enlarged` times at most).

    Halving by averaging is twenty times faster than averaging over any other ratio, so the image is halved as often as
    possible and then interpolated; an odd row or column at the end is left out.
    """
    small, scale = gray, np.ones(2)
    while max(small.shape) >= 2 * longest_px:
        height, width = (n // 2 for n in small.shape)
        small = _resized(small[: 2 * height, : 2 * width], (width, height), cv2.INTER_AREA)
        scale = scale / 2
    factor = min(longest_px / max(small.shape), most_enlarged)
    if factor != 1:
        height, width = small.shape
        size = (max(1, round(width * factor)), max(1, round(height * factor)))
        small = _resized(small, size, cv2.INTER_LINEAR if factor < 1 else cv2.INTER_CUBIC)
        scale = scale * size / np.array([width, height])
    return Reduced(small, scale)


def _resized(gray: Gray, size: tuple[int, int], interpolation: int) -> Gray:
    resized: Gray = cv2.resize(gray, size, interpolation=interpolation).astype(np.uint8, copy=False)
    return resized


def sample(gray: Gray, points_px: FloatArray) -> npt.NDArray[np.float32]:
    """Grey values between the pixels, bilinear.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    points_px : ndarray of shape (..., 2)
        Where to look.

    Returns
    -------
    ndarray of shape (...)
        float32; NaN outside the image.
    """
    height, width = gray.shape
    flat = points_px.reshape(-1, points_px.shape[-2] if points_px.ndim > 1 else 1, 2).astype(np.float32)
    x, y = flat[..., 0], flat[..., 1]
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    values = np.full(inside.shape, np.nan, dtype=np.float32)
    if inside.any():
        # Integer neighbours and weights by hand: cv2.remap limits the number of points and rounds their positions.
        xi, yi = x[inside], y[inside]
        left, top = np.minimum(xi.astype(np.intp), max(width - 2, 0)), np.minimum(yi.astype(np.intp), max(height - 2, 0))
        fx, fy = xi - left, yi - top
        right, bottom = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
        upper = gray[top, left] * (1 - fx) + gray[top, right] * fx
        lower = gray[bottom, left] * (1 - fx) + gray[bottom, right] * fx
        values[inside] = upper * (1 - fy) + lower * fy
    return values.reshape(points_px.shape[:-1])
