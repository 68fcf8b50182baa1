"""Finds a checkerboard: a chain of OpenCV's finders on a reduced image, each answer checked, then refined at full size."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from camcal.boards.checkerboard import Checkerboard
from camcal.detection.blur import Edges, blur_notes, edge_width_px
from camcal.detection.grid import (
    clear_corners,
    continues,
    contrasts,
    grown,
    is_grid,
    leaves_image,
    oriented,
    right_handed,
    spacing_px,
    trimmed,
)
from camcal.detection.sampling import Gray, Reduced, reduced
from camcal.detection.subpixel import refine
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.observations import Detection, Rejected

# Longer side of the images that are searched. The finders' time explodes on textured images beyond a megapixel.
_SEARCH_PX = 800
_FINE_SEARCH_PX = 1152
_COARSE_SEARCH_PX = 480
# Where the survey looks for boards of any size: longer side of the image, and the smallest grid taken for a start.
_SURVEYS = ((480, (5, 4)), (640, (4, 3)))

# Half-window of the refinement as a share of the distance to the nearest corner: wider ones reach curved edges, glare and
# the neighbours' squares, narrower ones see less of the edges.
_REACH = 0.22
# Share of the spacing to either side of an edge that shows one square each.
_EDGE_REACH = 0.4
_LEAST_SHARE_REFINED = 0.9
_LEAST_SPACING_PX = 7.0
# What the survey reports must be big enough not to be a chance of texture.
_LEAST_SURVEYED = 12

# The sector-based finder clusters with random numbers; OpenCV's generator belongs to the thread.
_SEED = 0

_CLASSIC = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE

_Grid = tuple[FloatArray, BoolArray]
"""Corners of shape (rows, columns, 2) in full-size pixels, read as printed, and which of them (rows, columns) are clear."""

Finder = Callable[[Gray, tuple[int, int]], FloatArray | None]
"""(gray, (columns, rows)) -> corners of shape (rows, columns, 2) in some order, or None."""


def detect_checkerboard(gray: Gray, board: Checkerboard, source: str) -> Detection | Rejected:
    """Find all inner corners of a checkerboard.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    board : Checkerboard
    source : str
        Name of the image.

    Returns
    -------
    Detection or Rejected
        Feature 0 has a black square up-left of it (as printed) wherever the board allows it; the board is never mirrored.
    """
    found = _find(gray, board.columns, board.rows)
    if isinstance(found, str):
        return Rejected(source, found)
    grid, clear = found
    spacing = spacing_px(grid)
    refined = refine(gray, np.where(clear[..., None], grid, np.nan).reshape(-1, 2), _REACH * spacing.ravel())
    ids = np.flatnonzero(np.isfinite(refined[:, 0]))
    if ids.size < _LEAST_SHARE_REFINED * board.feature_count:
        return Rejected(source, _why_not_refined(ids.size, board, float(np.median(spacing))))
    height, width = gray.shape
    edge_width = edge_width_px(gray, _edges(grid))
    return Detection(source, (width, height), ids, refined[ids], np.full(ids.size, np.nan), blur_notes(edge_width), edge_width)


def _find(gray: Gray, columns: int, rows: int) -> _Grid | str:
    """The board's corners in full-size pixels, or the reason why there are none."""
    if min(gray.shape) < 2 * (min(columns, rows) + 1) or max(gray.shape) < 2 * (max(columns, rows) + 1):
        height, width = gray.shape
        return f"the image is too small for the board (got {width}x{height} pixels for {columns}x{rows} corners)"
    grid = _search(reduced(gray, _SEARCH_PX), _classic, columns, rows)
    if grid is not None:
        return grid
    # The survey comes before the thorough finders: those take seconds on a board that is larger than the one asked for.
    seen, complete = _survey(gray)
    if sorted(seen.shape[:2]) == sorted((rows, columns)) and complete:
        search = reduced(gray, _SEARCH_PX)
        return _as_printed(search, search.from_full(seen), columns, rows)
    if not _is_another(gray, seen, columns, rows):
        for longest_px, finder in _THOROUGH:
            grid = _search(reduced(gray, longest_px), finder, columns, rows)
            if grid is not None:
                return grid
    return _why_not_found(gray, seen, columns, rows)


def _search(search: Reduced, finder: Finder, columns: int, rows: int) -> _Grid | None:
    """What a finder finds, if it stands up to a check."""
    found = finder(search.gray, (columns, rows))
    if found is None:
        return None
    found = right_handed(found)
    values = contrasts(search.gray, found)
    if not is_grid(found, values) or continues(search.gray, found):
        return None
    return _as_printed(search, found, columns, rows)


def _as_printed(search: Reduced, grid: FloatArray, columns: int, rows: int) -> _Grid:
    """Read a right-handed grid of the reduced image the way its board is printed."""
    printed, values = oriented(grid, contrasts(search.gray, grid), columns, rows)
    return search.to_full(printed), clear_corners(values)


def _classic(gray: Gray, size: tuple[int, int]) -> FloatArray | None:
    found, corners = cv2.findChessboardCorners(gray, size, flags=_CLASSIC)
    return _as_grid(corners, size) if found else None


def _classic_cautious(gray: Gray, size: tuple[int, int]) -> FloatArray | None:
    found, corners = cv2.findChessboardCorners(gray, size, flags=_CLASSIC | cv2.CALIB_CB_FAST_CHECK)
    return _as_grid(corners, size) if found else None


