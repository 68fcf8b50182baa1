"""Point spread functions on a pixel grid: what blurs an image that is already sampled finely enough."""

from __future__ import annotations

import cv2
import numpy as np

from camcal.geometry.arrays import FloatArray

_TAIL_SIGMAS = 4.5
_DISC_SAMPLES = 33
# Second derivative to tenth order in the pixel grid (Fornberg 1988, table 1): a sharpened image is rich in fine detail.
_HALF = (1 / 3150, -5 / 1008, 5 / 126, -5 / 21, 5 / 3)
_CURVATURE = np.array([*_HALF, -5269 / 1800, *_HALF[::-1]])
_ONE = np.ones(1)
_LEAST_OVERSHOOT = -0.01


def gaussian_blur(image: FloatArray, sigma_px: float) -> FloatArray:
    """Blur by a sampled Gaussian; exact if the image holds no detail beyond the pixel grid's Nyquist frequency.

    Parameters
    ----------
    image : ndarray of shape (height, width)
        float64; `gaussian_margin(sigma_px)` pixels along its border are not valid afterwards.
    sigma_px : float
        Standard deviation in pixels, >= 1.
    """
    reach = gaussian_margin(sigma_px)
    taps = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma_px) ** 2)
    taps /= taps.sum()
    return np.asarray(cv2.sepFilter2D(image, -1, taps, taps), dtype=np.float64)


def gaussian_margin(sigma_px: float) -> int:
    """Half-width of the Gaussian that `gaussian_blur` uses, in pixels."""
    return int(np.ceil(_TAIL_SIGMAS * sigma_px))


def disc_blur(image: FloatArray, radius_px: float) -> FloatArray:
    """Blur by a uniform disc, each tap weighted by the area of the disc in its pixel.

    Parameters
    ----------
    image : ndarray of shape (height, width)
        float64; `disc_margin(radius_px)` pixels along its border are not valid afterwards.
    radius_px : float
        Radius in pixels, > 0.
    """
    return np.asarray(cv2.filter2D(image, -1, disc_kernel(radius_px)), dtype=np.float64)


def disc_margin(radius_px: float) -> int:
    """Half-width of the kernel that `disc_blur` uses, in pixels."""
    return int(np.ceil(radius_px + 0.5))


def disc_kernel(radius_px: float) -> FloatArray:
    """Share of a disc's area in each pixel around its centre.

    The disc is drawn slightly too small: collecting its light at pixel centres widens it by 1/12 px² per axis (Sheppard's
    correction), and a disc of radius R has the variance R² / 4.

    Returns
    -------
    ndarray of shape (2 M + 1, 2 M + 1)
        Sums to 1; M = `disc_margin(radius_px)`.
    """
    drawn = np.sqrt(max(radius_px**2 - 1 / 3, 1e-6))
    reach = disc_margin(radius_px)
    count = 2 * reach + 1
    at = (np.arange(count * _DISC_SAMPLES) + 0.5) / _DISC_SAMPLES - reach - 0.5
    # The height of the disc above each sampled column is exact; the rows' borders cut it.
    half = np.sqrt(np.maximum(drawn**2 - at**2, 0))
    rows = np.arange(-reach, reach + 1)[:, None]
    covered = np.clip(np.minimum(rows + 0.5, half) - np.maximum(rows - 0.5, -half), 0, None)
    kernel = covered.reshape(count, count, _DISC_SAMPLES).sum(axis=-1)
    share: FloatArray = kernel / kernel.sum()
    return share


def sharpened(image: FloatArray, blur_sigma_px: float, overshoot: float) -> FloatArray:
    """Add to a blurred image what a camera's sharpening adds to its edges: a fringe on both sides.

    An edge Φ(a), a the distance over the blur, becomes Φ(a) + overshoot / 2 He3(a) φ(a). As He3 φ is the fourth derivative of
    -Φ, that is the image plus -overshoot / 2 blur⁴ times its bi-Laplacian, which treats edges of every direction alike.

    Parameters
    ----------
    image : ndarray of shape (height, width)
        float64.
    blur_sigma_px : float
        Standard deviation of the image's blur, the pixel's area included; px.
    overshoot : float
        Below 0; above -0.01, which is less than half a per cent of the contrast, the image is returned as it is.
    """
    if overshoot > _LEAST_OVERSHOOT:
        return image
    return image - 0.5 * overshoot * blur_sigma_px**4 * _laplacian(_laplacian(image))


def _laplacian(image: FloatArray) -> FloatArray:
    """Sum of both second derivatives, in 1/px²."""
    along_x, along_y = (cv2.sepFilter2D(image, -1, *taps) for taps in ((_CURVATURE, _ONE), (_ONE, _CURVATURE)))
    return np.asarray(along_x + along_y, dtype=np.float64)
