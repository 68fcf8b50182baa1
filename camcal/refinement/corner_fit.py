"""Fits the corner model to patches: Levenberg-Marquardt, all corners at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.refinement.corner_model import (
    ALL_FREE,
    ANGLE_1,
    BEND_1,
    LOG_BLUR,
    OVERSHOOT,
    RESPONSE,
    SMEAR,
    Corners,
    Patches,
    X,
    jacobian_and_residual,
)

_FIRST_DAMPING = 1e-3
_LEAST_DAMPING, _LARGEST_DAMPING = 1e-4, 1e7
_LARGEST_STEP = np.full(ALL_FREE, np.inf)
_LARGEST_STEP[X : X + 2] = 1.0
_LARGEST_STEP[LOG_BLUR] = 0.4
_LARGEST_STEP[ANGLE_1:BEND_1] = 0.2
LARGEST_RESPONSE = 0.6
"""Limit of the bend of grey values; a gamma of 2.2 on ink of a sixth of the paper makes 0.25."""

_LARGEST_SMEAR = 0.7
# What a lens, a pixel and a camera's sharpening can do. A disc of defocus overshoots by +1/12, strong sharpening by -1.
_LOWEST, _HIGHEST = np.full(ALL_FREE, -np.inf), np.full(ALL_FREE, np.inf)
_LOWEST[[LOG_BLUR, OVERSHOOT, RESPONSE, SMEAR]] = np.log(0.36), -1.2, -LARGEST_RESPONSE, -_LARGEST_SMEAR
_HIGHEST[[LOG_BLUR, OVERSHOOT, RESPONSE, SMEAR]] = np.log(30.0), 0.1, LARGEST_RESPONSE, _LARGEST_SMEAR
_ROUNDS = 20


class _Goal(NamedTuple):
    """When a search ends. A Gauss-Newton step leaves an error of about its square."""

    shift_px: float
    log_blur: float
    gain: float  # what the step promises, in variances of the residuals: the square of its size in standard deviations
    held: tuple[int, ...] = ()  # columns of parameters that stay as they are


_ROUGH, _FINE = _Goal(0.05, 0.15, 0.1), _Goal(0.003, 0.05, 0.01)


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Fitted corners.

    Attributes
    ----------
    corners : Corners
    cost : ndarray of shape (C,)
        Sum of the squared residuals, levels².
    covariance : ndarray of shape (C, 2, 2)
        Of x and y, px², from the scatter of the residuals; NaN where it is not determined.
    noise : ndarray of shape (C,)
        Standard deviation of the residuals, levels.
    explained : ndarray of shape (C,)
        Share of the patch's variance that the model explains, at most 1.
    brightest : ndarray of shape (C,)
        Share of the patch's pixels that hold its highest value: large where the sensor saturates.
    converged : ndarray of shape (C,)
        Whether the last step was small.
    """

    corners: Corners
    cost: FloatArray
    covariance: FloatArray
    noise: FloatArray
    explained: FloatArray
    brightest: FloatArray
    converged: BoolArray


@dataclass(slots=True, eq=False)
class _Search:
    """Where the search of every corner stands (changed in place)."""

    params: FloatArray
    normal: FloatArray
    gradient: FloatArray
    cost: FloatArray
    damping: FloatArray
    converged: BoolArray


def fit_corners(patches: Patches, corners: Corners, count: int, held: Sequence[int] = (), *, rough: bool = False) -> Fit:
    """Fit the leading `count` parameters of every corner.

    Parameters
    ----------
    patches : Patches
    corners : Corners
        Where to start.
    count : int
        `SHAPE_KNOWN`, `STRAIGHT` or `ALL_FREE`.
    held : sequence of int
        Columns of parameters that stay as they are all the same.
    rough : bool
        Whether a position within a few hundredths of a pixel will do.

    Returns
    -------
    Fit
    """
    normal, gradient, cost = _normal_equations(patches, corners, count)
    start = np.full(cost.size, _FIRST_DAMPING)
    search = _Search(corners.params.copy(), normal, gradient, cost, start, np.zeros(cost.size, dtype=bool))
    rows = np.arange(cost.size)
    seen, known = patches, corners
    goal = (_ROUGH if rough else _FINE)._replace(held=tuple(held))
    for _ in range(_ROUNDS):
        _step(search, rows, seen, known, goal)
        left = np.flatnonzero(~search.converged[rows])
        if left.size == 0:
            break
        if left.size < rows.size:
            rows, seen, known = rows[left], seen.take(left), known.take(left)
    return _finished(patches, corners, search, held)


