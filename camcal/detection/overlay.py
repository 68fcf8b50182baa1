"""Pictures of what was seen: the corners in the board's order with its axes, or what was half seen and why it is no board."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from camcal.boards.base import Board
from camcal.detection.canvas import Canvas, Colour
from camcal.detection.half_seen import HalfSeen
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.geometry.homography import apply_homography, homography_from_points
from camcal.observations import Detection, Image

WHITE: Colour = (255, 255, 255)
_X_AXIS: Colour = (60, 60, 255)
_Y_AXIS: Colour = (60, 220, 60)
_ORANGE: Colour = (0, 165, 255)
_YELLOW: Colour = (90, 235, 255)
_GROUND: Colour = (45, 40, 40)
_REJECTED_GROUND: Colour = (40, 30, 120)

# An axis spans this share of the board, and its place is told by so many corners next to the origin.
_AXIS_SHARE = 0.25
_CORNERS_FOR_AXES = 12
_CORNERS_FOR_SPACING = 200
# A ring is as wide as this share of the distance to the next corner, and two labels keep so many letters apart.
_RING_SHARE = 0.22
_LARGEST_RING_LINES, _LEAST_RING_LINES = 9.0, 3.0
_LABELS_APART_LETTERS = 4.5
# A corner this many times less certain than most is named.
_OUTSTANDING = 3.0


def draw_detection(image: Image, seen: Detection, board: Board, refused_px: FloatArray | None = None) -> Image:
    """Draw the corners that were found.

    Parameters
    ----------
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32, BGR order.
    seen : Detection
        Of that image.
    board : Board
    refused_px : ndarray of shape (R, 2), optional
        Where corners were seen that the refinement refused, pixels.

    Returns
    -------
    ndarray of shape (H, W, 3)
        uint8: the image, enlarged by a whole factor if it is small, with a strip of text below it. Corners are coloured in the
        order of their ids, from blue to red, and linked along rows or around tags; the board's x axis is red, its y axis green.
    """
    canvas = Canvas(image)
    colours = _colours(seen.ids, board.feature_count)
    for first in _linked(seen.ids, board):
        canvas.line(seen.corners_px[first : first + 2], colours[first])
    radius = _ring_px(canvas, seen.corners_px)
    for corner, colour in zip(seen.corners_px, colours, strict=True):
        canvas.ring(corner, radius, colour)
    for corner in np.zeros((0, 2)) if refused_px is None else refused_px:
        canvas.cross(corner, radius, _ORANGE)
    _draw_axes(canvas, seen, board)
    chosen = _labelled(seen, _LABELS_APART_LETTERS * canvas.letter_px / canvas.scale)
    canvas.labels([(seen.corners_px[row], str(seen.ids[row]), WHITE) for row in chosen])
    refused = 0 if refused_px is None else len(refused_px)
    return canvas.captioned([(_facts(seen, board, refused), WHITE), *((note, _YELLOW) for note in seen.notes)], _GROUND)


def draw_rejection(image: Image, source: str, reason: str, seen: HalfSeen) -> Image:
    """Draw what was half seen, and write why that is no board.

    Parameters
    ----------
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32, BGR order.
    source : str
        Name of the image.
    reason : str
        Why it was rejected.
    seen : HalfSeen

    Returns
    -------
    ndarray of shape (H, W, 3)
        uint8, as `draw_detection` gives it.
    """
    canvas = Canvas(image)
    if seen.grid_px.size:
        for row in (*seen.grid_px, *np.swapaxes(seen.grid_px, 0, 1)):
            canvas.line(row, _ORANGE)
    for quad in seen.tags_px:
        canvas.line(quad, _ORANGE, closed=True)
    for quad in seen.squares_px:
        canvas.line(quad, _YELLOW, closed=True)
    canvas.labels([(quad.mean(axis=0), str(one), _ORANGE) for one, quad in zip(seen.tag_ids, seen.tags_px, strict=True)])
    found = (f"seen: {seen.text}", _YELLOW if seen.squares_px.size else _ORANGE)
    return canvas.captioned([(f"{source}: rejected", WHITE), (reason, WHITE), found], _REJECTED_GROUND)


def draw_unreadable(source: str, reason: str) -> Image:
    """Draw the place of an image that cannot be read, with the reason."""
    return Canvas(np.full((270, 480), 30, dtype=np.uint8)).captioned(
        [(f"{source}: rejected", WHITE), (reason, WHITE)], _REJECTED_GROUND
    )


def _facts(seen: Detection, board: Board, refused: int) -> str:
    """The figures of a detection on one line."""
    parts = [f"{seen.source}: {len(seen)} of {board.feature_count} corners"]
    known = np.flatnonzero(np.isfinite(seen.sigma_px))
    if known.size:
        middle = float(np.median(seen.sigma_px[known]))
        parts.append(f"sigma {middle:.3f} px (median)")
        worst = int(known[seen.sigma_px[known].argmax()])
        if seen.sigma_px[worst] > _OUTSTANDING * middle:
            parts[-1] += f", {seen.sigma_px[worst]:.3f} px at worst (id {seen.ids[worst]})"
    if np.isfinite(seen.edge_width_px):
        parts.append(f"edges {seen.edge_width_px:.1f} px wide")
    if refused:
        parts.append(f"{refused} refused (orange crosses)")
    return ", ".join([*parts, "x red, y green"])


def _colours(ids: IntArray, count: int) -> list[Colour]:
    """A colour for each id, from blue to red along the board's order."""
    # The ends of the scale are too dark to be seen.
    levels = (25 + 205 * ids / max(count - 1, 1)).astype(np.uint8)
    table = cv2.applyColorMap(levels[:, None], cv2.COLORMAP_TURBO)[:, 0]
    return [(int(b), int(g), int(r)) for b, g, r in table]


