"""Detections to a calibration: the usable views, the lowest minimum, what does not belong, and the covariance there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from camcal.calibration.advice import capture_advice, misfits, worst_view
from camcal.calibration.board_shape import shape_basis
from camcal.calibration.limits import LARGEST_CONDITION, LARGEST_RELATIVE_FOCAL_SIGMA
from camcal.calibration.normal_equations import Covariances, NormalEquations, Observations, State, residuals, view_rms
from camcal.calibration.parameters import DEFAULT_DISTORTION, free_names, places
from camcal.calibration.restart import some_nonsense, start_from_planes
from camcal.calibration.robust import Fit, robust_minimum, undoubted_minimum
from camcal.calibration.search import lowest_minimum
from camcal.calibration.views import FEWEST_VIEWS, too_few_views, usable_views
from camcal.errors import DetectionError, SolveError
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.observations import Calibration, Detection, Rejected
from camcal.records import BoardShape
from camcal.threads import single_threaded


def solve(
    detections: Sequence[Detection],
    object_points: FloatArray,
    *,
    distortion: tuple[str, ...] = DEFAULT_DISTORTION,
    shape: tuple[str, ...] = (),
    rejected: Sequence[Rejected] = (),
) -> Calibration:
    """Solve for the camera, the pose of every view and their standard deviations.

    Corners and views that do not belong are left out: see `Calibration.outliers` and `Calibration.rejected`.

    Parameters
    ----------
    detections : sequence of Detection
        Views of one board, all of the same image size. Their order does not matter.
    object_points : ndarray of shape (N, 3)
        The board's features in metres, by id.
    distortion : tuple of str
        Names of the free distortion coefficients, as `parse_distortion` gives them.
    shape : tuple of str
        Parameters of the board's own shape to solve for, some of `board_shape.SHAPE_NAMES`.
    rejected : sequence of Rejected
        Images that gave no view; carried through, and joined by the views that cannot be used.

    Returns
    -------
    Calibration

    Raises
    ------
    DetectionError
        If fewer than three views are usable.
    SolveError
        If the geometry is degenerate, or the solve does not converge or is not finite.
    ValueError
        If the views differ in image size.
    """
    if len({d.size for d in detections}) > 1:
        raise ValueError(f"detections: views of one image size are needed (got {sorted({d.size for d in detections})})")
    used, poor = usable_views(detections, object_points)
    if len(used) < FEWEST_VIEWS:
        raise DetectionError(too_few_views(len(used), _sorted([*rejected, *poor])))
    free = free_names(distortion)
    with single_threaded():
        fit, columns = _minimum(used, object_points, free, shape)
        covariances = _covariances(fit, columns, free)
    return _calibration(fit, covariances, free, shape, _sorted([*rejected, *poor, *fit.misfits]))


def _minimum(
    used: Sequence[Detection], object_points: FloatArray, free: tuple[str, ...], shape: tuple[str, ...]
) -> tuple[Fit, IntArray]:
    """Find the minimum of the corners that belong, and the places (F,) of the free parameters in its `State.shared`."""
    seen = Observations.gather(used, object_points)
    shaped = seen.shaped(used, shape_basis(object_points, shape)) if shape else seen

    def start(state: State) -> tuple[State, IntArray]:
        beside = state.shared.size + np.arange(len(shape))
        return replace(state, shape=np.zeros(len(shape))), np.append(places(state.camera, free), beside)

    planes = start_from_planes(used, object_points, seen, free) if some_nonsense(seen) else None
    if planes is not None:
        state, columns = start(planes)
        fit = undoubted_minimum(state, shaped, used, columns, free)
        if fit is not None:
            return fit, columns
    lowest = lowest_minimum(used, object_points, seen, free)
    state, columns = start(lowest.state)

    def restart() -> State:
        return start(planes or start_from_planes(used, object_points, seen, free) or lowest.state)[0]

    return robust_minimum(replace(lowest, state=state), shaped, used, columns, free, restart=restart), columns


def _sorted(rejected: Sequence[Rejected]) -> tuple[Rejected, ...]:
    return tuple(sorted(rejected, key=lambda rejection: rejection.source))


def _calibration(
    fit: Fit, covariances: Covariances, free: tuple[str, ...], shape: tuple[str, ...], rejected: tuple[Rejected, ...]
) -> Calibration:
    """Put together what was solved for."""
    first = len(free)
    beside_shape = np.delete(np.arange(len(covariances.joint)), first + np.arange(len(shape)))
    return Calibration(
        camera=fit.state.camera,
        free=free,
        joint_covariance=covariances.joint[np.ix_(beside_shape, beside_shape)],
        detections=fit.detections,
        poses=fit.state.poses,
        pose_sigmas=covariances.pose_sigmas,
        residuals_px=tuple(np.split(residuals(fit.state, fit.seen), fit.seen.starts[1:])),
        shape=BoardShape(shape, fit.state.shape, covariances.shared[first:, first:]),
        outliers=fit.outliers,
        rejected=rejected,
    )


def _covariances(fit: Fit, columns: IntArray, free: tuple[str, ...]) -> Covariances:
    """Covariances at the minimum; SolveError if the views do not determine the camera."""
    state, seen = fit.state, fit.seen
    weighted = residuals(state, seen) * seen.weights[:, None]
    freedom = weighted.size - columns.size - 6 * seen.starts.size
    if freedom <= 0:
        raise SolveError(
            f"solve: too few corners (got {weighted.size // 2} in {seen.starts.size} views for "
            f"{columns.size + 6 * seen.starts.size} unknowns). Add views, or free fewer coefficients with --distortion."
        )
    variance = float((weighted**2).sum()) / freedom
    condition, relative = float("inf"), np.array([np.inf])
    try:
        found = NormalEquations.build(state, seen, columns).covariances(state, variance)
        condition = found.condition
        with np.errstate(invalid="ignore"):
            relative = np.sqrt(np.diag(found.shared)[:2]) / np.diag(state.camera.K)[:2]
    except np.linalg.LinAlgError:
        pass
    rms_px = view_rms(state, seen)
    advice = worst_view(rms_px, fit.detections, free) if misfits(rms_px) else capture_advice(free)
    if not condition < LARGEST_CONDITION:
        raise SolveError(
            _degenerate(state, advice, f"condition number {condition:.1g}, expected below {LARGEST_CONDITION:.0g}")
        )
    if not (relative < LARGEST_RELATIVE_FOCAL_SIGMA).all():
        raise SolveError(_degenerate(state, advice, f"fx and fy known to ±{100 * relative.max():.0f} %"))
    return found


def _degenerate(state: State, advice: str, measure: str) -> str:
    """Say that the geometry is degenerate, with the tilts that usually cause it."""
    tilts = [float(np.degrees(np.arccos(min(1.0, abs(pose.R[2, 2]))))) for pose in state.poses]
    return (
        f"solve: the views do not determine the camera ({measure}; board tilts {min(tilts):.0f}° to {max(tilts):.0f}°). "
        f"{advice}"
    )
