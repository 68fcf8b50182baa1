"""Corners and views that do not belong: found by how far they lie from where all the others put them.

The scale of what is usual comes from medians, so that the outliers themselves do not widen it. A view that is blurred is
judged by its own scatter: it is less exact, not wrong. So are corners as far from the middle of the image: where the lens
model falls short, it is the model that is off, not they.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from camcal.calibration.limits import OUTSTANDING_RATIO, OUTSTANDING_RMS_PX
from camcal.calibration.normal_equations import Observations, State, residuals
from camcal.calibration.views import FEWEST_CORNERS
from camcal.calibration.weights import own_variance
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.observations import Detection, Outlier

# Nothing is left out unless a corner lies beyond the first; then all beyond the second are. In two dimensions noise goes
# past 5 sigma once in 270,000 corners and past 4 once in 3,000.
_ALARM_SIGMAS = 5.0
_LIMIT_SIGMAS = 4.0
# Median of a squared distance in two dimensions, in units of the variance per axis (chi squared with 2 degrees of freedom).
_MEDIAN_CHI2 = 2 * np.log(2)
# A corner this near to its place is right, however exact the others are.
_NEAR_PX = 0.05
# Of fewer corners the median says little; such a view is judged by the scatter of all.
_FEWEST_FOR_A_SCALE = 8
# Corners at about the same distance from the principal point that share a scale.
_RING_CORNERS = 17
# If so many corners of a view are wrong it is the view that is wrong; if so many of all are, it is the model.
_LARGEST_SHARE_OF_A_VIEW = 0.3
_LARGEST_SHARE_OF_ALL = 0.2
_HALVINGS = 60
# A residual longer than any image, or behind the camera, counts as one of this length.
_LONGEST_PX = 1e6
# Made corners may be perfect: below a billionth of a pixel there is no scale.
_LEAST_VARIANCE_PX2 = 1e-18


def belonging(state: State, seen: Observations, sigma_px: FloatArray, kept: BoolArray) -> BoolArray:
    """Choose anew which corners to solve with.

    Parameters
    ----------
    state : State
        Solved with the corners that were kept.
    seen : Observations
        All corners of the views, also those that were left out.
    sigma_px : ndarray of shape (M,)
        Standard deviation of each corner per axis as far as the refinement knows it; NaN where it does not.
    kept : ndarray of shape (M,)
        The corners that the state was solved with.

    Returns
    -------
    ndarray of shape (M,)
        Everything if so many corners are off that the model must be wrong, not they.
    """
    squares, sigmas = _distances(state, seen, sigma_px, kept)
    off = (sigmas > _LIMIT_SIGMAS) & (squares > _NEAR_PX**2)
    if off.mean() > _LARGEST_SHARE_OF_ALL or (np.add.reduceat((~off).astype(int), seen.starts) < FEWEST_CORNERS).any():
        return np.ones_like(kept)
    # Once something is left out the choice is made anew, so that a corner that was wronged by an outlier comes back.
    return ~off if not kept.all() or (off & (sigmas > _ALARM_SIGMAS)).any() else kept


def worst_misfit(state: State, seen: Observations, sigma_px: FloatArray, kept: BoolArray) -> int | None:
    """Find the view that belongs least, of those that do not belong; None if all do.

    Parameters
    ----------
    state, seen, sigma_px, kept
        As `belonging` takes them.
    """
    squares, sigmas = _distances(state, seen, sigma_px, kept)
    off = (sigmas > _LIMIT_SIGMAS) & (squares > _NEAR_PX**2)
    share = np.array([part.mean() for part in np.split(off, seen.starts[1:])])
    rms = np.sqrt(_medians(squares, seen) / np.log(2))
    typical = float(np.median(rms))
    misfit = (rms > max(OUTSTANDING_RMS_PX, OUTSTANDING_RATIO * typical)) | (share > _LARGEST_SHARE_OF_A_VIEW)
    return int(np.argmax(np.where(misfit, rms, -1))) if misfit.any() else None


def distances_in_sigmas(state: State, seen: Observations, sigma_px: FloatArray, kept: BoolArray) -> FloatArray:
    """Distance of each corner (M,) from its place, in the standard deviations of a corner of its view that belongs."""
    return _distances(state, seen, sigma_px, kept)[1]


def usual_sigma_px(lengths_px: FloatArray, sigma_px: FloatArray) -> FloatArray:
    """Standard deviation per axis (M,) of a corner that belongs, given the residuals' lengths (M,) and what each knows."""
    squares = np.minimum(lengths_px, _LONGEST_PX) ** 2
    return np.sqrt(_usual_variance(squares, sigma_px, np.ones(squares.size, dtype=bool)))