def _linked(ids: IntArray, board: Board) -> list[int]:
    """Rows of the corners that are followed by their neighbour: the next id, at the shortest step there is on the board."""
    steps = np.linalg.norm(np.diff(board.object_points, axis=0), axis=1)
    near = steps < 1.01 * steps.min()
    return np.flatnonzero((np.diff(ids) == 1) & near[ids[:-1]]).tolist()


def _ring_px(canvas: Canvas, corners_px: FloatArray) -> float:
    """Radius of a corner's ring in pixels of the image."""
    some = corners_px[:: -(-len(corners_px) // _CORNERS_FOR_SPACING) or 1]
    apart = np.linalg.norm(some[:, None] - corners_px, axis=2)
    nearest = np.where(apart > 0, apart, np.inf).min(axis=1, initial=np.inf)
    share = _RING_SHARE * float(np.median(nearest)) if nearest.size else np.inf
    line = canvas.line_px / canvas.scale
    return float(np.clip(share, _LEAST_RING_LINES * line, _LARGEST_RING_LINES * line))


def _draw_axes(canvas: Canvas, seen: Detection, board: Board) -> None:
    """Draw the axes from the board's origin, or from the corner nearest to it that was seen."""
    points = board.object_points[seen.ids, :2]
    if len(points) < 4:
        return
    start = points[np.linalg.norm(points, axis=1).argmin()]
    near = np.argsort(np.linalg.norm(points - start, axis=1), kind="stable")[:_CORNERS_FOR_AXES]
    if np.linalg.matrix_rank(points[near] - start) < 2:
        near = np.arange(len(points))
    H = homography_from_points(points[near], seen.corners_px[near])
    length = _AXIS_SHARE * board.object_points[:, :2].max()
    ends = apply_homography(H, start + length * np.array([[0, 0], [1, 0], [0, 1]]))
    if np.isfinite(ends).all():
        for end, colour in ((ends[1], _X_AXIS), (ends[2], _Y_AXIS)):
            canvas.arrow(ends[0], end, colour)


def _labelled(seen: Detection, apart_px: float) -> Sequence[int]:
    """Rows of the corners whose ids are written: first and last, then as many as keep clear of each other."""
    chosen: list[int] = []
    for row in (0, len(seen) - 1, *range(1, len(seen) - 1)):
        others = seen.corners_px[chosen] - seen.corners_px[row]
        if row not in chosen and (np.linalg.norm(others, axis=1) > apart_px).all():
            chosen.append(row)
    return chosen
