"""A minimum that gross errors hardly move: what lies far off counts less and less, and views in the wrong pose are put right.

Least squares spreads a single corner that is 100 px off over its whole view, so that the view looks wrong and the corner
does not. Reweighted descents with Cauchy's weights (Holland and Welsch 1977, "Robust regression using iteratively
reweighted least-squares") end where most of the corners are; what does not belong stands out there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from camcal.calibration.branches import majority_poses, planar_poses
from camcal.calibration.finish import descend
from camcal.calibration.normal_equations import Observations, State, residuals, view_costs
from camcal.calibration.outliers import usual_sigma_px
from camcal.geometry.arrays import FloatArray, IntArray

# In standard deviations: where a corner counts half, and what it takes for there to be anything to do.
_HALF_WEIGHT_SIGMAS = 2.0
_ALARM_SIGMAS = 5.0
_MOST_ROUNDS = 20
# The weights change anyway, so no round is followed to its end.
_STEPS_A_ROUND = 10
# Corners that move less than this, in standard deviations of the median one, have settled.
_SETTLED_SIGMAS = 0.02
# Nonsense creeps on without end: a round that lowers the sum of squares by less than this share has arrived.
_CREEPING_SHARE = 0.01
_MOST_REPOSINGS = 3
# A view whose median residual is so many times the others' may stand in the wrong pose; another has to halve it.
_OUTSTANDING = 3.0
_BETTER = 0.5
_FARTHEST_SIGMAS = 1e6


def softened(state: State, seen: Observations, sigma_px: FloatArray, columns: IntArray) -> State:
    """Go from a least-squares minimum to one that gross errors hardly move; the same state if there are none.

    Parameters
    ----------
    state : State
    seen : Observations
        All corners.
    sigma_px : ndarray of shape (M,)
        Standard deviation of each corner per axis; NaN where it is not known.
    columns : ndarray of shape (F,)
        Places of the free parameters in `State.shared`.
    """
    # Trial steps far from any camera may overflow; their cost is infinite then, and they are not taken.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        state = _reweighted(state, seen, sigma_px, columns)
        for _ in range(_MOST_REPOSINGS):
            better = _reposed(state, seen)
            if better is None:
                break
            state = _reweighted(better, seen, sigma_px, columns)
    return state


def _reweighted(state: State, seen: Observations, sigma_px: FloatArray, columns: IntArray) -> State:
    """Descend with Cauchy's weights until the corners settle."""
    for round_ in range(_MOST_ROUNDS):
        off = _lengths(state, seen)
        usual = usual_sigma_px(off, sigma_px)
        far = np.minimum(off / usual, _FARTHEST_SIGMAS)
        if round_ == 0 and not (far > _ALARM_SIGMAS).any():
            return state
        # Not held within bounds as weights of sigmas are: a corner a thousand sigma off must not pull like ten of them.
        softer = replace(seen, weights=np.median(usual) / (usual * np.sqrt(1 + (far / _HALF_WEIGHT_SIGMAS) ** 2)))
        before = float(view_costs(state, softer).sum())
        found = descend(state, softer, columns, most_steps=_STEPS_A_ROUND)
        if not np.isfinite(found.cost):
            return state
        moved = np.abs(_lengths(found.state, seen) - off)
        state = found.state
        arrived = not found.failure or before - found.cost < _CREEPING_SHARE * before
        if arrived and np.median(moved) < _SETTLED_SIGMAS * np.median(usual):
            break
    return state


def _reposed(state: State, seen: Observations) -> State | None:
    """Pose views that stand out anew, by the median of their residuals; None if none gets better."""
    off = np.split(_lengths(state, seen), seen.starts[1:])
    medians = np.array([np.median(each) for each in off])
    rvecs, ts = state.rvecs.copy(), state.ts.copy()
    changed = False
    for view in np.flatnonzero(medians > _OUTSTANDING * np.median(medians)):
        own = seen.only(seen.view == view)
        known = state.camera, own.points_board, own.corners_px
        for rvec, t in (*planar_poses(*known), *majority_poses(*known)):
            trial = State(state.camera, rvec[None], t[None], state.shape)
            median = np.median(_lengths(trial, own))
            if median < _BETTER * medians[view]:
                medians[view], rvecs[view], ts[view], changed = median, rvec, t, True
    return replace(state, rvecs=rvecs, ts=ts) if changed else None


def _lengths(state: State, seen: Observations) -> FloatArray:
    """Lengths of the residuals (M,) in pixels; inf behind the camera."""
    length = np.linalg.norm(residuals(state, seen), axis=1)
    return np.where(np.isfinite(length), length, np.inf)
