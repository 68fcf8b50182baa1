"""From a rough corner to a fitted one: a small patch first, then a large one around what was found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.observations import Image
from camcal.refinement.corner_fit import Fit, fit_corners
from camcal.refinement.corner_model import (
    ALL_FREE,
    ANGLE_1,
    BEND_1,
    GAIN,
    LOG_BLUR,
    OFFSET,
    OVERSHOOT,
    RESPONSE,
    STRAIGHT,
    Corners,
    Patches,
    X,
    sample_patches,
)

_COARSE_RADIUS_PX = 7.0
# A camera that sharpens leaves edges steeper than a pixel's area allows, with a fringe on both sides. A fit that begins
# without a fringe does not find it: below this blur, one that begins with it (log of the blur, overshoot) is tried as well.
_SHARP_LOG_BLUR = np.log(0.65)
_SHARPENED = (np.log(0.9), -0.7)
_CLEARLY_LESS = 0.95
_FIRST_BLUR_PX = 1.3
_COARSE_WALL_PX = 2.5
_WALL_BLURS = 3.0
# Pixels farther than this from both edges tell nothing about where the corner is, only about the light: few of them will do.
_BAND_BLURS = 3.0
# They are thinned to an even lattice, x + a y = 0 modulo n, the coarser the larger the patch: (radius, n, a).
_LATTICES = ((0.0, 5, 2), (32.0, 13, 5))
# Corners that are worked on together: their arrays fit a core's cache.
_PIXELS_TOGETHER = 1 << 15


@dataclass(frozen=True, slots=True, eq=False)
class Starts:
    """Where the search of N corners begins.

    Attributes
    ----------
    corners_px : ndarray of shape (N, 2)
    angles : ndarray of shape (N, 2)
        Direction of the tangents of both edges in the image, radians.
    shape : ndarray of shape (N, 2, 3)
        c2, c3, c4 of both edges in 1/px, 1/px², 1/px³.
    mix : ndarray of shape (N, 3)
        As `corner_model.Corners` has it.
    radius_px : ndarray of shape (N,)
        Largest radius of the patch.
    walls_px : ndarray of shape (N, 2)
        Distance from each edge, on both of its sides, at which other structure of the print begins.
    response : ndarray of shape (N,)
        How the camera bends grey values (see `corner_model.Corners`), for a fit that holds it.
    """

    corners_px: FloatArray
    angles: FloatArray
    shape: FloatArray
    mix: FloatArray
    radius_px: FloatArray
    walls_px: FloatArray
    response: FloatArray

    def corners(self, params: FloatArray) -> Corners:
        """Return the corners with some parameters."""
        return Corners(params, self.shape[:, :, 1], self.shape[:, :, 2], self.mix)

    def take(self, rows: IntArray) -> Starts:
        """Return some of them."""
        return Starts(*(getattr(self, name)[rows] for name in self.__slots__))


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """What the search came to, for N corners.

    Attributes
    ----------
    corners_px : ndarray of shape (N, 2)
    covariance : ndarray of shape (N, 2, 2)
        px²; NaN where it is not determined.
    params : ndarray of shape (N, 14)
        As `corner_model.Corners` has them, but for x and y.
    noise, explained, brightest : ndarray of shape (N,)
        As `corner_fit.Fit` has them.
    converged : ndarray of shape (N,)
    """

    corners_px: FloatArray
    covariance: FloatArray
    params: FloatArray
    noise: FloatArray
    explained: FloatArray
    brightest: FloatArray
    converged: BoolArray


def search_corners(gray: Image, starts: Starts, count: int, held: Sequence[int] = ()) -> Found:
    """Fit every corner.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8, uint16 or float32.
    starts : Starts
        All finite, each at least 2 px inside the image.
    count : int
        Leading parameters to fit: `SHAPE_KNOWN` keeps angles and shape, `ALL_FREE` fits angles and c2.
    held : sequence of int
        Columns of parameters that are not fitted all the same.

    Returns
    -------
    Found
    """
    total = len(starts.corners_px)
    found = Found(
        np.full((total, 2), np.nan),
        np.full((total, 2, 2), np.nan),
        np.full((total, ALL_FREE), np.nan),
        np.full(total, np.nan),
        np.full(total, np.nan),
        np.full(total, np.nan),
        np.zeros(total, dtype=bool),
    )
    for rows in _lots(starts.radius_px):
        part = starts.take(rows)
        fit, centre = _fit(gray, part, count, held)
        found.corners_px[rows] = centre + fit.corners.params[:, X : X + 2]
        found.covariance[rows], found.params[rows] = fit.covariance, fit.corners.params
        found.noise[rows], found.explained[rows] = fit.noise, fit.explained
        found.brightest[rows], found.converged[rows] = fit.brightest, fit.converged
    return found


def _lots(radius_px: FloatArray) -> Iterator[IntArray]:
    """Corners of similar radius, as many at a time as fit the cache."""
    order = np.argsort(radius_px, kind="stable")
    begin = 0
    while begin < order.size:
        pixels = 3 * np.minimum(radius_px[order[begin:]], 12) ** 2
        several = max(1, int((np.arange(1, pixels.size + 1) * pixels <= _PIXELS_TOGETHER).sum()))
        yield order[begin : begin + several]
        begin += several


def _fit(gray: Image, starts: Starts, count: int, held: Sequence[int]) -> tuple[Fit, IntArray]:
    """Fit a lot of corners: the fit and the pixels that it is relative to."""
    params, centre = _coarse(gray, starts, count)
    blur = np.exp(params[:, LOG_BLUR])
    band = np.inf if count == ALL_FREE else _BAND_BLURS * blur + 0.5
    patches = cut_patches(gray, centre, starts, radius_px=starts.radius_px, band_px=band, margin_px=_WALL_BLURS * blur)
    if RESPONSE in held:
        params[:, RESPONSE] = starts.response
    return fit_corners(patches, starts.corners(params), count, held), centre


def _coarse(gray: Image, starts: Starts, count: int) -> tuple[FloatArray, IntArray]:
    """Fit small patches: the parameters, relative to the pixels nearest to the corners found, and those pixels."""
    few = min(count, STRAIGHT)
    small = np.minimum(starts.radius_px, _COARSE_RADIUS_PX)
    centre = np.rint(starts.corners_px).astype(np.int64)
    patches = cut_patches(gray, centre, starts, radius_px=small, band_px=np.inf, margin_px=np.full(len(small), _COARSE_WALL_PX))
    params = np.zeros((len(small), ALL_FREE))
    params[:, X : X + 2] = starts.corners_px - centre
    params[:, LOG_BLUR] = np.log(_FIRST_BLUR_PX)
    params[:, OFFSET], params[:, GAIN] = _levels(patches)
    params[:, ANGLE_1:BEND_1], params[:, BEND_1:] = starts.angles, starts.shape[:, :, 0]
    plain = fit_corners(patches, starts.corners(params), few, (OVERSHOOT, RESPONSE), rough=True)
    params = plain.corners.params.copy()
    sharp = np.flatnonzero(params[:, LOG_BLUR] < _SHARP_LOG_BLUR)
    if sharp.size:
        again = params[sharp]
        again[:, LOG_BLUR], again[:, OVERSHOOT] = _SHARPENED
        sharpened = fit_corners(patches.take(sharp), starts.take(sharp).corners(again), few, (RESPONSE,), rough=True)
        better = sharpened.cost < _CLEARLY_LESS * plain.cost[sharp]
        params[sharp[better]] = sharpened.corners.params[better]
    nearer = np.clip(params[:, X : X + 2], -_COARSE_RADIUS_PX, _COARSE_RADIUS_PX)
    moved = np.rint(nearer).astype(np.int64)
    params[:, X : X + 2] = nearer - moved
    return params, centre + moved


def cut_patches(
    gray: Image,
    centre: IntArray,
    starts: Starts,
    *,
    radius_px: FloatArray,
    band_px: FloatArray | float,
    margin_px: FloatArray,
) -> Patches:
    """Cut the pixels that matter out of an image.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
    centre : ndarray of shape (C, 2)
        Pixels.
    starts : Starts
        Their angles, shape and walls are used.
    radius_px : ndarray of shape (C,)
    band_px : ndarray of shape (C,) or float
        All pixels this near to an edge, but only a few beyond.
    margin_px : ndarray of shape (C,)
        How far to stay away from the walls.
    """
    x, y = _disc(int(np.ceil(radius_px.max())))
    height, width = gray.shape
    column, row = centre[:, :1] + x, centre[:, 1:] + y
    kept = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    kept &= x * x + y * y <= (radius_px * radius_px)[:, None]
    fx, fy = x.astype(np.float32), y.astype(np.float32)
    in_band = np.zeros_like(kept)
    for edge in (0, 1):
        cosine, sine = (f(starts.angles[:, edge, None]).astype(np.float32) for f in (np.cos, np.sin))
        across = cosine * fy - sine * fx
        kept &= np.abs(across) <= (starts.walls_px[:, edge] - margin_px)[:, None]
        if np.ndim(band_px):
            along = cosine * fx + sine * fy
            c2, c3, c4 = (starts.shape[:, edge, k, None].astype(np.float32) for k in range(3))
            across -= along * along * (c2 + along * (c3 + along * c4))
            in_band |= np.abs(across) <= np.asarray(band_px)[:, None]
    if np.ndim(band_px):
        step, skew = next((n, a) for least, n, a in reversed(_LATTICES) if radius_px.min() >= least)
        kept &= in_band | ((x + skew * y) % step == 0)
    return _packed(gray, centre, x, y, kept)


def _packed(gray: Image, centre: IntArray, x: IntArray, y: IntArray, kept: BoolArray) -> Patches:
    """Patches of the pixels kept, of shape (C, P), moved to the front of their rows."""
    row, which = np.nonzero(kept)
    counts = kept.sum(axis=1)
    place = np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)
    shape = (len(centre), max(1, int(counts.max())))
    dx, dy, weight = np.zeros(shape, np.int64), np.zeros(shape, np.int64), np.zeros(shape, np.float32)
    dx[row, place], dy[row, place], weight[row, place] = x[which], y[which], 1.0
    return sample_patches(gray, centre, dx, dy, weight)


@lru_cache(maxsize=64)
def _disc(radius: int) -> tuple[IntArray, IntArray]:
    """Offsets of the pixels of a disc, nearest first."""
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    squared = (x * x + y * y).ravel()
    order = np.argsort(squared, kind="stable")
    order = order[squared[order] <= radius * radius]
    return x.ravel()[order], y.ravel()[order]


def _levels(patches: Patches) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation of the patches: where offset and gain begin."""
    pixels = np.maximum(patches.weight.sum(axis=1, dtype=np.float64), 1)
    mean = patches.values.sum(axis=1, dtype=np.float64) / pixels
    off = (patches.values - mean[:, None]) * patches.weight
    return mean, np.sqrt((off**2).sum(axis=1) / pixels)