def _sectors(gray: Gray, size: tuple[int, int], flags: int = 0) -> FloatArray | None:
    cv2.setRNGSeed(_SEED)
    found, corners = cv2.findChessboardCornersSB(gray, size, flags=flags | cv2.CALIB_CB_EXHAUSTIVE)
    return _as_grid(corners, size) if found else None


def _sectors_normalised(gray: Gray, size: tuple[int, int]) -> FloatArray | None:
    return _sectors(gray, size, cv2.CALIB_CB_NORMALIZE_IMAGE)


_THOROUGH: tuple[tuple[int, Finder], ...] = (
    (_SEARCH_PX, _sectors),
    (_FINE_SEARCH_PX, _classic_cautious),
    (_COARSE_SEARCH_PX, _sectors_normalised),
)


def _as_grid(corners: npt.ArrayLike, size: tuple[int, int]) -> FloatArray:
    columns, rows = size
    return np.asarray(corners, dtype=np.float64).reshape(rows, columns, 2)


def _survey(gray: Gray) -> tuple[FloatArray, bool]:
    """The largest checkerboard of any size in the image.

    Returns
    -------
    grid : ndarray of shape (R, C, 2)
        Its corners in full-size pixels; shape (0, 0, 2) if there is none.
    complete : bool
        Whether every corner of it looks like one.
    """
    best, complete = np.zeros((0, 0, 2)), False
    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_NORMALIZE_IMAGE
    for longest_px, smallest in _SURVEYS:
        search = reduced(gray, longest_px)
        cv2.setRNGSeed(_SEED)
        found, corners, meta = cv2.findChessboardCornersSBWithMeta(search.gray, smallest, flags)
        if not found:
            continue
        grid = trimmed(search.gray, right_handed(_as_grid(corners, (meta.shape[1], meta.shape[0]))))
        if min(grid.shape[:2]) < 3 or not is_grid(grid, contrasts(search.gray, grid)):
            continue
        grid = grown(search.gray, grid)
        if grid.size > best.size:
            best, complete = search.to_full(grid), is_grid(grid, contrasts(search.gray, grid))
    return best, complete


def _is_another(gray: Gray, seen: FloatArray, columns: int, rows: int) -> bool:
    """Whether what was seen settles that another size was asked for: a larger board, or squares were counted."""
    have, want = sorted(seen.shape[:2]), sorted((rows, columns))
    larger = have != want and have[0] >= want[0] and have[1] >= want[1]
    return larger or ([n + 1 for n in have] == want and not _is_cut(gray, seen, columns, rows))


def _is_cut(gray: Gray, seen: FloatArray, columns: int, rows: int) -> bool:
    """Whether all that is missing of a board would lie outside the image."""
    sides = sorted(zip(seen.shape[:2], leaves_image(gray, seen), strict=True))
    missing = [(leaves, have < want) for (have, leaves), want in zip(sides, sorted((rows, columns)), strict=True)]
    return any(short for _, short in missing) and all(leaves for leaves, short in missing if short)


def _why_not_found(gray: Gray, seen: FloatArray, columns: int, rows: int) -> str:
    """The reason, given the largest checkerboard that was seen."""
    asked = f"{columns}x{rows}"
    have, want = sorted(seen.shape[:2]), sorted((rows, columns))
    if have[0] * have[1] < _LEAST_SURVEYED:
        return (
            f"no checkerboard found: all {asked} inner corners must be in the image, sharp and evenly lit, "
            "with white paper around the outer squares"
        )
    if have == want:
        return f"a board of {asked} inner corners was seen, but not clearly enough: is part of it hidden or in glare?"
    # Name the sides in the order of the question.
    high, wide = (have[1], have[0]) if rows > columns else (have[0], have[1])
    what = f"{wide}x{high} inner corners"
    if have[0] > want[0] or have[1] > want[1]:
        return f"a board of {what} was seen, {asked} was asked for"
    if _is_cut(gray, seen, columns, rows):
        return f"only {what} of {asked} are in the image: the board is cut by the frame"
    if [n + 1 for n in have] == want:
        return f"a board of {what} was seen, {asked} was asked for: were squares counted instead of inner corners?"
    return f"only {what} of {asked} were seen: is part of the board hidden or in glare, or is it a smaller board?"


def _why_not_refined(count: int, board: Checkerboard, spacing: float) -> str:
    if spacing < _LEAST_SPACING_PX:
        return f"the board is too small in the image (squares of {spacing:.1f} pixels, expected at least {_LEAST_SPACING_PX:g})"
    return (
        f"only {count} of {board.feature_count} corners are clear enough to be located: is the board blurred or at the border?"
    )


def _edges(grid: FloatArray) -> tuple[Edges, Edges]:
    """The squares' edges along the rows and down the columns; the outer squares' outer ones are left out."""
    spacing = _EDGE_REACH * spacing_px(grid)
    along = Edges(grid[:, :-1].reshape(-1, 2), grid[:, 1:].reshape(-1, 2), np.minimum(spacing[:, :-1], spacing[:, 1:]).ravel())
    down = Edges(grid[:-1].reshape(-1, 2), grid[1:].reshape(-1, 2), np.minimum(spacing[:-1], spacing[1:]).ravel())
    return along, down
