"""Detections to a calibration: the usable views, the lowest minimum, and the covariance there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camcal.calibration.advice import capture_advice, misfits, worst_view
from camcal.calibration.finish import descend
from camcal.calibration.limits import LARGEST_CONDITION, LARGEST_RELATIVE_FOCAL_SIGMA
from camcal.calibration.normal_equations import NormalEquations, Observations, State, residuals, view_rms
from camcal.calibration.parameters import DEFAULT_DISTORTION, free_names, places
from camcal.calibration.search import lowest_minimum
from camcal.calibration.views import FEWEST_VIEWS, too_few_views, usable_views
from camcal.calibration.weights import total_sigma_px
from camcal.errors import DetectionError, SolveError
from camcal.geometry.arrays import FloatArray
from camcal.observations import Calibration, Detection, Rejected
from camcal.threads import single_threaded


def solve(
    detections: Sequence[Detection],
    object_points: FloatArray,
    *,
    distortion: tuple[str, ...] = DEFAULT_DISTORTION,
    rejected: Sequence[Rejected] = (),
) -> Calibration:
    """Solve for the camera, the pose of every view and their standard deviations.

    Parameters
    ----------
    detections : sequence of Detection
        Views of one board, all of the same image size. Their order does not matter.
    object_points : ndarray of shape (N, 3)
        The board's features in metres, by id.
    distortion : tuple of str
        Names of the free distortion coefficients, as `parse_distortion` gives them.
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
    everything_rejected = tuple(sorted([*rejected, *poor], key=lambda r: r.source))
    if len(used) < FEWEST_VIEWS:
        raise DetectionError(too_few_views(len(used), everything_rejected))
    free = free_names(distortion)
    seen = Observations.gather(used, object_points)
    with single_threaded():
        state = lowest_minimum(used, object_points, seen, free)
        state, seen = _weighted_minimum(state, seen, used, free)
        covariance, pose_sigmas = _uncertainty(state, seen, used, free)
    residual = residuals(state, seen)
    return Calibration(
        camera=state.camera,
        free=free,
        covariance=covariance,
        detections=used,
        poses=state.poses,
        pose_sigmas=pose_sigmas,
        residuals_px=tuple(np.split(residual, seen.starts[1:])),
        rejected=everything_rejected,
    )


def _weighted_minimum(
    state: State, seen: Observations, detections: Sequence[Detection], free: tuple[str, ...]
) -> tuple[State, Observations]:
    """Go on from the minimum of equal weights to that of the corners' own, where these are known."""
    sigma_px = total_sigma_px(detections, residuals(state, seen), len(free) + 6 * seen.starts.size)
    if sigma_px is None:
        return state, seen
    weighted = seen.weighted(sigma_px)
    found = descend(state, weighted, places(state.camera, free))
    if found.failure:
        raise SolveError(f"solve: {found.failure}. {worst_view(view_rms(found.state, seen), detections, free)}")
    return found.state, weighted


def _uncertainty(
    state: State, seen: Observations, used: Sequence[Detection], free: tuple[str, ...]
) -> tuple[FloatArray, FloatArray]:
    """Covariance of the free intrinsics and standard deviations of the poses; SolveError if they are undetermined."""
    columns = places(state.camera, free)
    weighted = residuals(state, seen) * seen.weights[:, None]
    freedom = weighted.size - columns.size - 6 * seen.starts.size
    if freedom <= 0:
        raise SolveError(
            f"solve: too few corners (got {weighted.size // 2} in {seen.starts.size} views for "
            f"{columns.size + 6 * seen.starts.size} unknowns). Add views, or free fewer coefficients with --distortion."
        )
    variance = float((weighted**2).sum()) / freedom
    try:
        covariance, pose_sigmas, condition = NormalEquations.build(state, seen, columns).covariances(variance)
    except np.linalg.LinAlgError:
        condition = float("inf")
    rms_px = view_rms(state, seen)
    advice = worst_view(rms_px, used, free) if misfits(rms_px) else capture_advice(free)
    if not condition < LARGEST_CONDITION:
        raise SolveError(
            _degenerate(state, advice, f"condition number {condition:.1g}, expected below {LARGEST_CONDITION:.0g}")
        )
    with np.errstate(invalid="ignore"):
        relative = np.sqrt(np.diag(covariance)[:2]) / np.diag(state.camera.K)[:2]
    if not (relative < LARGEST_RELATIVE_FOCAL_SIGMA).all():
        raise SolveError(_degenerate(state, advice, f"fx and fy known to ±{100 * relative.max():.0f} %"))
    return covariance, pose_sigmas


def _degenerate(state: State, advice: str, measure: str) -> str:
    """Say that the geometry is degenerate, with the tilts that usually cause it."""
    tilts = [float(np.degrees(np.arccos(min(1.0, abs(pose.R[2, 2]))))) for pose in state.poses]
    return (
        f"solve: the views do not determine the camera ({measure}; board tilts {min(tilts):.0f}° to {max(tilts):.0f}°). "
        f"{advice}"
    )
