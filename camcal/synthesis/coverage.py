"""Outlines to pixels: the light of a piecewise constant scene, averaged exactly over every pixel.

The image is the sum, over all segments of the outlines, of jump x height x step to the right of the segment. So each
piece of a segment leaves its mark only where it is, spread by the point spread function, and one running sum along the
rows turns the marks into light. The cost goes with the length of the outlines, not with the number of pixels.
The principle is the signed-area accumulation of font rasterisers; the blurred form replaces the pixel's box by the
box convolved with a Gaussian.
"""

from __future__ import annotations

from functools import lru_cache
from math import erf, pi, sqrt

import numpy as np

from camcal.geometry.arrays import FloatArray, IntArray
from camcal.synthesis.edges import Segments

_TAIL_SIGMAS = 4.5
_TABLE_STEPS = 1024
_CHUNK = 1 << 12
_GAUSS_LEGENDRE = 0.5 / sqrt(3)


def area_coverage(segments: Segments, shape: tuple[int, int]) -> FloatArray:
    """Average the scene over the area of each pixel, exactly.

    Parameters
    ----------
    segments : Segments
    shape : tuple of int
        Image (height, width).

    Returns
    -------
    ndarray of shape (height, width)
        Light relative to what is left of all segments.
    """
    piece, t0, t1 = _split_at_pixels(segments)
    start, along = segments.start[piece], (segments.end - segments.start)[piece]
    # Within one pixel the marks are linear in the position, so that the middle of the piece stands for all of it.
    middle = start + (0.5 * (t0 + t1))[:, None] * along
    weight = segments.jump[piece] * (t1 - t0) * along[:, 1]
    marks = _Marks(shape, reach=1)
    x, y, weight = marks.nearby(middle[:, 0], middle[:, 1], weight)
    column, row = np.floor(x + 0.5), np.floor(y + 0.5)
    right = (x + 0.5 - column) * weight
    marks.add(row, column, np.stack([weight - right, right], axis=-1)[:, None, :])
    return marks.light()