def standing_out(state: State, seen: Observations) -> FloatArray:
    """How many times farther off the median corner of each view (V,) is than that of the median view; 0 if it is near."""
    lengths = np.linalg.norm(residuals(state, seen), axis=1)
    medians = _medians(np.where(np.isfinite(lengths), lengths, np.inf), seen)
    typical = np.clip(np.median(medians), np.sqrt(_LEAST_VARIANCE_PX2), _LONGEST_PX)
    return np.where(medians > _NEAR_PX, medians / typical, 0.0)


def named_outlier(detection: Detection, row: int, residual_px: FloatArray, sigmas: float) -> Outlier:
    """Name one corner that is left out, and how far it is from its place."""
    x, y = detection.corners_px[row].tolist()
    off_x, off_y = residual_px.tolist()
    return Outlier(
        source=detection.source,
        id=int(detection.ids[row]),
        corner_px=(x, y),
        sigma_px=float(detection.sigma_px[row]),
        residual_px=(off_x, off_y),
        reason=f"{np.hypot(off_x, off_y):.2g} px from where the other corners put it ({sigmas:.2g} standard deviations)",
    )


def _distances(state: State, seen: Observations, sigma_px: FloatArray, kept: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Squared residuals (M,) in px², and their length in standard deviations."""
    squares = (residuals(state, seen) ** 2).sum(axis=1)
    squares = np.where(np.isfinite(squares), squares, np.inf)
    variance = _usual_variance(squares, sigma_px, kept)
    relative = squares / (_MEDIAN_CHI2 * variance)
    counts = np.diff(np.append(seen.starts, seen.view.size))
    of_view = np.where(counts >= _FEWEST_FOR_A_SCALE, _medians(relative, seen), 1.0)[seen.view]
    off_axis = np.linalg.norm(seen.corners_px - state.camera.K[:2, 2], axis=1)
    scatter = np.maximum(np.maximum(of_view, _running_median(relative, off_axis)), 1.0)
    return squares, np.sqrt(squares / (variance * scatter))


def _running_median(values: FloatArray, along: FloatArray) -> FloatArray:
    """Median of each value (M,) and its nearest neighbours in the order of `along`."""
    order = np.argsort(along, kind="stable")
    window = min(_RING_CORNERS, values.size)
    medians = np.median(sliding_window_view(values[order], window), axis=-1)
    out = np.empty_like(values)
    out[order] = np.pad(medians, (window // 2, window - 1 - window // 2), mode="edge")
    return out


def _medians(values: FloatArray, seen: Observations) -> FloatArray:
    """Median of each view, shape (V,)."""
    return np.array([np.median(part) for part in np.split(values, seen.starts[1:])])


def _usual_variance(squares: FloatArray, sigma_px: FloatArray, kept: BoolArray) -> FloatArray:
    """Variance per axis (M,) of a corner that belongs: its own, plus what the median corner has on top of its own."""
    own = own_variance(sigma_px)
    own = np.maximum(0.0 if own is None else own, _LEAST_VARIANCE_PX2) * np.ones_like(squares)
    low, high = 0.0, float(np.median(squares[kept])) / _MEDIAN_CHI2
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        too_small = np.median(squares[kept] / (own[kept] + middle)) > _MEDIAN_CHI2
        low, high = (middle, high) if too_small else (low, middle)
    usual: FloatArray = own + high
    return usual
