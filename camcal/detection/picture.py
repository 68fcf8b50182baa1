"""Faults of a whole picture that hide any board: too dark, overexposed, without contrast, out of focus, shaken."""

from __future__ import annotations

import cv2
import numpy as np

from camcal.detection.sampling import Gray, reduced
from camcal.geometry.arrays import FloatArray

# Longer sides of the images that are judged: boards are searched at about the first, the second shows wider blur.
_JUDGED_PX = (1024, 512)
_LEAST_CONTRAST = 30
_BLACK_LEVEL = 60
_WHITE_LEVEL = 200
_SATURATED_LEVEL = 250
# Photographs of boards have up to .15 of their pixels there.
_LARGEST_SATURATED_SHARE = 0.3

# Edges count that have at least this share of the picture's contrast within so many pixels.
_REACH_PX = 12
_STRONG_SHARE = 0.5
# The sharpest few of a hundred edge pixels, in each of six directions, if enough of them have it.
_SHARPEST_PERCENT = 2
_DIRECTIONS = 6
_FEWEST_PIXELS = 300
_DIRECTION_SHARE = 0.1
# Sharp photographs measure 3-5 pixels in their sharpest direction and up to 7 in their softest one.
_BLURRED_PX = 6.5
_SHAKEN_PX = 10.0


def picture_fault(gray: Gray) -> str:
    """Why no board could be seen in a picture, whatever it shows.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.

    Returns
    -------
    str
        A clause that ends with what to do; empty if the picture is exposed well and sharp somewhere in every direction.
    """
    for longest_px in _JUDGED_PX:
        small = reduced(gray, longest_px)
        smooth: Gray = cv2.GaussianBlur(small.gray, (3, 3), 0).astype(np.uint8, copy=False)
        fault = _exposure_fault(smooth) or _sharpness_fault(smooth, float(1 / small.scale.max()))
        if fault:
            return fault
    return ""


def _exposure_fault(smooth: Gray) -> str:
    low, high = np.percentile(smooth, (1, 99))
    levels = f"grey levels {low:.0f} to {high:.0f} of 255"
    saturated = float((smooth >= _SATURATED_LEVEL).mean())
    if high - low >= _LEAST_CONTRAST:
        if saturated < _LARGEST_SATURATED_SHARE:
            return ""
        return f"the image is overexposed ({100 * saturated:.0f} % of it is pure white): shorten the exposure"
    if high < _BLACK_LEVEL:
        return f"the image is almost black ({levels}): add light or lengthen the exposure"
    if low > _WHITE_LEVEL:
        return f"the image is almost white ({levels}): shorten the exposure"
    return f"the image has next to no contrast ({levels}): is there a board in it, lit and in focus?"


def _sharpness_fault(smooth: Gray, px: float) -> str:
    """What the widths of the strong edges tell; `px` full-size pixels are one of this picture's."""
    levels = smooth.astype(np.float32)
    gx = cv2.Sobel(levels, cv2.CV_32F, 1, 0, scale=1 / 8)
    gy = cv2.Sobel(levels, cv2.CV_32F, 0, 1, scale=1 / 8)
    box = np.ones((2 * _REACH_PX + 1, 2 * _REACH_PX + 1), np.uint8)
    rise = cv2.dilate(levels, box) - cv2.erode(levels, box)
    low, high = np.percentile(levels, (1, 99))
    slope = cv2.magnitude(gx, gy)
    edge = (rise >= _STRONG_SHARE * (high - low)) & (slope * 2 * _REACH_PX > rise)
    if np.count_nonzero(edge) < _FEWEST_PIXELS:
        return ""
    # Where an edge is steepest, its rise over the slope is its width; elsewhere that is more, but for edges that are wider
    # than the reach, at whose ends only a part of the rise is seen.
    widths = rise[edge] / slope[edge]
    sharpest = float(np.percentile(widths, _SHARPEST_PERCENT))
    if sharpest >= _BLURRED_PX:
        return f"the image is blurred (its sharpest edges are at least {sharpest * px:.0f} pixels wide): focus, and hold still"
    softest = _softest_direction(widths, np.arctan2(gy[edge], gx[edge]))
    if softest >= _SHAKEN_PX:
        width = f"edges across the motion are at least {softest * px:.0f} pixels wide, others {sharpest * px:.0f}"
        return f"the image is blurred by motion ({width}): hold the board and the camera still, or shorten the exposure"
    return ""


def _softest_direction(widths: FloatArray, angles: FloatArray) -> float:
    """Width of the sharpest edges in the direction where they are widest; angles in radians, both of shape (E,)."""
    direction = np.rint(angles * _DIRECTIONS / np.pi).astype(np.int64) % _DIRECTIONS
    fewest = max(_FEWEST_PIXELS, _DIRECTION_SHARE * widths.size)
    chosen = [widths[direction == n] for n in range(_DIRECTIONS)]
    return max((float(np.percentile(one, _SHARPEST_PERCENT)) for one in chosen if one.size >= fewest), default=0.0)