def _step(search: _Search, rows: IntArray, patches: Patches, known: Corners, goal: _Goal) -> None:
    """Try one step for some corners; keep those that lower the cost."""
    count = search.gradient.shape[1]
    params = search.params[rows]
    still = np.zeros((rows.size, count), dtype=bool)
    still[:, list(goal.held)] = True
    still |= _at_limit(params[:, :count], search.gradient[rows])
    step = _solve(search.normal[rows], search.gradient[rows], search.damping[rows], still)
    limit = _LARGEST_STEP[:count]
    step *= np.minimum(1.0, (limit / np.maximum(np.abs(step), 1e-300)).min(axis=1, keepdims=True))
    params[:, :count] += step
    params = np.clip(params, _LOWEST, _HIGHEST)
    trial = Corners(params, known.cubic, known.quartic, known.mix)
    normal, gradient, cost = _normal_equations(patches, trial, count)
    before = search.cost[rows]
    # The cost is a sum of 32-bit numbers: the last bits do not count as worse.
    better = cost <= before * (1 + 1e-6)
    promised = (step * search.gradient[rows]).sum(axis=1)
    noise = before / np.maximum(patches.weight.sum(axis=1) - count, 1.0)
    small = (np.abs(step[:, :2]).max(axis=1) < goal.shift_px) & (np.abs(step[:, LOG_BLUR]) < goal.log_blur)
    # Or the step is far below what the noise leaves undecided: blur and overshoot trade against each other for long.
    small |= (promised < goal.gain * noise) & (search.damping[rows] < 1)
    # Steps that hold little of what they promise swing from one side of a valley to the other: damped, they follow it.
    held = (before - cost) / np.maximum(promised, 1e-30)
    factor = np.where(held > 0.7, 0.1, np.where(held > 0.3, 1.0, np.where(better, 5.0, 10.0)))
    kept = rows[better]
    search.params[kept], search.normal[kept] = params[better], normal[better]
    search.gradient[kept], search.cost[kept] = gradient[better], cost[better]
    search.damping[rows] = np.clip(search.damping[rows] * factor, _LEAST_DAMPING, _LARGEST_DAMPING)
    search.converged[rows] = small


def _normal_equations(patches: Patches, corners: Corners, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normal matrix (C, n, n), gradient (C, n) and sum of the squared residuals (C,)."""
    rows = jacobian_and_residual(patches, corners, count)
    products = (rows @ rows.swapaxes(1, 2)).astype(np.float64)
    return products[:, :count, :count], products[:, :count, count], products[:, count, count]


def _at_limit(params: FloatArray, gradient: FloatArray) -> BoolArray:
    """Which parameters (C, n) are at a limit and pulled beyond it."""
    count = params.shape[1]
    held: BoolArray = (params <= _LOWEST[:count]) & (gradient < 0) | (params >= _HIGHEST[:count]) & (gradient > 0)
    return held


def _solve(normal: FloatArray, gradient: FloatArray, damping: FloatArray, still: BoolArray) -> FloatArray:
    """Damped Gauss-Newton steps (C, n), 0 for what stays still (C, n)."""
    scaled, scale = _scaled(normal, still)
    scaled += (damping[:, None] + 1e-9)[:, :, None] * np.eye(gradient.shape[1])
    step: FloatArray = np.linalg.solve(scaled, (gradient * scale)[..., None])[..., 0] * scale
    return step


def _scaled(normal: FloatArray, still: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Normal matrices (C, n, n) with a unit diagonal, and the scale of each unknown (C, n), 0 for what stays still."""
    scale = 1 / np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-30))
    scale[still] = 0.0
    scaled = normal * scale[:, :, None] * scale[:, None, :]
    scaled += still[:, :, None] * np.eye(still.shape[1])
    return scaled, scale


def _finished(patches: Patches, corners: Corners, search: _Search, held: Sequence[int]) -> Fit:
    """Return the fit with its statistics."""
    pixels = patches.weight.sum(axis=1, dtype=np.float64)
    freedom = np.maximum(pixels - search.gradient.shape[1], 1.0)
    variance = search.cost / freedom
    mean = patches.values.sum(axis=1, dtype=np.float64) / np.maximum(pixels, 1)
    spread = (patches.values.astype(np.float64) ** 2).sum(axis=1) - pixels * mean**2
    return Fit(
        Corners(search.params, corners.cubic, corners.quartic, corners.mix),
        search.cost,
        _shift_covariance(search, held) * variance[:, None, None],
        np.sqrt(variance),
        1 - search.cost / np.maximum(spread, 1e-12),
        ((patches.values == patches.values.max(axis=1, keepdims=True)) * patches.weight).sum(axis=1) / np.maximum(pixels, 1),
        search.converged,
    )


def _shift_covariance(search: _Search, held: Sequence[int]) -> FloatArray:
    """Covariance (C, 2, 2) of x and y for residuals of unit variance; NaN where it is not determined."""
    count = search.gradient.shape[1]
    still = _at_limit(search.params[:, :count], search.gradient)
    still[:, list(held)] = True
    scaled, scale = _scaled(search.normal, still)
    scaled += 1e-9 * np.eye(count)
    inverse = np.linalg.inv(scaled)[:, :2, :2] * scale[:, :2, None] * scale[:, None, :2]
    positive = np.all((np.diagonal(inverse, axis1=1, axis2=2) > 0) & (scale[:, :2] < 1e14), axis=1)
    covariance: FloatArray = np.where(positive[:, None, None], inverse, np.nan)
    return covariance
