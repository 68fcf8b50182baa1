"""A partly known AprilGrid completed: missing tags looked for where the known ones say they are, corners checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.boards.aprilgrid import FAMILIES, AprilGrid, tag_ink
from camcal.detection.neighbours import without_strays
from camcal.detection.sampling import Gray
from camcal.detection.subpixel import SMALLEST_REACH_PX, refine
from camcal.detection.tags import Tags, tag_likeness
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.geometry.homography import apply_homography, homography_from_points

# Correlation that a tag must reach; other tags of the families stay below .5.
_LEAST_LIKENESS = 0.7
_CORNERS_TO_PREDICT = 16
# Farthest that a corner may lie from where its neighbours put it, as a share of the gap.
_LARGEST_STRAY = 0.3
# A corner that a smaller window puts elsewhere is none: bloomed, covered or damaged.
_SMALLER_WINDOW = 0.7
_LARGEST_SHIFT_PX = 0.3
FEWEST_CORNERS = 8
"""Corners that a view must have, however poor they are."""

# Half-window as a share of the gap where squares touch the tags: beyond .5, turned by 45°, it nears the square's other corners.
# Without squares the next tag is a gap away. In both cases its own data bits are a border away.
_REACH_WITH_SQUARES = 0.5
_REACH_ALONE = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A board as it is printed, and what is known of its tags.

    Attributes
    ----------
    board : AprilGrid
        With the border width that was seen.
    found : ndarray of shape (T,)
        Which tags are there.
    corners_px : ndarray of shape (T, 4, 2)
        Their refined corners; NaN where one is not known.
    """

    board: AprilGrid
    found: BoolArray
    corners_px: FloatArray

    @classmethod
    def nothing(cls, board: AprilGrid) -> Sighting:
        """Build the sighting of a board of which nothing is known."""
        return cls(board, np.zeros(board.tag_count, dtype=np.bool_), np.full((board.tag_count, 4, 2), np.nan))

    @classmethod
    def of_tags(cls, gray: Gray, board: AprilGrid, tags: Tags) -> Sighting:
        """Build the sighting of decoded tags, each id once, and refine their corners."""
        nothing = cls.nothing(board)
        found, corners = nothing.found.copy(), nothing.corners_px.copy()
        found[tags.ids] = True
        corners[tags.ids] = _refined(gray, board, tags.corners_px)
        return cls(board, found, corners)

    @property
    def tag_count(self) -> int:
        """Number of tags found."""
        return int(self.found.sum())


def completed(gray: Gray, sighting: Sighting) -> Sighting:
    """Look for each missing tag where its neighbours say it is, from the known ones outwards, until no more turn up."""
    board = sighting.board
    found, corners = sighting.found.copy(), sighting.corners_px.copy()
    ink = tag_ink(board.family, board.tag_count, board.border_bits)
    neighbours = _neighbours(board)
    tried_with = np.zeros(board.tag_count, dtype=np.int64)
    while True:
        known_around = neighbours @ found.astype(np.int64)
        frontier = np.flatnonzero(~found & (known_around > tried_with))
        tried_with[frontier] = known_around[frontier]
        places = {int(tag): _predicted(board, corners, int(tag)) for tag in frontier}
        new = [
            tag
            for tag, place in places.items()
            if np.isfinite(place).all() and tag_likeness(gray, ink[tag], place, board.border_bits) >= _LEAST_LIKENESS
        ]
        if not new:
            return _repaired(gray, Sighting(board, found, corners))
        found[new] = True
        corners[new] = _refined(gray, board, np.stack([places[tag] for tag in new]))


def _repaired(gray: Gray, sighting: Sighting) -> Sighting:
    """Look once more, at their predicted places, for corners that are missing or stray from their neighbours."""
    board, found = sighting.board, sighting.found
    corners = _without_strays(board, sighting.corners_px)
    lost = np.isnan(corners[..., 0]) & found[:, None]
    places = corners.copy()
    for tag in np.flatnonzero(lost.any(axis=1)):
        places[tag, lost[tag]] = _predicted(board, corners, int(tag))[lost[tag]]
    chosen = lost.any(axis=1) & np.isfinite(places).all(axis=(1, 2))
    again = _refined(gray, board, places[chosen])
    corners[chosen] = np.where(lost[chosen][..., None], again, corners[chosen])
    return Sighting(board, found, _without_strays(board, corners))


