"""The first gates: what makes a solved camera one that must not be trusted, and the likely cause."""

from __future__ import annotations

import numpy as np

from camcal.boards.base import Board
from camcal.calibration.advice import capture_advice, outstanding_view, worst_view
from camcal.calibration.causes import seen_from_behind, swapped_board
from camcal.calibration.limits import (
    ASPECT_RANGE,
    DOUBTFUL_RELATIVE_FOCAL_SIGMA,
    LARGEST_RMS_PX,
    OUTSTANDING_RMS_PX,
)
from camcal.calibration.parameters import distortion_names
from camcal.observations import Calibration

# The typical residual is Rayleigh-distributed noise: beyond 10 times its median lies one corner in 10^30.
_OUTSTANDING_CORNER_RATIO = 10.0
# More than these are no slips of a single corner: the view as a whole is named.
_FEW_CORNERS = 3


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


def capture_warnings(calibration: Calibration) -> tuple[str, ...]:
    """List what a person should know about a capture that can be trusted all the same; empty if nothing stands out.

    Parameters
    ----------
    calibration : Calibration

    Returns
    -------
    tuple of str
        Each says what was found and what to do.
    """
    checks = (
        _doubtful_focal_length(calibration),
        _few_from_behind(calibration),
        _outstanding_corner(calibration) or _outstanding_view(calibration),
    )
    return tuple(warning for warning in checks if warning)


def _doubtful_focal_length(calibration: Calibration) -> str | None:
    relative = np.sqrt(np.diag(calibration.covariance)[:2]) / np.diag(calibration.camera.K)[:2]
    if relative.max() <= DOUBTFUL_RELATIVE_FOCAL_SIGMA:
        return None
    return (
        f"the focal length is known to ±{100 * relative.max():.2g} % only (expected at most "
        f"{100 * DOUBTFUL_RELATIVE_FOCAL_SIGMA:g} %). {capture_advice(calibration.free)}"
    )


def _few_from_behind(calibration: Calibration) -> str | None:
    behind = np.flatnonzero(seen_from_behind(calibration))
    if not behind.size:
        return None
    return (
        f"{calibration.detections[behind[0]].source}: the board is seen from behind ({behind.size} of "
        f"{len(calibration.poses)} views). Check that neither its ids nor the image are mirrored."
    )


def _outstanding_view(calibration: Calibration) -> str | None:
    rms_px = np.array(calibration.view_rms_px)
    return None if outstanding_view(rms_px) is None else worst_view(rms_px, calibration.detections, calibration.free)


def _outstanding_corner(calibration: Calibration) -> str | None:
    length = [np.linalg.norm(residual, axis=1) for residual in calibration.residuals_px]
    typical = float(np.median(np.concatenate(length)))
    limit = max(OUTSTANDING_RMS_PX, _OUTSTANDING_CORNER_RATIO * typical)
    count = sum(int((each > limit).sum()) for each in length)
    if not 0 < count <= _FEW_CORNERS:
        return None
    view = int(np.argmax([each.max() for each in length]))
    corner = int(np.argmax(length[view]))
    detection = calibration.detections[view]
    return (
        f"{detection.source}: corner {detection.ids[corner]} lies {length[view][corner]:.3g} px from where it should "
        f"({typical:.2g} px is typical; {count} such corners in all). Look at that image, or leave it out."
    )


def _large_rms(calibration: Calibration, board: Board) -> str | None:
    rms = calibration.rms_px
    if rms <= LARGEST_RMS_PX:
        return None
    swapped = swapped_board(calibration.detections, board, distortion_names(calibration.free))
    advice = (
        swapped
        or _outstanding_view(calibration)
        or "Check the board's SPEC against the print, that the board is flat, and that the lens is no fisheye."
    )
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
