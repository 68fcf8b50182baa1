"""The robust start: `cv2.calibrateCamera` solves for K and k1 first, then for everything that is free."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from camcal.errors import SolveError
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection
from camcal.threads import single_threaded

_FIX = {
    "k1": cv2.CALIB_FIX_K1,
    "k2": cv2.CALIB_FIX_K2,
    "k3": cv2.CALIB_FIX_K3,
    "k4": cv2.CALIB_FIX_K4,
    "k5": cv2.CALIB_FIX_K5,
    "k6": cv2.CALIB_FIX_K6,
}
_RATIONAL = ("k4", "k5", "k6")
_MORE_TILT = "Add views that tilt the board 20-45° in different directions."


def opencv_start(
    detections: Sequence[Detection], object_points: FloatArray, free: tuple[str, ...]
) -> tuple[Camera, tuple[Pose, ...]]:
    """Solve with OpenCV, in its single precision.

    Solving for K and k1 alone first keeps the higher coefficients from running away before the poses are right.

    Parameters
    ----------
    detections : sequence of Detection
        At least three views of the same image size.
    object_points : ndarray of shape (N, 3)
        The board's features in metres.
    free : tuple of str
        Names of the free intrinsics.

    Returns
    -------
    camera : Camera
    poses : tuple of Pose
        T_cam_board of each view.

    Raises
    ------
    SolveError
        If OpenCV refuses the views or answers with something that is not finite.
    """
    points = [np.ascontiguousarray(object_points[d.ids], dtype=np.float32) for d in detections]
    corners = [np.ascontiguousarray(d.corners_px, dtype=np.float32) for d in detections]
    size = detections[0].size
    first = tuple(name for name in free if name not in _FIX or name == "k1")
    with single_threaded():
        K, dist, *_ = _solve(points, corners, size, _flags(first), None)
        K, dist, rvecs, tvecs = _solve(points, corners, size, _flags(free) | cv2.CALIB_USE_INTRINSIC_GUESS, (K, dist))
    dist = dist.copy()
    dist[[i for i, name in enumerate(("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")) if name not in free]] = 0
    try:
        camera = Camera(size, K, dist)
        poses = tuple(Pose.from_rvec(rvec, tvec) for rvec, tvec in zip(rvecs, tvecs, strict=True))
    except ValueError as error:
        raise SolveError(
            f"solve: OpenCV's answer is not a camera ({error}). Check the board's SPEC against the print."
        ) from error
    return camera, poses


def _flags(free: tuple[str, ...]) -> int:
    """Return OpenCV's flags that fix everything which is not free."""
    flags = 0
    for name, flag in _FIX.items():
        if name not in free:
            flags |= flag
    if "p1" not in free:
        flags |= cv2.CALIB_ZERO_TANGENT_DIST
    if any(name in free for name in _RATIONAL):
        flags |= cv2.CALIB_RATIONAL_MODEL
    return flags


def _solve(
    points: list[np.ndarray],
    corners: list[np.ndarray],
    size: tuple[int, int],
    flags: int,
    guess: tuple[FloatArray, FloatArray] | None,
) -> tuple[FloatArray, FloatArray, list[FloatArray], list[FloatArray]]:
    """Call cv2.calibrateCamera; everything comes back float64 and flat, the distortion as (8,)."""
    K, dist = (np.eye(3), np.zeros(8)) if guess is None else (guess[0].copy(), guess[1].copy())
    try:
        rms, K_found, found, rvecs, tvecs = cv2.calibrateCamera(points, corners, size, K, dist, flags=flags)
    except cv2.error as error:
        raise SolveError(f"solve: OpenCV cannot start from these views ({error.err}). {_MORE_TILT}") from error
    K, full = np.asarray(K_found, dtype=np.float64), np.zeros(8)
    full[: min(8, found.size)] = np.ravel(found)[:8]
    if not (np.isfinite(rms) and np.isfinite(K).all() and np.isfinite(full).all()):
        raise SolveError(f"solve: OpenCV's answer is not finite. {_MORE_TILT}")
    return K, full, [np.ravel(v).astype(np.float64) for v in rvecs], [np.ravel(v).astype(np.float64) for v in tvecs]
