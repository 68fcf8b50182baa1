"""Undistortion: the Brown-Conrady formula inverted by Newton's method, safeguarded so that it stays inside the fold."""

from __future__ import annotations

import numpy as np

from camcal.geometry import formula
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.geometry.fold import find_fold, inside_fold

_STEPS = 100
_HALVINGS = 20
_EPS = float(np.finfo(np.float64).eps)
# Misses relative to the distorted radius: the first ends the iteration, the second is the most that is accepted where
# rounding lets it come no closer. (Hard by a pole, thousands of image widths away, it comes no closer than NaN.)
_CLOSE = 2e-14
_ACCEPTED = 5e-13
# A goal this share beyond the fold is still the fold, rounded.
_ON_FOLD = 8 * _EPS


def invert(coefficients: FloatArray, goal: FloatArray) -> FloatArray:
    """Undistort points of shape (N, 2); NaN where no point inside the fold maps to the given one."""
    x_d, y_d = goal.T.copy()
    radius_d = np.hypot(x_d, y_d)
    radius = invert_radial(coefficients, radius_d)
    scale = np.where(radius_d > 0, radius / np.where(radius_d > 0, radius_d, 1), 1 + radius)
    start = np.stack([x_d * scale, y_d * scale])
    if coefficients[2:4].any():
        start = _invert_tangential(coefficients, np.stack([x_d, y_d]), start)
    return start.T


def invert_radial(coefficients: FloatArray, radius_d: FloatArray) -> FloatArray:
    """Solve r g(r²) = r_d for r inside the radial fold, for radii of shape (N,); NaN where there is no such r.

    Newton's steps are taken while they stay within the interval known to hold the answer, which is halved otherwise.
    """
    fold = find_fold((*coefficients[:2].tolist(), 0.0, 0.0, *coefficients[4:].tolist()))
    # A few roundings short of the fold, so that the answer, spread over x and y, still counts as inside.
    limit = fold.radius * (1 - 8 * _EPS)
    found = np.full(radius_d.shape, np.nan)
    active = np.flatnonzero((radius_d <= fold.radius_distorted * (1 + _ON_FOLD)) & np.isfinite(radius_d))
    goal = radius_d[active]
    guess = np.where(goal < limit, goal, 0.5 * limit if np.isfinite(limit) else goal)
    low, high = np.zeros_like(goal), np.full_like(goal, limit)
    for _ in range(_STEPS):
        if active.size == 0:
            break
        gain, slope = formula.radial_gain_and_slope(coefficients, guess * guess)
        slope = gain + 2 * guess * guess * slope
        miss = guess * gain - goal
        low, high = np.where(miss < 0, guess, low), np.where(miss > 0, guess, high)
        following = guess - miss / slope
        outside = ~((following > low) & (following < high))
        following[outside] = _between(low[outside], high[outside])
        close = np.abs(miss) <= _CLOSE * goal
        stuck = following == guess
        done = close | (stuck & (np.abs(miss) <= _ACCEPTED * goal))
        found[active[done]] = np.where(outside, guess, following)[done]
        active, goal, guess, low, high = (a[~(done | stuck)] for a in (active, goal, following, low, high))
    return found


def _between(low: FloatArray, high: FloatArray) -> FloatArray:
    """Middle of each interval; twice as far as its start where it has no end."""
    return np.where(np.isfinite(high), 0.5 * (low + high), 2 * low + 1)


def _invert_tangential(coefficients: FloatArray, goal: FloatArray, start: FloatArray) -> FloatArray:
    """Finish the inversion in two dimensions, from radial answers that may be NaN or outside the fold.

    Here and below points have shape (2, N), x and y apart.
    """
    found = np.full(goal.shape, np.nan)
    farthest = find_fold(tuple(coefficients.tolist())).farthest_distorted
    active = np.flatnonzero(np.hypot(*goal) < farthest)
    goal = goal[:, active]
    guess = _start_inside(coefficients, goal, start[:, active])
    miss = _miss(coefficients, guess, goal)
    for _ in range(_STEPS):
        done = _largest(miss) <= _CLOSE * _largest(goal)
        if done.any():
            found[:, active[done]] = guess[:, done]
            active, goal, guess, miss = active[~done], goal[:, ~done], guess[:, ~done], miss[:, ~done]
        if active.size == 0:
            break
        guess, miss, moved = _damped_step(coefficients, goal, guess, miss)
        if not moved.all():
            good = ~moved & (_largest(miss) <= _ACCEPTED * _largest(goal))
            found[:, active[good]] = guess[:, good]
            active, goal, guess, miss = active[moved], goal[:, moved], guess[:, moved], miss[:, moved]
    return found


def _largest(vectors: FloatArray) -> FloatArray:
    """Larger magnitude of the two components, shape (N,)."""
    larger: FloatArray = np.maximum(np.abs(vectors[0]), np.abs(vectors[1]))
    return larger


def _start_inside(coefficients: FloatArray, goal: FloatArray, start: FloatArray) -> FloatArray:
    """Return the starts that lie inside the fold, and for the others the goal pulled well inside it."""
    outside = ~inside_fold(coefficients, *start)
    if outside.any():
        far = goal[:, outside]
        reach = 0.5 * find_fold(tuple(coefficients.tolist())).radius
        start[:, outside] = far * np.minimum(1, reach / np.hypot(*far))
    return start


def _miss(coefficients: FloatArray, guess: FloatArray, goal: FloatArray) -> FloatArray:
    """Distorted guess minus goal."""
    return np.stack(formula.distorted(coefficients, *guess)) - goal


def _damped_step(
    coefficients: FloatArray, goal: FloatArray, guess: FloatArray, miss: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Take the longest of Newton's step and its halves that stays inside the fold and comes closer to the goal.

    Returns the points, their misses, and which of them moved.
    """
    xx, xy, yy = formula.jacobian(coefficients, *guess)
    step = np.stack([xy * miss[1] - yy * miss[0], xy * miss[0] - xx * miss[1]]) / (xx * yy - xy * xy)
    best, best_miss = guess + step, _miss(coefficients, guess + step, goal)
    waiting = np.flatnonzero(~_better(coefficients, best, best_miss, miss))
    for _ in range(_HALVINGS):
        if waiting.size == 0:
            break
        step[:, waiting] *= 0.5
        trial = guess[:, waiting] + step[:, waiting]
        trial_miss = _miss(coefficients, trial, goal[:, waiting])
        best[:, waiting], best_miss[:, waiting] = trial, trial_miss
        waiting = waiting[~_better(coefficients, trial, trial_miss, miss[:, waiting])]
    best[:, waiting], best_miss[:, waiting] = guess[:, waiting], miss[:, waiting]
    moved = np.ones(guess.shape[1], dtype=bool)
    moved[waiting] = False
    return best, best_miss, moved


def _better(coefficients: FloatArray, trial: FloatArray, trial_miss: FloatArray, miss: FloatArray) -> BoolArray:
    """Tell which trials lie inside the fold and miss their goal by less than before."""
    closer = trial_miss[0] ** 2 + trial_miss[1] ** 2 < miss[0] ** 2 + miss[1] ** 2
    better: BoolArray = closer & inside_fold(coefficients, *trial)
    return better
