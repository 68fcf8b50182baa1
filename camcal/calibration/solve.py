"""Detections to a calibration: the robust start, the float64 finish, and the covariance at the minimum."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camcal.calibration.finish import minimise
from camcal.calibration.normal_equations import NormalEquations, Observations, State, residuals
from camcal.calibration.parameters import DEFAULT_DISTORTION, free_names
from camcal.calibration.start import opencv_start
from camcal.errors import DetectionError, SolveError
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.observations import Calibration, Detection, Rejected
from camcal.threads import single_threaded

FEWEST_VIEWS = 3
"""Two planar views leave K undetermined with the principal point free (Zhang 2000, section 3.2)."""

_FEWEST_CORNERS = 6
_LARGEST_CONDITION = 1e14
_LARGEST_RELATIVE_FOCAL_SIGMA = 0.25


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
        Images that gave no view; carried through, and joined by views with too few corners.

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
    used = sorted((d for d in detections if spans_plane(d, object_points)), key=lambda d: d.source)
    poor = [Rejected(d.source, _too_few(d)) for d in detections if not spans_plane(d, object_points)]
    everything_rejected = tuple(sorted([*rejected, *poor], key=lambda r: r.source))
    if len(used) < FEWEST_VIEWS:
        raise DetectionError(too_few_views(len(used), everything_rejected))
    free = free_names(distortion)
    camera, poses = opencv_start(used, object_points, free)
    columns = np.array([camera.intrinsic_names.index(name) for name in free])
    seen = Observations.gather(used, object_points)
    with single_threaded():
        state = minimise(State.of(camera, poses), seen, columns)
        covariance, pose_sigmas = _uncertainty(state, seen, columns)
    residual = residuals(state, seen)
    return Calibration(
        camera=state.camera,
        free=free,
        covariance=covariance,
        detections=tuple(used),
        poses=state.poses,
        pose_sigmas=pose_sigmas,
        residuals_px=tuple(np.split(residual, seen.starts[1:])),
        rejected=everything_rejected,
    )


def spans_plane(detection: Detection, object_points: FloatArray) -> bool:
    """Tell whether a view has enough corners, not all on one line, to give a pose."""
    if len(detection) < _FEWEST_CORNERS:
        return False
    points = object_points[detection.ids, :2]
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] > 1e-6 * spread[0])


def too_few_views(count: int, rejected: Sequence[Rejected]) -> str:
    """Say that too few views are left, and what became of the first of the others."""
    text = f"calibrate: too few usable views (got {count}, expected at least {FEWEST_VIEWS})."
    if rejected:
        text += f" {rejected[0].source}: {rejected[0].reason}."
        text += f" {len(rejected) - 1} more were rejected." if len(rejected) > 1 else ""
    return text + " Take more photographs that show the whole board."


def _too_few(detection: Detection) -> str:
    """Return the reason for a view that gives no pose."""
    if len(detection) < _FEWEST_CORNERS:
        return f"too few corners for a pose (got {len(detection)}, expected at least {_FEWEST_CORNERS})"
    return "all corners lie on one line"


def _uncertainty(state: State, seen: Observations, columns: IntArray) -> tuple[FloatArray, FloatArray]:
    """Covariance of the free intrinsics and standard deviations of the poses; SolveError if they are undetermined."""
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
    if not condition < _LARGEST_CONDITION:
        raise SolveError(_degenerate(state, f"condition number {condition:.1g}, expected below {_LARGEST_CONDITION:.0g}"))
    relative = np.sqrt(np.diag(covariance)[:2]) / np.diag(state.camera.K)[:2]
    if not (relative < _LARGEST_RELATIVE_FOCAL_SIGMA).all():
        raise SolveError(_degenerate(state, f"fx and fy known to ±{100 * relative.max():.0f} %"))
    return covariance, pose_sigmas


def _degenerate(state: State, measure: str) -> str:
    """Say that the geometry is degenerate, with the tilts that usually cause it."""
    tilts = [float(np.degrees(np.arccos(min(1.0, abs(pose.R[2, 2]))))) for pose in state.poses]
    return (
        f"solve: the views do not determine the camera ({measure}; board tilts {min(tilts):.0f}° to {max(tilts):.0f}°). "
        "Tilt the board 20-45° in different directions, or free fewer coefficients with --distortion."
    )
