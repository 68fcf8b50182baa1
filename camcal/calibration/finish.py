"""The float64 finish: Levenberg-Marquardt on camcal's own Jacobians, down to the last bits."""

from __future__ import annotations

import numpy as np

from camcal.calibration.normal_equations import NormalEquations, Observations, State, residuals
from camcal.errors import SolveError
from camcal.geometry.arrays import IntArray

_MOST_STEPS = 100
_DAMPING_GROWTH = 10.0
_FIRST_DAMPING = 1e-6
_LARGEST_DAMPING = 1e8
# The minimum is reached once a step promises less than this share of the sum of squares, or (perfect corners) less
# than the square of a residual's last bits per corner.
_RELATIVE_DECREASE = 1e-13
_ABSOLUTE_DECREASE_PX2 = 1e-24
# What a last step may still promise when the steps run out. Residuals far from noise (a wrong board) make the descent
# creep; such a state is good enough to be judged, and its RMS tells what is wrong.
_CREEPING_DECREASE = 1e-5


def minimise(start: State, seen: Observations, columns: IntArray) -> State:
    """Minimise the weighted sum of squared residuals.

    Parameters
    ----------
    start : State
        A guess near the minimum.
    seen : Observations
    columns : ndarray of shape (F,)
        Places of the free intrinsics in `Camera.intrinsics`.

    Returns
    -------
    State
        The minimum.

    Raises
    ------
    SolveError
        If the system is singular or the minimum is not reached.
    """
    state, damping, decrease = start, 0.0, np.inf
    cost = _cost(state, seen)
    for _ in range(_MOST_STEPS):
        try:
            step = NormalEquations.build(state, seen, columns)
            d_intrinsics, d_poses, decrease = step.solve(damping)
        except np.linalg.LinAlgError as error:
            raise SolveError(
                "solve: the views do not determine the camera (singular system). Tilt the board 20-45° in different directions."
            ) from error
        small = _RELATIVE_DECREASE * cost + _ABSOLUTE_DECREASE_PX2 * seen.view.size
        if damping == 0 and 0 <= decrease <= small:
            return _better(state, _step(state, columns, d_intrinsics, d_poses), seen, cost)
        trial = _step(state, columns, d_intrinsics, d_poses)
        trial_cost = _cost(trial, seen) if trial is not None else np.inf
        if trial is not None and trial_cost < cost:
            state, cost = trial, trial_cost
            damping = damping / _DAMPING_GROWTH if damping > _FIRST_DAMPING else 0.0
        elif decrease <= 100 * small:
            # The arithmetic cannot tell a better state from this one any more.
            return state
        else:
            damping = max(_FIRST_DAMPING, damping * _DAMPING_GROWTH)
            if damping > _LARGEST_DAMPING:
                break
    if 0 <= decrease <= _CREEPING_DECREASE * cost:
        return state
    raise SolveError("solve: not converged. Check the board's SPEC against the print, and remove views that do not belong.")


def _step(state: State, columns: IntArray, d_intrinsics: np.ndarray, d_poses: np.ndarray) -> State | None:
    """Return the state after a step; None where it is no camera any more (a focal length below zero, not finite)."""
    try:
        return state.moved(columns, d_intrinsics, d_poses)
    except ValueError:
        return None


def _better(state: State, trial: State | None, seen: Observations, cost: float) -> State:
    """Take the last tiny step only if it does not make things worse."""
    return trial if trial is not None and _cost(trial, seen) <= cost else state


def _cost(state: State, seen: Observations) -> float:
    """Weighted sum of squares in px²; inf where a point falls behind the camera."""
    cost = float(((residuals(state, seen) * seen.weights[:, None]) ** 2).sum())
    return cost if np.isfinite(cost) else float("inf")
