"""How far apart two cameras are, and what may have been done to images that makes one look like the other."""

from __future__ import annotations

import numpy as np

from camcal.compare.projection import projection_difference
from camcal.errors import InputError
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera

# One kind of change stands for all if the others are so many times smaller.
_MUCH = 4.0


def median_difference_px(one: Camera, other: Camera) -> float:
    """Median difference of two cameras' projections of far points over the image; inf if they have no pixel in common."""
    try:
        return float(np.median(projection_difference(one, other).length_px))
    except InputError:
        return float("inf")


def described(camera: Camera) -> str:
    """Name focal lengths and principal point in whole pixels."""
    fx, fy, cx, cy = camera.intrinsics[:4]
    return f"fx {fx:.0f}, fy {fy:.0f}, cx {cx:.0f}, cy {cy:.0f}"


def likeness(one: Camera, other: Camera) -> str:
    """What may have been done to the images of one camera to make it look like another: a clause, or nothing."""
    size, ratio = np.array(one.size), one.intrinsics[:2] / other.intrinsics[:2]
    centre, at = one.intrinsics[2:4], other.intrinsics[2:4]
    # By how many pixels each of the three moves the image's edge or its middle.
    shift = float(np.abs(centre - at).max())
    zoom, stretch = (float(size.max() / 2 * abs(np.log(by))) for by in (np.sqrt(ratio.prod()), ratio[0] / ratio[1]))

    def much_nearer(expected: FloatArray) -> bool:
        return bool(np.abs(centre - expected).max() < shift / _MUCH)

    if zoom > _MUCH * stretch and much_nearer((at + 0.5) * ratio - 0.5):
        return ", as if rescaled"
    if zoom > _MUCH * max(stretch, shift / 2):
        return ", as if refocused or zoomed"
    if stretch > max(zoom, shift):
        return ", as if stretched"
    if shift < _MUCH * max(zoom, stretch):
        return ""
    flipped = size - 1 - at
    ways = {"mirrored left to right": [flipped[0], at[1]], "upside down": [at[0], flipped[1]], "turned by 180°": flipped}
    return f", as if {next((way for way, where in ways.items() if much_nearer(np.array(where))), 'cropped or shifted')}"