def _without_strays(board: AprilGrid, corners_px: FloatArray) -> FloatArray:
    """Corners (T, 4, 2) with NaN for each that lies off where its neighbours put it."""
    layout = board.object_points[:, :2] / (board.tag_m + board.gap_m)
    farthest = _LARGEST_STRAY * _sides(corners_px).ravel() * board.gap_m / board.tag_m
    return without_strays(layout, corners_px.reshape(-1, 2), farthest).reshape(corners_px.shape)


def dependable(gray: Gray, sighting: Sighting) -> FloatArray:
    """Corners (T, 4, 2) with NaN for each that a smaller window puts elsewhere; a poor view keeps its best ones."""
    corners = sighting.corners_px
    again = _refined(gray, sighting.board, corners, _SMALLER_WINDOW)
    shift = np.nan_to_num(np.linalg.norm(again - corners, axis=2), nan=np.inf)
    limit = max(_LARGEST_SHIFT_PX, float(np.sort(shift, axis=None)[FEWEST_CORNERS - 1]))
    return np.where((shift <= limit)[..., None], corners, np.nan)


def _neighbours(board: AprilGrid) -> IntArray:
    """Matrix (T, T): 1 where two tags lie side by side or diagonally."""
    places = board.object_points[3::4, :2] / (board.tag_m + board.gap_m)
    apart = np.abs(places[:, None] - places[None]).max(axis=2)
    near: IntArray = ((apart > 0.5) & (apart < 1.5)).astype(np.int64)
    return near


def _predicted(board: AprilGrid, corners_px: FloatArray, tag: int) -> FloatArray:
    """Where the corners (4, 2) of a tag should be: a homography through the nearest known ones, so that a lens may bend it."""
    layout = board.object_points[:, :2]
    known = np.flatnonzero(np.isfinite(corners_px[..., 0].ravel()) & (np.arange(4 * board.tag_count) // 4 != tag))
    if known.size < 4:
        return np.full((4, 2), np.nan)
    goal = layout[4 * tag : 4 * tag + 4]
    distance = np.linalg.norm(layout[known] - goal.mean(axis=0), axis=1)
    nearest = known[np.argsort(distance, kind="stable")[:_CORNERS_TO_PREDICT]]
    H = homography_from_points(layout[nearest], corners_px.reshape(-1, 2)[nearest])
    return apply_homography(H, goal)


def _refined(gray: Gray, board: AprilGrid, corners_px: FloatArray, share: float = 1.0) -> FloatArray:
    """Corners (T, 4, 2) moved to where the image has them, with a share of the window; NaN where they cannot be located."""
    reach = np.maximum(share * _reach(board) * _sides(corners_px), SMALLEST_REACH_PX)
    return refine(gray, corners_px.reshape(-1, 2), reach.ravel()).reshape(corners_px.shape)


def _sides(corners_px: FloatArray) -> FloatArray:
    """Length (T, 4) of the shorter of the two tag sides that meet at each corner."""
    after = np.linalg.norm(np.roll(corners_px, -1, axis=1) - corners_px, axis=2)
    shorter: FloatArray = np.fmin(after, np.roll(after, 1, axis=1))
    return shorter


def tag_side_px(sighting: Sighting) -> float:
    """Typical side of the tags found, in pixels; NaN if none is known."""
    sides = _sides(sighting.corners_px)
    return float(np.nanmedian(sides)) if np.isfinite(sides).any() else float("nan")


def least_tag_px(board: AprilGrid) -> float:
    """Side in pixels below which the smallest window around a tag's corner reaches what lies next to it."""
    return SMALLEST_REACH_PX / _reach(board)


def border_share(board: AprilGrid) -> float:
    """Width of a tag's black border in tag sides."""
    return board.border_bits / (FAMILIES[board.family][0] + 2 * board.border_bits)


def _reach(board: AprilGrid) -> float:
    """Half-window of the refinement in tag sides."""
    share = _REACH_WITH_SQUARES if board.squares else _REACH_ALONE
    return min(share * board.gap_m / board.tag_m, border_share(board))
