"""The two poses in which a flat board looks nearly alike: whichever fits better is taken.

A descent that starts in the wrong one of the two cannot leave it, and bends the camera to make up for it.
"""

from __future__ import annotations

import cv2
import numpy as np

from camcal.calibration.normal_equations import Observations, State, view_costs
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera

_BRANCHES = 2
_FEWEST_RAYS = 6
# A view's sum of squares has to shrink to less than this share: the last bits of the same pose are no other branch.
_BETTER = 0.9
# Ids shifted by a third of a row leave two thirds of the corners in agreement, on the wrong pose.
_LEAST_MAJORITY = 0.75


def reposed(state: State, seen: Observations) -> State | None:
    """Pose every view anew under the state's camera.

    Parameters
    ----------
    state : State
    seen : Observations

    Returns
    -------
    State or None
        With the better poses; None if no view has one.
    """
    candidates = np.full((_BRANCHES, *state.rvecs.shape), np.nan), np.full((_BRANCHES, *state.ts.shape), np.nan)
    views = zip(np.split(seen.points_board, seen.starts[1:]), np.split(seen.corners_px, seen.starts[1:]), strict=True)
    for view, (points, corners) in enumerate(views):
        for branch, (rvec, t) in enumerate(planar_poses(state.camera, points, corners)):
            candidates[0][branch, view], candidates[1][branch, view] = rvec, t
    best = view_costs(state, seen)
    rvecs, ts = state.rvecs.copy(), state.ts.copy()
    changed = False
    for branch in range(_BRANCHES):
        trial = State(state.camera, candidates[0][branch], candidates[1][branch])
        cost = view_costs(trial, seen)
        better = cost < _BETTER * best
        best[better], rvecs[better], ts[better] = cost[better], trial.rvecs[better], trial.ts[better]
        changed |= bool(better.any())
    return State(state.camera, rvecs, ts) if changed else None


def planar_poses(camera: Camera, points_board: FloatArray, corners_px: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Both poses of one view in front of the camera, each refined on the undistorted corners; empty if there is none."""
    rays = camera.unproject(corners_px)
    reached = np.isfinite(rays).all(axis=1)
    if reached.sum() < _FEWEST_RAYS:
        return []
    points, ideal = np.ascontiguousarray(points_board[reached]), np.ascontiguousarray(rays[reached, :2])
    K, dist = np.eye(3), np.zeros(5)
    try:
        _, rvecs, tvecs, _ = cv2.solvePnPGeneric(points, ideal, K, dist, flags=cv2.SOLVEPNP_IPPE)
        refined = [cv2.solvePnPRefineLM(points, ideal, K, dist, *pose) for pose in zip(rvecs, tvecs, strict=True)]
    except cv2.error:
        return []
    poses = [(np.ravel(rvec).astype(np.float64), np.ravel(t).astype(np.float64)) for rvec, t in refined]
    return [(rvec, t) for rvec, t in poses if np.isfinite([rvec, t]).all()][:_BRANCHES]


def majority_poses(camera: Camera, points_board: FloatArray, corners_px: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Do as `planar_poses` does for the corners that agree on one plane; empty if these are no great majority.

    Least median of squares (Rousseeuw 1984) on the homography from the board to the undistorted corners.
    """
    rays = camera.unproject(corners_px)
    reached = np.flatnonzero(np.isfinite(rays).all(axis=1))
    if reached.size < _FEWEST_RAYS:
        return []
    # In about pixels, because OpenCV takes what is nearer than a thousandth for noise.
    ideal = rays[reached, :2] * camera.K[0, 0]
    try:
        _, agree = cv2.findHomography(points_board[reached, :2], ideal, cv2.LMEDS)
    except cv2.error:
        return []
    majority = reached[np.ravel(agree) != 0]
    if majority.size < _LEAST_MAJORITY * reached.size:
        return []
    return planar_poses(camera, points_board[majority], corners_px[majority])
