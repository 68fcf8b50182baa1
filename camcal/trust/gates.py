"""What makes a solved camera one that must not be trusted: a model that does not describe the corners, or that is absurd."""

from __future__ import annotations

import numpy as np

from camcal.boards.base import Board
from camcal.calibration.advice import fitting_advice
from camcal.calibration.causes import seen_from_behind, swapped_board
from camcal.calibration.limits import ASPECT_RANGE, DOUBTFUL_RELATIVE_FOCAL_SIGMA, LARGEST_RMS_PX
from camcal.calibration.parameters import distortion_names
from camcal.observations import Calibration
from camcal.records import Uncertainty
from camcal.verdict import Finding

# Shares of the image: where less than the first is known to a pixel at the boards' range, the camera is of little use;
# where more than the second is known to half a pixel there is nothing to say.
_LEAST_SHARE_KNOWN = 0.5
_GOOD_SHARE_KNOWN = 0.9
# Refined corners hit a whole pixel in x and y by chance alone.
_LARGEST_SHARE_ON_PIXELS = 0.2


def gate_findings(calibration: Calibration, board: Board, *, anamorphic: bool = False) -> tuple[Finding, ...]:
    """List why a calibration must not be trusted; empty if every gate is passed.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.
    anamorphic : bool
        Whether pixels far from square are expected.
    """
    checks = (
        _large_rms(calibration, board),
        _fold_inside_corners(calibration, board),
        None if anamorphic else _odd_aspect(calibration),
    )
    return tuple(finding for finding in checks if finding)


def certainty_findings(calibration: Calibration, known: Uncertainty) -> tuple[Finding, ...]:
    """List what the uncertainty of the camera leaves to be desired.

    Parameters
    ----------
    calibration : Calibration
    known : Uncertainty
        Of the same calibration.
    """
    checks = (_uncertain(calibration, known), _few_from_behind(calibration), _coarse(calibration))
    return tuple(finding for finding in checks if finding)


def _uncertain(calibration: Calibration, known: Uncertainty) -> Finding | None:
    """Judge the share of the image where the projection is known to half a pixel and to one."""
    _, half, whole = known.at_range.shares
    relative = np.sqrt(np.diag(calibration.covariance)[:2]) / np.diag(calibration.camera.K)[:2]
    if whole < _LEAST_SHARE_KNOWN:
        level, limit, share = "poor", "1 px", whole
    elif half < _GOOD_SHARE_KNOWN or relative.max() > DOUBTFUL_RELATIVE_FOCAL_SIGMA:
        level, limit, share = "usable", "0.5 px", half
    else:
        return None
    least = _LEAST_SHARE_KNOWN if level == "poor" else _GOOD_SHARE_KNOWN
    worst = np.nanmax([*known.at_range.corners_px, *known.at_range.edges_px, known.at_range.centre_px])
    return Finding(
        "uncertain",
        level,
        1 - share,
        f"where a point at the boards' range is seen is known to {limit} over {100 * share:.0f} % of the image (expected at "
        f"least {100 * least:.0f} %; {worst:.2g} px at worst), the focal length to {100 * relative.max():.2g} %",
        "Add views with boards tilted 20-45° and reaching the image's corners, or free fewer coefficients with --distortion.",
    )


def _coarse(calibration: Calibration) -> Finding | None:
    """Find corners on whole pixels: somebody rounded them, or never refined them."""
    corners = np.concatenate([seen.corners_px for seen in calibration.detections])
    share = float((corners == np.rint(corners)).all(axis=1).mean())
    if share <= _LARGEST_SHARE_ON_PIXELS:
        return None
    return Finding(
        "coarse_corners",
        "usable",
        share,
        f"{100 * share:.0f} % of the corners lie on whole pixels",
        "Calibrate from the images, or from corners that were refined to a fraction of a pixel and not rounded.",
    )


def _few_from_behind(calibration: Calibration) -> Finding | None:
    behind = np.flatnonzero(seen_from_behind(calibration))
    if not behind.size:
        return None
    return Finding(
        "seen_from_behind",
        "poor",
        behind.size / len(calibration.poses),
        f"{calibration.detections[behind[0]].source}: the board is seen from behind "
        f"({behind.size} of {len(calibration.poses)} views)",
        "Check that neither the ids of its corners nor the image are mirrored.",
    )


def _large_rms(calibration: Calibration, board: Board) -> Finding | None:
    rms = calibration.rms_px
    if rms <= LARGEST_RMS_PX:
        return None
    text = f"RMS reprojection error is {rms:.3g} px (expected at most {LARGEST_RMS_PX:g})"
    swapped = swapped_board(calibration.detections, board, distortion_names(calibration.free))
    if swapped:
        return Finding("rows_columns_swapped", "rejected", 100.0, text, swapped)
    return Finding("large_rms", "rejected", rms / LARGEST_RMS_PX, text, _fitting_advice(calibration))


def _fitting_advice(calibration: Calibration) -> str:
    advice = fitting_advice(np.array(calibration.view_rms_px), calibration.free)
    return f"{advice} Check as well that the board is flat, and that the lens is no fisheye."


def _fold_inside_corners(calibration: Calibration, board: Board) -> Finding | None:
    points = board.object_points
    folded = 0
    for detection, pose in zip(calibration.detections, calibration.poses, strict=True):
        folded += int(np.isnan(calibration.camera.project(pose.apply(points[detection.ids]))[:, 0]).sum())
    if not folded:
        return None
    radius_px = calibration.camera.valid_radius_px
    return Finding(
        "fold_inside_corners",
        "rejected",
        0.5,
        f"the lens model turns back {radius_px:.0f} px from the principal point, inside the area of the detected corners "
        f"({folded} of {calibration.corner_count} lie past it)",
        "Free fewer coefficients with --distortion, or take views that cover the image's edge.",
    )


def _odd_aspect(calibration: Calibration) -> Finding | None:
    aspect = float(calibration.camera.K[0, 0] / calibration.camera.K[1, 1])
    low, high = ASPECT_RANGE
    if low <= aspect <= high:
        return None
    return Finding(
        "odd_aspect",
        "rejected",
        0.8,
        f"fx / fy is {aspect:.3f} (expected {low:g} to {high:g})",
        "If the pixels really are not square, pass --anamorphic; else check the board's SPEC and that no image was resized.",
    )