def gaussian_coverage(segments: Segments, shape: tuple[int, int], sigma_px: float) -> FloatArray:
    """Average the scene, blurred by a Gaussian, over the area of each pixel.

    Parameters
    ----------
    segments : Segments
        None much longer than 0.8 `sigma_px`: each is integrated by two Gauss-Legendre nodes.
    shape : tuple of int
        Image (height, width).
    sigma_px : float
        Standard deviation of the Gaussian in pixels, > 0.

    Returns
    -------
    ndarray of shape (height, width)
        Light relative to what is left of all segments.
    """
    along = segments.end - segments.start
    middle, half = segments.start + 0.5 * along, _GAUSS_LEGENDRE * along
    x, y = np.concatenate([middle - half, middle + half]).T
    weight = np.tile(0.5 * segments.jump * along[:, 1], 2)
    table_x, table_y = _spread_tables(sigma_px)
    marks = _Marks(shape, reach=table_x.shape[1] // 2)
    x, y, weight = marks.nearby(x, y, weight)
    for begin in range(0, x.size, _CHUNK):
        part = slice(begin, begin + _CHUNK)
        column, taps_x = _spread(table_x, x[part])
        row, taps_y = _spread(table_y, y[part])
        taps_y *= weight[part, None]
        marks.add(row, column, taps_y[:, :, None] * taps_x[:, None, :])
    return marks.light()


def gaussian_reach(sigma_px: float) -> int:
    """How far a point of an outline is felt, in pixels."""
    return int(np.ceil(_TAIL_SIGMAS * sigma_px + 1))


class _Marks:
    """Marks of segments on the pixel grid.

    A mark touches pixels up to `reach` away from its point, so points that far off the image still count; the border of
    twice that width catches what falls off the image.
    """

    def __init__(self, shape: tuple[int, int], reach: int) -> None:
        self._last = (shape[0] - 1, shape[1] - 1)
        self._reach, self._pad = reach, 2 * reach
        self._shape = (shape[0] + 2 * self._pad, shape[1] + 2 * self._pad)
        self._sum = np.zeros(self._shape[0] * self._shape[1])

    def nearby(self, x: FloatArray, y: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Keep the points that matter to the image; move those left of it onto its border, where they count as much."""
        reach, (bottom, right) = self._reach, self._last
        kept = (y > -reach) & (y < bottom + reach) & (x < right + reach) & (weight != 0)
        return np.maximum(x[kept], -reach), y[kept], weight[kept]

    def add(self, row: FloatArray, column: FloatArray, values: FloatArray) -> None:
        """Add blocks of values (N, H, W) whose top-left pixels are at (row, column), each of shape (N,)."""
        corner: IntArray = ((row + self._pad) * self._shape[1] + (column + self._pad)).astype(np.int64)
        block = np.arange(values.shape[1])[:, None] * self._shape[1] + np.arange(values.shape[2])
        index = (corner[:, None] + block.ravel()).ravel()
        if index.size:
            low = int(index.min())
            total = np.bincount(index - low, values.ravel())
            self._sum[low : low + total.size] += total

    def light(self) -> FloatArray:
        """Sum the marks along the rows."""
        light: FloatArray = np.cumsum(self._sum.reshape(self._shape), axis=1)
        return light[self._pad : -self._pad, self._pad : -self._pad]


def _split_at_pixels(segments: Segments) -> tuple[IntArray, FloatArray, FloatArray]:
    """Split segments where they cross the pixels' borders: the segment of each piece, and where it begins and ends in 0..1."""
    count = segments.jump.size
    owners, cuts = [np.arange(count)], [np.zeros(count)]
    for axis in (0, 1):
        a, b = segments.start[:, axis] + 0.5, segments.end[:, axis] + 0.5
        first = np.floor(np.minimum(a, b)) + 1
        crossings = np.maximum(np.ceil(np.maximum(a, b)) - first, 0).astype(np.intp)
        owner = np.repeat(np.arange(count), crossings)
        nth = np.arange(owner.size) - np.repeat(np.cumsum(crossings) - crossings, crossings)
        owners.append(owner)
        cuts.append((first[owner] + nth - a[owner]) / (b - a)[owner])
    owner, cut = np.concatenate(owners), np.concatenate(cuts)
    order = np.lexsort((cut, owner))
    owner, cut = owner[order], cut[order]
    following = np.append(cut[1:], 1.0)
    following[np.append(np.diff(owner) > 0, True)] = 1.0
    return owner, cut, following


def _spread(table: FloatArray, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First pixel (N,) and taps (N, T) of points at positions (N,), from the table of taps by sub-pixel phase."""
    whole = np.floor(position)
    phase = (position - whole) * _TABLE_STEPS
    cell = phase.astype(np.intp)
    part = (phase - cell)[:, None]
    low = table[cell]
    return whole - (table.shape[1] // 2 - 1), low + part * (table[cell + 1] - low)


@lru_cache(maxsize=16)
def _spread_tables(sigma_px: float) -> tuple[FloatArray, FloatArray]:
    """Taps by phase 0..1 of a mark's columns and of its rows, each of shape (steps + 1, T); every row sums to 1.

    Down the rows a mark is the Gaussian over a pixel. Along them it is the difference of the blurred, pixel-averaged step
    between neighbours, because the running sum follows.
    """
    reach = gaussian_reach(sigma_px)
    phase = np.linspace(0, 1, _TABLE_STEPS + 1)[:, None]
    edge = (np.arange(-reach, reach + 2) - 0.5 - phase) / sigma_px
    step = _normal_cdf(edge)
    ramp = sigma_px * (edge * step + _normal_pdf(edge))
    rows = np.diff(step, axis=1)[:, 1:]
    columns = np.diff(ramp, n=2, axis=1)
    tables = tuple(values / values.sum(axis=1, keepdims=True) for values in (columns, rows))
    return tables[0], tables[1]


def _normal_cdf(u: FloatArray) -> FloatArray:
    """Distribution function of the standard normal."""
    values = [0.5 * (1 + erf(v / sqrt(2))) for v in u.ravel().tolist()]
    return np.array(values).reshape(u.shape)


def _normal_pdf(u: FloatArray) -> FloatArray:
    """Density of the standard normal."""
    density: FloatArray = np.exp(-0.5 * u * u) / sqrt(2 * pi)
    return density
