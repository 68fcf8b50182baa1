"""Finds a checkerboard: a chain of OpenCV's finders on a reduced image, each answer checked, then refined at full size."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import numpy.typing as npt

from camcal.boards.checkerboard import Checkerboard
from camcal.detection.blur import Edges, blur_notes, edge_width_px
from camcal.detection.causes import too_small, why_no_checkerboard
from camcal.detection.grid import (
    clear_corners,
    continues,
    contrasts,
    is_grid,
    oriented,
    right_handed,
    spacing_px,
)
from camcal.detection.sampling import Gray, Reduced, reduced
from camcal.detection.subpixel import refine
from camcal.detection.survey import survey
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.observations import Detection, Rejected

# Longer side of the images that are searched. The finders' time explodes on textured images beyond a megapixel.
_SEARCH_PX = 800
_FINE_SEARCH_PX = 1152
_COARSE_SEARCH_PX = 480

# Half-window of the refinement as a share of the distance to the nearest corner: wider ones reach curved edges, glare and
# the neighbours' squares, narrower ones see less of the edges.
_REACH = 0.22
# Share of the spacing to either side of an edge that shows one square each.
_EDGE_REACH = 0.4
_LEAST_SHARE_REFINED = 0.9
_LEAST_SPACING_PX = 7.0

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
    found = _find(gray, board)
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


def _find(gray: Gray, board: Checkerboard) -> _Grid | str:
    """The board's corners in full-size pixels, or the reason why there are none."""
    columns, rows = size = board.columns, board.rows
    if min(gray.shape) < 2 * (min(size) + 1) or max(gray.shape) < 2 * (max(size) + 1):
        height, width = gray.shape
        return f"the image is too small for the board (got {width}x{height} pixels for {columns}x{rows} corners)"
    grid = _search(reduced(gray, _SEARCH_PX), _classic, columns, rows)
    if grid is not None:
        return grid
    # The survey comes before the thorough finders: those take seconds on a board that is larger than the one asked for.
    seen = survey(gray)
    if seen.sides == (min(size), max(size)) and seen.complete:
        search = reduced(gray, _SEARCH_PX)
        return _as_printed(search, search.from_full(seen.grid), columns, rows)
    if not (seen.contains(size) or seen.counts_squares(size)):
        for longest_px, finder in _THOROUGH:
            grid = _search(reduced(gray, longest_px), finder, columns, rows)
            if grid is not None:
                return grid
    return why_no_checkerboard(gray, board, seen)


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


def _why_not_refined(count: int, board: Checkerboard, spacing: float) -> str:
    if spacing < _LEAST_SPACING_PX:
        return too_small("squares", spacing, _LEAST_SPACING_PX)
    return (
        f"too few corners are clear enough to be located ({count} of {board.feature_count}): is the board blurred, "
        "in glare or at the border?"
    )


def _edges(grid: FloatArray) -> tuple[Edges, Edges]:
    """The squares' edges along the rows and down the columns; the outer squares' outer ones are left out."""
    spacing = _EDGE_REACH * spacing_px(grid)
    along = Edges(grid[:, :-1].reshape(-1, 2), grid[:, 1:].reshape(-1, 2), np.minimum(spacing[:, :-1], spacing[:, 1:]).ravel())
    down = Edges(grid[:-1].reshape(-1, 2), grid[1:].reshape(-1, 2), np.minimum(spacing[:-1], spacing[1:]).ravel())
    return along, down
