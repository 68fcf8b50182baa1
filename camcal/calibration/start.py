"""Starts from `cv2.calibrateCamera`, which works in single precision: the descent needs no better."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from camcal.calibration.normal_equations import State
from camcal.calibration.parameters import COEFFICIENTS, first_stage
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection

_FIX = {
    "k1": cv2.CALIB_FIX_K1,
    "k2": cv2.CALIB_FIX_K2,
    "k3": cv2.CALIB_FIX_K3,
    "k4": cv2.CALIB_FIX_K4,
    "k5": cv2.CALIB_FIX_K5,
    "k6": cv2.CALIB_FIX_K6,
}
_RATIONAL = ("k4", "k5", "k6")


def opencv_start(
    detections: Sequence[Detection], object_points: FloatArray, free: tuple[str, ...], *, staged: bool = True
) -> State | None:
    """Solve with OpenCV.

    Parameters
    ----------
    detections : sequence of Detection
        At least three views of the same image size.
    object_points : ndarray of shape (N, 3)
        The board's features in metres.
    free : tuple of str
        Names of the free intrinsics.
    staged : bool
        Whether K and k1 are solved for first, alone: that keeps the higher coefficients from running away before the
        poses are right.

    Returns
    -------
    State or None
        None if OpenCV refuses the views or answers with something that is no camera.
    """
    points = [np.ascontiguousarray(object_points[d.ids], dtype=np.float32) for d in detections]
    corners = [np.ascontiguousarray(d.corners_px, dtype=np.float32) for d in detections]
    size = detections[0].size
    K, dist = np.eye(3), np.zeros(len(COEFFICIENTS))
    flags = _flags(free)
    try:
        if staged:
            _, K_found, found, *_ = cv2.calibrateCamera(points, corners, size, K, dist, flags=_flags(first_stage(free)))
            K, dist = np.asarray(K_found, dtype=np.float64), _eight(found)
            flags |= cv2.CALIB_USE_INTRINSIC_GUESS
        _, K_found, found, rvecs, tvecs = cv2.calibrateCamera(points, corners, size, K, dist, flags=flags)
        camera = Camera(size, K_found, np.where(np.isin(COEFFICIENTS, free), _eight(found), 0.0))
        poses = [Pose.from_rvec(np.ravel(rvec), np.ravel(tvec)) for rvec, tvec in zip(rvecs, tvecs, strict=True)]
    except (cv2.error, ValueError):
        return None
    return State.of(camera, poses)


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


def _eight(dist: np.ndarray) -> FloatArray:
    """OpenCV's distortion, of whatever length and shape, as (8,)."""
    full = np.zeros(len(COEFFICIENTS))
    found = np.ravel(dist)[: full.size]
    full[: found.size] = found
    return full
