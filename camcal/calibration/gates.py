"""The first gates: what makes a solved camera one that must not be trusted, and the likely cause."""

from __future__ import annotations

import numpy as np

from camcal.boards.base import Board
from camcal.calibration.causes import LARGEST_RMS_PX, swapped_board
from camcal.calibration.parameters import distortion_names
from camcal.observations import Calibration

ASPECT_RANGE = (0.8, 1.25)


def quality_problems(calibration: Calibration, board: Board, *, anamorphic: bool = False) -> tuple[str, ...]:
    """List why a calibration must not be trusted, in order of weight; empty if every gate is passed.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.
    anamorphic : bool
        Whether pixels far from square are expected.

    Returns
    -------
    tuple of str
        Each says what was found, what is acceptable and what to do.
    """
    checks = (
        _large_rms(calibration, board),
        _fold_inside_corners(calibration, board),
        None if anamorphic else _odd_aspect(calibration),
    )
    return tuple(problem for problem in checks if problem)


def _large_rms(calibration: Calibration, board: Board) -> str | None:
    rms = calibration.rms_px
    if rms <= LARGEST_RMS_PX:
        return None
    swapped = swapped_board(calibration.detections, board, distortion_names(calibration.free))
    advice = swapped or "Check the board's SPEC against the print, that the board is flat, and that the lens is no fisheye."
    return f"RMS reprojection error is {rms:.3g} px (expected at most {LARGEST_RMS_PX:g}). {advice}"


def _fold_inside_corners(calibration: Calibration, board: Board) -> str | None:
    points = board.object_points
    folded = 0
    for detection, pose in zip(calibration.detections, calibration.poses, strict=True):
        folded += int(np.isnan(calibration.camera.project(pose.apply(points[detection.ids]))[:, 0]).sum())
    if not folded:
        return None
    radius_px = calibration.camera.valid_radius_px
    return (
        f"the lens model turns back {radius_px:.0f} px from the principal point, inside the area of the "
        f"detected corners ({folded} of {calibration.corner_count} lie past it). Free fewer coefficients with --distortion, "
        "or take views that cover the image's edge."
    )


def _odd_aspect(calibration: Calibration) -> str | None:
    aspect = float(calibration.camera.K[0, 0] / calibration.camera.K[1, 1])
    low, high = ASPECT_RANGE
    if low <= aspect <= high:
        return None
    return (
        f"fx / fy is {aspect:.3f} (expected {low:g} to {high:g}). If the pixels really are not square, pass --anamorphic; "
        "otherwise check the board's SPEC and that no image was resized."
    )
