"""The float64 finish: Levenberg-Marquardt on camcal's own Jacobians, down to the last bits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.calibration.normal_equations import NormalEquations, Observations, State, view_costs
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


@dataclass(frozen=True, slots=True, eq=False)
class Descent:
    """Where a descent ended.

    Attributes
    ----------
    state : State
        The lowest state it reached.
    cost : float
        Its weighted sum of squared residuals, px²; inf if a point falls behind the camera.
    failure : str
        Why it is no minimum, as a clause; empty if it is one.
    """

    state: State
    cost: float
    failure: str = ""


def descend(start: State, seen: Observations, columns: IntArray, *, most_steps: int = _MOST_STEPS) -> Descent:
    """Minimise the weighted sum of squared residuals.

    Parameters
    ----------
    start : State
        A guess near the minimum.
    seen : Observations
    columns : ndarray of shape (F,)
        Places of the free intrinsics in `Camera.intrinsics`.
    most_steps : int
        Steps after which it stops, wherever it is.

    Returns
    -------
    Descent
    """
    state, damping, decrease = start, 0.0, np.inf
    cost = _cost(state, seen)
    if not np.isfinite(cost):
        return Descent(state, cost, "a board ends up behind the camera")
    for _ in range(most_steps):
        try:
            step = NormalEquations.build(state, seen, columns)
            d_intrinsics, d_poses, decrease = step.solve(damping)
        except np.linalg.LinAlgError:
            return Descent(state, cost, "the views do not determine the camera (singular system)")
        small = _RELATIVE_DECREASE * cost + _ABSOLUTE_DECREASE_PX2 * seen.view.size
        trial = _step(state, columns, d_intrinsics, d_poses)
        trial_cost = _cost(trial, seen) if trial is not None else np.inf
        if damping == 0 and 0 <= decrease <= small:
            # The last tiny step is taken only if it does not make things worse.
            return Descent(trial, trial_cost) if trial is not None and trial_cost <= cost else Descent(state, cost)
        if trial is not None and trial_cost < cost:
            state, cost = trial, trial_cost
            damping = damping / _DAMPING_GROWTH if damping > _FIRST_DAMPING else 0.0
        elif decrease <= 100 * small:
            # The arithmetic cannot tell a better state from this one any more.
            return Descent(state, cost)
        else:
            damping = max(_FIRST_DAMPING, damping * _DAMPING_GROWTH)
            if damping > _LARGEST_DAMPING:
                break
    return Descent(state, cost, "" if 0 <= decrease <= _CREEPING_DECREASE * cost else "not converged")


def _step(state: State, columns: IntArray, d_intrinsics: np.ndarray, d_poses: np.ndarray) -> State | None:
    """Return the state after a step; None where it is no camera any more (a focal length below zero, not finite)."""
    try:
        return state.moved(columns, d_intrinsics, d_poses)
    except ValueError:
        return None


def _cost(state: State, seen: Observations) -> float:
    """Weighted sum of squares in px²; inf where a point falls behind the camera."""
    return float(view_costs(state, seen).sum())
