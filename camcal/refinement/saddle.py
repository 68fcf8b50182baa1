"""Refines corners without knowing the camera: a blurred corner with curved edges is fitted to each patch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.boards.base import Board
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.observations import Image
from camcal.refinement.corner_model import ALL_FREE, RESPONSE
from camcal.refinement.corner_search import Starts, search_corners
from camcal.refinement.corner_shapes import DOWN, LEFT, RIGHT, UP, CornerShapes, corner_shapes
from camcal.refinement.verdicts import Refinement, Verdicts, finite_rows, judged

LARGEST_RADIUS_PX = 12.0
RADIUS_SHARE = 0.45
"""Radius of a patch as a share of the distance to the nearest feature."""

LEAST_RADIUS_PX = 3.5
# A corner this far (as a share of the distances around it) from where its neighbours say it is, is another corner.
_LARGEST_DISAGREEMENT = 0.25


def refine_saddle(gray: Image, ids: IntArray, corners_px: FloatArray, board: Board) -> Refinement:
    """Refine corners by fitting a blurred corner with two curved edges of free angle to each.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8, uint16 or float32.
    ids : ndarray of shape (N,)
        Feature ids, int64, each at most once.
    corners_px : ndarray of shape (N, 2)
        Where to start, about 1.5 px or nearer; NaN is refused.
    board : Board

    Returns
    -------
    Refinement
    """
    verdicts = Verdicts(len(ids))
    shapes = corner_shapes(board)
    verdicts.refuse(~finite_rows(corners_px), "its position is not a number")
    verdicts.refuse(~(room_px(gray, corners_px) >= LEAST_RADIUS_PX), "outside the image or too near its border")
    strangers = disagreement(ids, np.where(verdicts.ok[:, None], corners_px, np.nan), board, shapes)
    verdicts.refuse(strangers > _LARGEST_DISAGREEMENT, "the corners around it say that it is elsewhere")
    frames = local_frames(ids, np.where(verdicts.ok[:, None], corners_px, np.nan), board, shapes)
    verdicts.refuse(~finite_rows(frames.angles), "no corner next to it along an edge")
    starts = _starts(gray, ids, corners_px, frames, shapes)
    verdicts.refuse(starts.radius_px < LEAST_RADIUS_PX, "no room for a patch (radius {:.1f} px)", starts.radius_px)
    rows = np.flatnonzero(verdicts.ok)
    # Where ink fills one quadrant only, a camera's response curve looks like a shift of both edges.
    held = (RESPONSE,) if shapes.has_l_corners else ()
    return judged(gray, starts, rows, search_corners(gray, starts.take(rows), ALL_FREE, held), verdicts)


@dataclass(frozen=True, slots=True, eq=False)
class LocalFrames:
    """How the board's axes look at each corner.

    Attributes
    ----------
    angles : ndarray of shape (N, 2)
        Direction of the board's x and y in the image, radians; NaN where no neighbour tells.
    scale : ndarray of shape (N, 2)
        Pixels per metre along x and y; NaN where no neighbour tells.
    """

    angles: FloatArray
    scale: FloatArray


def local_frames(ids: IntArray, corners_px: FloatArray, board: Board, shapes: CornerShapes) -> LocalFrames:
    """Take the direction and scale of the board's axes at each corner from the corners next to it.

    Parameters
    ----------
    ids : ndarray of shape (N,)
    corners_px : ndarray of shape (N, 2)
        NaN for corners that are not to be relied on.
    board : Board
    shapes : CornerShapes
    """
    points, position = board.object_points[:, :2], _by_id(ids, corners_px, board.feature_count)
    angles, scale = np.empty((len(ids), 2)), np.empty((len(ids), 2))
    for axis, (before, after) in enumerate(((LEFT, RIGHT), (UP, DOWN))):
        ends, at = [], []
        for side in (before, after):
            other = shapes.neighbours[ids, side]
            there = position[other]
            missing = (other < 0) | np.isnan(there[:, 0])
            ends.append(np.where(missing[:, None], corners_px, there))
            at.append(np.where(missing, points[ids, axis], points[other, axis]))
        step, length = ends[1] - ends[0], at[1] - at[0]
        known = length > 0
        angles[:, axis] = np.where(known, np.arctan2(step[:, 1], step[:, 0]), np.nan)
        scale[:, axis] = np.hypot(step[:, 0], step[:, 1]) / np.where(known, length, np.nan)
    return LocalFrames(angles, scale)


def disagreement(ids: IntArray, corners_px: FloatArray, board: Board, shapes: CornerShapes) -> FloatArray:
    """How far each corner is from where the nearest of several pairs of its neighbours puts it.

    Parameters
    ----------
    ids : ndarray of shape (N,)
    corners_px : ndarray of shape (N, 2)
    board : Board
    shapes : CornerShapes

    Returns
    -------
    ndarray of shape (N,)
        Distance over the longer of the two steps involved, the least over all pairs; 0 where there is no pair.
    """
    points, position = board.object_points[:, :2], _by_id(ids, corners_px, board.feature_count)
    least = np.full(len(ids), np.inf)
    for axis, (before, after) in enumerate(((LEFT, RIGHT), (UP, DOWN))):
        one = {side: shapes.neighbours[ids, side] for side in (before, after)}
        two = {side: np.where(one[side] < 0, -1, shapes.neighbours[one[side], side]) for side in (before, after)}
        for a, b in ((one[before], one[after]), (one[before], two[before]), (one[after], two[after])):
            known = (a >= 0) & (b >= 0)
            xa, xb, x = points[a, axis], points[b, axis], points[ids, axis]
            share = (x - xa) / np.where(known, xb - xa, 1)
            predicted = position[a] + share[:, None] * (position[b] - position[a])
            lever = np.maximum(
                np.linalg.norm(position[a] - corners_px, axis=1), np.linalg.norm(position[b] - corners_px, axis=1)
            )
            off = np.linalg.norm(predicted - corners_px, axis=1) / np.where(lever > 0, lever, np.nan)
            least = np.fmin(least, np.where(known, off, np.nan))
    return np.where(np.isfinite(least), least, 0.0)


def _by_id(ids: IntArray, corners_px: FloatArray, count: int) -> FloatArray:
    """Positions by feature id: shape (count, 2), NaN where not seen."""
    position = np.full((count, 2), np.nan)
    position[ids] = corners_px
    return position


def room_px(gray: Image, corners_px: FloatArray) -> FloatArray:
    """Distance of corners (N, 2) from the outermost pixels of the image: shape (N,)."""
    last = np.array(gray.shape[::-1]) - 1
    room: FloatArray = np.minimum(corners_px, last - corners_px).min(axis=1)
    return room


def _starts(gray: Image, ids: IntArray, corners_px: FloatArray, frames: LocalFrames, shapes: CornerShapes) -> Starts:
    """Where the fit of each corner begins, and how far it may look."""
    spacing = (frames.scale * shapes.pitch_m[ids]).min(axis=1)
    radius = np.minimum(np.minimum(RADIUS_SHARE * spacing, LARGEST_RADIUS_PX), room_px(gray, corners_px))
    # What begins beside edge 1 is as far away as the print is clear along y, seen at right angles to the edge.
    sine = np.abs(np.sin(frames.angles[:, 1] - frames.angles[:, 0]))
    walls = shapes.clear_m[ids, None] * frames.scale[:, ::-1] * sine[:, None]
    shape = np.zeros((len(ids), 2, 3))
    straight = np.zeros(len(ids))
    return Starts(corners_px, frames.angles, shape, shapes.mix[ids], np.nan_to_num(radius), walls, straight)
