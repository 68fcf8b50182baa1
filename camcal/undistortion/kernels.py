"""Interpolation between pixels: linear, a cubic spline, and the spline on an image made twice as fine by Lanczos's kernel.

OpenCV's own cubic and Lanczos kernels are not used: on a plain ramp they misplace what they read by up to 0.05 and 0.03
pixels (the one has the parameter -0.75, which reproduces no ramp, the other a table of 32 positions per pixel).

Sources: Unser 1999, "Splines: a perfect fit for signal and image processing" (prefilter); Sigg and Hadwiger 2005, "Fast
third-order texture filtering" (the spline as four weighted linear interpolations).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from camcal.undistortion.scratch import Scratch

if TYPE_CHECKING:
    from camcal.observations import Image

Floats: TypeAlias = npt.NDArray[np.float32]

# The spline's prefilter falls by 0.268 per pixel: what lies farther off than this is below a quarter of 16-bit level.
_PREFILTER_RADIUS = 10
_LOBES = 6
# cv2.blendLinear divides by the sum of the weights plus 1e-5, which this makes nothing.
_BLEND_SCALE = np.float32(1024)


@dataclass(frozen=True, slots=True)
class Kernel:
    """One way to interpolate.

    Attributes
    ----------
    reach : int
        Pixels of the source around a position that its value depends on.
    needs_floats : bool
        Whether the source must be float32.
    fineness : int
        How many times finer than the source the image is that is interpolated.
    """

    reach: int
    needs_floats: bool
    fineness: int = 1

    def sample(self, source: Image, xy: Floats, out: Image, scratch: Scratch) -> None:
        """Interpolate a source of shape (h, w) or (h, w, channels) at xy (2, height, width); where they lie outside, mirror it.

        `xy` may be overwritten.
        """
        if not self.needs_floats:
            cv2.remap(source, xy[0], xy[1], cv2.INTER_LINEAR, dst=out, borderMode=cv2.BORDER_REPLICATE)
            return
        if self.fineness == 2:
            source = _twice_as_fine(source, scratch)
            xy *= 2
        coefficients = scratch.array("coefficients", source.shape, np.float32)
        taps = _prefilter()
        cv2.sepFilter2D(source, -1, taps, taps, dst=coefficients, borderType=cv2.BORDER_REFLECT_101)
        _sample_spline(coefficients, xy, out, scratch)


KERNELS: dict[str, Kernel] = {
    "linear": Kernel(reach=1, needs_floats=False),
    "cubic": Kernel(reach=_PREFILTER_RADIUS + 2, needs_floats=True),
    "lanczos": Kernel(reach=_PREFILTER_RADIUS // 2 + 1 + _LOBES + 1, needs_floats=True, fineness=2),
}


def _prefilter() -> Floats:
    """Taps that turn pixels into the coefficients of the cubic B-splines through them."""
    pole = np.sqrt(3) - 2
    away = np.abs(np.arange(-_PREFILTER_RADIUS, _PREFILTER_RADIUS + 1))
    taps = -6 * pole / (1 - pole * pole) * pole**away
    prefilter: Floats = (taps / taps.sum()).astype(np.float32)
    return prefilter


def _sample_spline(coefficients: Floats, xy: Floats, out: Image, scratch: Scratch) -> None:
    """Sum the B-splines around each position: two linear interpolations per axis, weighted."""
    # OpenCV mirrors a coordinate step by step until it is inside: far ones would take it forever.
    for axis in (0, 1):
        np.clip(xy[axis], -1, coefficients.shape[1 - axis], out=xy[axis])
    shape = (2, *xy.shape)
    positions, weights = scratch.array("positions", shape, np.float32), scratch.array("weights", shape, np.float32)
    _two_positions(xy, positions, weights, scratch)
    (x0, y0), (x1, y1) = positions
    (a0, b0), (a1, b1) = weights
    parts = [scratch.array(f"part {i}", out.shape, np.float32) for i in range(3)]
    for y, row in ((y0, parts[0]), (y1, parts[1])):
        cv2.remap(coefficients, x0, y, cv2.INTER_LINEAR, dst=row, borderMode=cv2.BORDER_REFLECT_101)
        cv2.remap(coefficients, x1, y, cv2.INTER_LINEAR, dst=parts[2], borderMode=cv2.BORDER_REFLECT_101)
        cv2.blendLinear(row, parts[2], a0, a1, dst=row)
    cv2.blendLinear(parts[0], parts[1], b0, b1, dst=out)


def _two_positions(xy: Floats, positions: Floats, weights: Floats, scratch: Scratch) -> None:
    """Write for each axis of xy (2, h, w) where the two linear interpolations read and what they weigh: (2, 2, h, w) each.

    With t the position between two pixels, the four splines weigh w0 = (1 - t)³ / 6, w1 = 2/3 - t² + t³ / 2, w2 and
    w3 = t³ / 6. The first two, w0 + w1 = 5/6 - t / 2 - t² / 2 + t³ / 3, are read at once between their pixels, and so are the
    last two.
    """
    t, square, w3 = (scratch.array(name, xy.shape, np.float32) for name in ("t", "t squared", "w3"))
    (before, after), (first, last) = positions, weights
    np.floor(xy, out=after)
    np.subtract(xy, after, out=t)
    np.multiply(t, t, out=square)
    np.multiply(square, t, out=w3)
    w3 /= 6
    np.add(t, square, out=first)
    first *= -0.5
    first += 5 / 6
    first += w3
    first += w3
    np.subtract(1, first, out=last)
    w1 = np.multiply(w3, 3, out=t)
    w1 -= square
    w1 += 2 / 3
    w1 /= first
    np.add(after, w1, out=before)
    before -= 1
    w3 /= last
    after += w3
    after += 1
    weights *= _BLEND_SCALE


def _twice_as_fine(source: Image, scratch: Scratch) -> Floats:
    """Put a pixel between every two, along both axes, by Lanczos's kernel; the last row and column stay the source's."""
    height, width = source.shape[:2]
    fine = scratch.array("fine", (2 * height - 1, 2 * width - 1, *source.shape[2:]), np.float32)
    between = (np.arange(2 * _LOBES) - (_LOBES - 0.5)).astype(np.float64)
    taps = np.sinc(between) * np.sinc(between / _LOBES)
    taps = (taps / taps.sum()).astype(np.float32)[None]
    anchor = (_LOBES - 1, 0)
    fine[::2, ::2] = source
    fine[::2, 1::2] = cv2.filter2D(source, -1, taps, anchor=anchor, borderType=cv2.BORDER_REFLECT_101)[:, :-1]
    rows = np.ascontiguousarray(fine[::2])
    fine[1::2] = cv2.filter2D(rows, -1, taps.T, anchor=anchor[::-1], borderType=cv2.BORDER_REFLECT_101)[:-1]
    return fine
