"""Sub-pixel refinement of corners, each over a window that its neighbours do not reach into."""

from __future__ import annotations

import cv2
import numpy as np

from camcal.detection.sampling import Gray
from camcal.geometry.arrays import FloatArray, IntArray

SMALLEST_REACH_PX = 2
"""Half-window below which a corner cannot be located."""

_LARGEST_REACH_PX = 30
# Near the border of the image a window may shrink to this share; smaller ones see too little of the corner.
_LEAST_ROOM = 0.6
# One call serves all corners of one window size; sizes this far apart (relative) are put together.
_WINDOW_STEP = 1.12
# Slight smoothing takes the pixel grid and the noise out of the gradients, more of it rounds the corners.
_SMOOTHING_PX = 1.0
_CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.005)


def refine(gray: Gray, corners_px: FloatArray, reach_px: FloatArray) -> FloatArray:
    """Move corners to where the image gradients around them meet (cv2.cornerSubPix).

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8, at full size.
    corners_px : ndarray of shape (N, 2)
        Where to start, nearer to the corner than `reach_px`.
    reach_px : ndarray of shape (N,)
        How far around a corner the image shows nothing but this corner.

    Returns
    -------
    ndarray of shape (N, 2)
        NaN for a corner that lies too near the border of the image, has too small a reach, or moved out of its reach.
    """
    windows = _half_windows(gray, corners_px, reach_px)
    refined = np.full(corners_px.shape, np.nan)
    smooth, offset = _smoothed_around(gray, corners_px[windows > 0], windows.max(initial=0))
    for half in np.unique(windows[windows > 0]).tolist():
        chosen = windows == half
        start = np.ascontiguousarray(corners_px[chosen] - offset, dtype=np.float32).reshape(-1, 1, 2)
        refined[chosen] = cv2.cornerSubPix(smooth, start, (half, half), (-1, -1), _CRITERIA).reshape(-1, 2) + offset
    with np.errstate(invalid="ignore"):
        stayed = np.linalg.norm(refined - corners_px, axis=1) <= np.maximum(windows, SMALLEST_REACH_PX)
    refined[~stayed] = np.nan
    return refined


def _smoothed_around(gray: Gray, corners_px: FloatArray, half: int) -> tuple[Gray, IntArray]:
    """The part of the image around the corners, smoothed, and the pixel (x, y) at which it begins."""
    if len(corners_px) == 0:
        return gray, np.zeros(2, dtype=np.int64)
    # Corners move by up to a half-window before they count as lost, and smoothing looks two pixels further.
    margin = 2 * half + 4
    low = np.maximum(np.floor(corners_px.min(axis=0)).astype(np.int64) - margin, 0)
    high = np.ceil(corners_px.max(axis=0)).astype(np.int64) + margin + 1
    part = gray[low[1] : high[1], low[0] : high[0]]
    smooth: Gray = cv2.GaussianBlur(part, (5, 5), _SMOOTHING_PX).astype(np.uint8, copy=False)
    return smooth, low


def _half_windows(gray: Gray, corners_px: FloatArray, reach_px: FloatArray) -> IntArray:
    """Half-windows of shape (N,): within the reach and within the image; 0 where there is no room."""
    height, width = gray.shape
    x, y = corners_px[:, 0], corners_px[:, 1]
    # cornerSubPix looks one pixel beyond its window, for the gradients.
    room = np.minimum(np.minimum(x, width - 1 - x), np.minimum(y, height - 1 - y)) - 1
    wanted = np.nan_to_num(np.minimum(np.minimum(reach_px, room), _LARGEST_REACH_PX), nan=0.0)
    ladder = _ladder()
    rung = np.searchsorted(ladder, wanted + 0.5, side="right") - 1
    fitting: IntArray = np.where(rung >= 0, ladder[np.maximum(rung, 0)], 0)
    fitting[(fitting > room) | (room < _LEAST_ROOM * np.minimum(reach_px, _LARGEST_REACH_PX))] = 0
    return fitting


def _ladder() -> IntArray:
    """Window sizes in use, increasing."""
    count = int(np.log(_LARGEST_REACH_PX / SMALLEST_REACH_PX) / np.log(_WINDOW_STEP)) + 1
    return np.unique(np.round(SMALLEST_REACH_PX * _WINDOW_STEP ** np.arange(count))).astype(np.int64)
