"""How much each corner counts: by its own standard deviation, and by one that all corners have in common.

A corner's own standard deviation comes from the noise of its pixels. What bends the board, the lens model or the print
adds to it, alike for every corner, and is often the larger part: weighing by the pixel noise alone would then give a few
sharp corners all the say.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camcal.geometry.arrays import FloatArray
from camcal.observations import Detection

_HALVINGS = 60
_LEAST_SIGMA_PX, _LARGEST_SIGMA_PX = 1e-9, 1e9


def total_sigma_px(detections: Sequence[Detection], residual_px: FloatArray, unknowns: int) -> FloatArray | None:
    """Standard deviation of every corner, with the part that the residuals show all to have in common.

    Parameters
    ----------
    detections : sequence of Detection
    residual_px : ndarray of shape (M, 2)
        Seen minus projected corners of all of them, solved with equal weights, pixels.
    unknowns : int
        Number of parameters that were solved for.

    Returns
    -------
    ndarray of shape (M,) or None
        sqrt(sigma² + tau²) per axis in pixels, where tau makes the weighted sum of squares equal to its degrees of freedom
        (or is 0 if the corners scatter less than they claim). A corner without a known sigma gets the median one. None if
        no corner's sigma is known.
    """
    sigma = np.concatenate([detection.sigma_px for detection in detections])
    known = np.isfinite(sigma) & (sigma > 0)
    if not known.any():
        return None
    # Kept within what can be squared; a corner that claims less than a billionth of a pixel is no better for it.
    variance = np.clip(np.where(known, sigma, np.median(sigma[known])), _LEAST_SIGMA_PX, _LARGEST_SIGMA_PX) ** 2
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
