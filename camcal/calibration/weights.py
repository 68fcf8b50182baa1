"""How much each corner counts: by its own standard deviation, and by one that all corners have in common.

A corner's own standard deviation comes from the noise of its pixels. What bends the board, the lens model or the print
adds to it, alike for every corner, and is often the larger part: weighing by the pixel noise alone would then give a few
sharp corners all the say.
"""

from __future__ import annotations

import numpy as np

from camcal.geometry.arrays import FloatArray

_HALVINGS = 60
_LEAST_SIGMA_PX, _LARGEST_SIGMA_PX = 1e-9, 1e9


def total_sigma_px(sigma_px: FloatArray, residual_px: FloatArray, unknowns: int) -> FloatArray | None:
    """Standard deviation of every corner, with the part that the residuals show all to have in common.

    Parameters
    ----------
    sigma_px : ndarray of shape (M,)
        Each corner's own per axis, pixels; NaN where it is not known.
    residual_px : ndarray of shape (M, 2)
        Seen minus projected corners, pixels.
    unknowns : int
        Number of parameters that were solved for.

    Returns
    -------
    ndarray of shape (M,) or None
        sqrt(sigma² + tau²) per axis in pixels, where tau makes the weighted sum of squares equal to its degrees of freedom
        (or is 0 if the corners scatter less than they claim). A corner without a known sigma gets the median one. None if
        no corner's sigma is known.
    """
    variance = own_variance(sigma_px)
    if variance is None:
        return None
    squares = (residual_px**2).sum(axis=1)
    freedom = max(1, residual_px.size - unknowns)

    def scatter(common: float) -> float:
        return float((squares / (variance + common)).sum())

    low, high = 0.0, float(squares.max())
    if scatter(low) > freedom:
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if scatter(middle) > freedom else (low, middle)
    total: FloatArray = np.sqrt(variance + low)
    return total


def own_variance(sigma_px: FloatArray) -> FloatArray | None:
    """Variance (M,) that each corner knows of, px²; the median one where it knows none; None if no corner does."""
    known = np.isfinite(sigma_px) & (sigma_px > 0)
    if not known.any():
        return None
    # Kept within what can be squared; a corner that claims less than a billionth of a pixel is no better for it.
    sigma = np.where(known, sigma_px, np.median(sigma_px[known]))
    variance: FloatArray = np.clip(sigma, _LEAST_SIGMA_PX, _LARGEST_SIGMA_PX) ** 2
    return variance
