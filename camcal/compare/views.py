"""How far two calibrations disagree in what they saw: corners and poses of the views that both have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from camcal.boards.base import Board
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.geometry.pose import Pose
from camcal.observations import Detection


@dataclass(frozen=True, slots=True)
class ViewErrors:
    """How far the views of an estimate are from the truth.

    Attributes
    ----------
    views, corners : int
        How many were in both.
    corner_rms_px : float
        Root mean square of the corner errors per axis, pixels; NaN without corners in common.
    corner_bias_px : tuple of float
        Mean corner error in x and y, pixels.
    corner_max_px : float
        Largest corner error (length), pixels.
    rotation_deg : float
        Root mean square angle between the boards' orientations; NaN without poses in common.
    translation_m : float
        Root mean square distance between the boards' origins.
    """

    views: int
    corners: int
    corner_rms_px: float
    corner_bias_px: tuple[float, float]
    corner_max_px: float
    rotation_deg: float
    translation_m: float


@dataclass(frozen=True, slots=True, eq=False)
class PosedView:
    """A view as far as a comparison needs it: its corners, and its pose where that is known."""

    detection: Detection
    T_cam_board: Pose | None


def view_errors(truth: Mapping[str, PosedView], estimate: Mapping[str, PosedView], board: Board) -> ViewErrors | None:
    """Compare corners and poses of the views that both have, by name; None if there are none.

    A board that looks the same after a turn is compared with the turn that fits best.
    """
    corner_errors, turns, shifts = [], [], []
    common = sorted(truth.keys() & estimate.keys())
    for name in common:
        errors, motion = _closest(truth[name], estimate[name], board)
        corner_errors.append(errors)
        if motion is not None:
            turns.append(motion[0])
            shifts.append(motion[1])
    if not common:
        return None
    every = np.concatenate(corner_errors)
    some = every.shape[0] > 0
    bias = every.mean(axis=0) if some else np.full(2, np.nan)
    return ViewErrors(
        views=len(common),
        corners=every.shape[0],
        corner_rms_px=float(np.sqrt((every**2).mean())) if some else float("nan"),
        corner_bias_px=(float(bias[0]), float(bias[1])),
        corner_max_px=float(np.linalg.norm(every, axis=1).max()) if some else float("nan"),
        rotation_deg=_root_mean_square(turns),
        translation_m=_root_mean_square(shifts),
    )


def closest_corners(truth: Detection, estimate: Detection, board: Board) -> tuple[FloatArray, IntArray, Pose]:
    """Compare the corners that two detections of a view have in common, for the board's best-fitting turn.

    Returns
    -------
    errors_px : ndarray of shape (N, 2)
        Estimate minus truth.
    ids : ndarray of shape (N,)
        The truth's ids of those corners.
    T_board_board : Pose
        The turn: the estimate's feature i stands where the truth's board, turned so, has its feature i.
    """
    turns = [(np.arange(board.feature_count), Pose.identity())]
    turns += [(symmetry.ids, symmetry.T_board_board) for symmetry in board.symmetries]
    best: tuple[FloatArray, IntArray, Pose] = (np.zeros((0, 2)), np.zeros(0, dtype=np.int64), Pose.identity())
    smallest = float("inf")
    for permutation, T_board_board in turns:
        ids, in_truth, in_estimate = np.intersect1d(truth.ids, permutation[estimate.ids], return_indices=True)
        errors = estimate.corners_px[in_estimate] - truth.corners_px[in_truth]
        size = float((errors**2).mean()) if errors.size else float("inf")
        if size < smallest:
            best, smallest = (errors, ids, T_board_board), size
    return best


def _closest(truth: PosedView, estimate: PosedView, board: Board) -> tuple[FloatArray, tuple[float, float] | None]:
    """Corner errors (N, 2) and the pose's (angle in degrees, distance in metres), for the board's best-fitting turn."""
    errors, _, turn = closest_corners(truth.detection, estimate.detection, board)
    if truth.T_cam_board is None or estimate.T_cam_board is None:
        return errors, None
    expected = truth.T_cam_board @ turn
    off = expected.inverse() @ estimate.T_cam_board
    return errors, (off.angle_deg, float(np.linalg.norm(estimate.T_cam_board.t - expected.t)))


def _root_mean_square(values: Sequence[float]) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if values else float("nan")
