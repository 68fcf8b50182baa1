"""Refines corners with the help of a calibration: it knows where the edges run, so that only the corner's shift is left."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from camcal.boards.base import Board
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Image
from camcal.refinement.corner_model import RESPONSE, SHAPE_KNOWN
from camcal.refinement.corner_search import Found, Starts, search_corners
from camcal.refinement.corner_shapes import CornerShapes, corner_shapes
from camcal.refinement.saddle import LEAST_RADIUS_PX, RADIUS_SHARE, room_px
from camcal.refinement.verdicts import Refinement, Verdicts, finite_rows, judged

LARGEST_RADIUS_PX = 120.0
# Where the curve of an edge is sampled, as shares of the patch's radius to both sides.
_SAMPLES = np.array([-1.0, -0.75, -0.5, -0.25, 0.25, 0.5, 0.75, 1.0])
# A start farther than this share of the spacing from where the calibration sees the corner is another corner.
_LARGEST_OFFSET = 0.3


def refine_warped(
    gray: Image,
    ids: IntArray,
    corners_px: FloatArray,
    board: Board,
    *,
    camera: Camera,
    T_cam_board: Pose,
    radius_share: float = RADIUS_SHARE,
) -> Refinement:
    """Refine corners by shifting the calibrated corner, blurred and lit, over each patch.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8, uint16 or float32.
    ids : ndarray of shape (N,)
        Feature ids, int64, each at most once.
    corners_px : ndarray of shape (N, 2)
        Where to start, about 1 px or nearer; NaN is refused.
    board : Board
    camera : Camera
        As calibrated so far; only directions, curvatures and scales are taken from it, never positions.
    T_cam_board : Pose
        Of this view, from the same calibration.
    radius_share : float
        Radius of a patch as a share of the distance to the nearest feature. Up to 0.5 no pixel serves two corners, so that
        their errors stay independent.

    Returns
    -------
    Refinement
    """
    verdicts = Verdicts(len(ids))
    shapes = corner_shapes(board)
    verdicts.refuse(~finite_rows(corners_px), "its position is not a number")
    verdicts.refuse(~(room_px(gray, corners_px) >= LEAST_RADIUS_PX), "outside the image or too near its border")
    edges = calibrated_edges(ids, board, shapes, camera, T_cam_board, radius_share=radius_share)
    off = np.linalg.norm(edges.corners_px - corners_px, axis=1)
    verdicts.refuse(
        ~(off <= _LARGEST_OFFSET / radius_share * edges.radius_px), "{:.1f} px from where the calibration sees it", off
    )
    radius = np.minimum(edges.radius_px, room_px(gray, corners_px))
    radius, response = np.nan_to_num(radius), np.zeros(len(ids))
    starts = Starts(corners_px, edges.angles, edges.shape, shapes.mix[ids], radius, edges.walls_px, response)
    verdicts.refuse(starts.radius_px < LEAST_RADIUS_PX, "no room for a patch (radius {:.1f} px)", starts.radius_px)
    rows = np.flatnonzero(verdicts.ok)
    return judged(gray, starts, rows, _search(gray, starts.take(rows), share_response=shapes.has_l_corners), verdicts)


def _search(gray: Image, starts: Starts, *, share_response: bool) -> Found:
    """Fit every corner, with one response of the camera for all of them where each alone cannot tell it."""
    found = search_corners(gray, starts, SHAPE_KNOWN)
    if not share_response:
        return found
    return search_corners(gray, replace(starts, response=_shared_response(found)), SHAPE_KNOWN, (RESPONSE,))


def _shared_response(found: Found) -> FloatArray:
    """Give every corner of the image the typical response: alone, an L-corner cannot tell it from a shift of its edges."""
    good = found.converged & (found.explained > 0.9)
    return np.full(good.size, np.median(found.params[good, RESPONSE]) if good.any() else 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedEdges:
    """What a calibration says about the edges at N corners; NaN where it does not see them.

    Attributes
    ----------
    corners_px : ndarray of shape (N, 2)
        Where it sees the corners.
    angles : ndarray of shape (N, 2)
        Direction of the board's x and y, radians.
    shape : ndarray of shape (N, 2, 3)
        c2, c3, c4 of the edges along x and along y, in 1/px, 1/px², 1/px³.
    radius_px : ndarray of shape (N,)
        Radius of the patch.
    walls_px : ndarray of shape (N, 2)
        Distance from each edge at which other structure of the print begins.
    """

    corners_px: FloatArray
    angles: FloatArray
    shape: FloatArray
    radius_px: FloatArray
    walls_px: FloatArray


def calibrated_edges(
    ids: IntArray, board: Board, shapes: CornerShapes, camera: Camera, T_cam_board: Pose, *, radius_share: float
) -> CalibratedEdges:
    """Work out how the edges at some corners run in the image.

    Parameters
    ----------
    ids : ndarray of shape (N,)
    board : Board
    shapes : CornerShapes
    camera : Camera
    T_cam_board : Pose
    radius_share : float
    """
    everywhere = camera.project(T_cam_board.apply(board.object_points))
    distance = np.linalg.norm(everywhere[shapes.neighbours[ids]] - everywhere[ids, None], axis=-1)
    distance[shapes.neighbours[ids] < 0] = np.nan
    radius = np.minimum(radius_share * np.fmin.reduce(distance, axis=1), LARGEST_RADIUS_PX)
    points = board.object_points[ids]
    corners, d_point, _ = camera.project_with_jacobians(T_cam_board.apply(points))
    tangents = (d_point @ T_cam_board.R[:, :2]).swapaxes(1, 2)
    scale = np.linalg.norm(tangents, axis=2)
    units = tangents / scale[..., None]
    step_m = (radius[:, None] / scale)[..., None] * _SAMPLES
    along_axes = points[:, None, None] + step_m[..., None] * np.eye(3)[:2, None]
    curve = camera.project(T_cam_board.apply(along_axes)) - corners[:, None, None]
    along = (curve * units[:, :, None]).sum(axis=-1)
    across = curve[..., 1] * units[..., :1] - curve[..., 0] * units[..., 1:]
    sine = np.abs(units[:, 0, 0] * units[:, 1, 1] - units[:, 0, 1] * units[:, 1, 0])
    return CalibratedEdges(
        everywhere[ids],
        np.arctan2(units[..., 1], units[..., 0]),
        _bends(along, across, radius),
        radius,
        shapes.clear_m[ids, None] * scale[:, ::-1] * sine[:, None],
    )


def _bends(along: FloatArray, across: FloatArray, radius_px: FloatArray) -> FloatArray:
    """c2, c3, c4, of shape (N, 2, 3), of curves (N, 2, S) through the origin that start along their tangent."""
    unit = radius_px[:, None, None]
    powers = np.stack([(along / unit) ** k for k in (2, 3, 4)], axis=-1)
    normal = powers.swapaxes(-1, -2) @ powers
    known = np.all(np.isfinite(normal), axis=(-1, -2)) & np.all(np.isfinite(across), axis=-1)
    normal = np.where(known[..., None, None], normal, np.eye(3))
    right = (powers * across[..., None]).sum(axis=-2)
    bends = np.linalg.solve(normal, right[..., None])[..., 0] / radius_px[:, None, None] ** np.arange(2, 5)
    shape: FloatArray = np.where(known[..., None], bends, np.nan)
    return shape
