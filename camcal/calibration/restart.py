"""A start that views of nonsense cannot spoil: it comes from those that look like a plane at all.

Whatever the camera, a homography takes a flat board to the image but for the distortion of the lens. Wrong ids and corners
of something else leave it by far.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camcal.calibration.branches import reposed
from camcal.calibration.closed_form import facing, homographies
from camcal.calibration.limits import OUTSTANDING_RATIO, OUTSTANDING_RMS_PX
from camcal.calibration.normal_equations import Observations, State
from camcal.calibration.search import lowest_minimum
from camcal.calibration.views import FEWEST_VIEWS
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.observations import Detection

# If more views than this look like no plane it is not they that are wrong.
_LARGEST_SHARE = 0.25
# Perspective and the lens leave less than a tenth of the corners' variance to what is not affine, even a fisheye. Wrong ids
# leave a quarter and more, corners of something else nearly all.
_NONSENSE_SHARE = 0.2


def nonsense(seen: Observations) -> BoolArray:
    """Tell which views (V,) are plainly none of the board: no affine map takes it anywhere near their corners.

    A quick look, for what is beyond doubt; `plane_rms_px` is finer, and slower.
    """
    # Board and image side by side: one product of each view holds all of its moments.
    views = _by_view(np.column_stack([seen.points_board[:, :2], seen.corners_px]), seen)
    centred = [view - view.mean(axis=0) for view in views]
    moments = np.stack([view.T @ view for view in centred])
    across, own = moments[:, :2, 2:], np.trace(moments[:, 2:, 2:], axis1=1, axis2=2)
    affine = (across * np.linalg.solve(moments[:, :2, :2], across)).sum(axis=(1, 2))
    told: BoolArray = affine < (1 - _NONSENSE_SHARE) * own
    return told


def some_nonsense(seen: Observations) -> bool:
    """Tell whether some views are plainly none of the board, and so few that it is they that are wrong."""
    return 0 < float(nonsense(seen).mean()) <= _LARGEST_SHARE


def start_from_planes(
    detections: Sequence[Detection], object_points: FloatArray, seen: Observations, free: tuple[str, ...]
) -> State | None:
    """Find the camera from the views that look like a plane, and pose all others under it.

    Parameters
    ----------
    detections, object_points, seen, free
        As `search.lowest_minimum` takes them.

    Returns
    -------
    State or None
        None if all views look like a plane, too few do, or there is no minimum without the others either.
    """
    if float(nonsense(seen).mean()) > _LARGEST_SHARE:
        return None
    off = plane_rms_px(seen)
    plane = off <= max(OUTSTANDING_RMS_PX, OUTSTANDING_RATIO * float(np.median(off)))
    if plane.all() or (~plane).mean() > _LARGEST_SHARE or plane.sum() < FEWEST_VIEWS:
        return None
    of_planes = np.flatnonzero(plane).tolist()
    found = lowest_minimum([detections[view] for view in of_planes], object_points, seen.only(plane[seen.view]), free)
    if found.failure:
        return None
    blank = facing(found.state.camera, seen)
    state = reposed(blank, seen) or blank
    state.rvecs[of_planes], state.ts[of_planes] = found.state.rvecs, found.state.ts
    return state


def plane_rms_px(seen: Observations) -> FloatArray:
    """RMS distance in pixels of each view's corners (V,) from the homography that fits them; inf where there is none."""
    points, corners = _by_view(seen.points_board[:, :2], seen), _by_view(seen.corners_px, seen)
    return np.array([_rms_px(*view) for view in zip(homographies(seen), points, corners, strict=True)])


def _by_view(values: FloatArray, seen: Observations) -> list[FloatArray]:
    """Split values of all corners (M, ...) by view."""
    return np.split(values, seen.starts[1:])


def _rms_px(H: FloatArray, points: FloatArray, corners_px: FloatArray) -> float:
    """RMS distance of corners (N, 2) from where a homography puts points (N, 2); inf where it puts one nowhere."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        x, y, w = H @ np.column_stack([points, np.ones(len(points))]).T
        off = ((np.column_stack([x / w, y / w]) - corners_px) ** 2).sum(axis=1)
    return float(np.sqrt(off.mean())) if np.isfinite(off).all() else float("inf")
