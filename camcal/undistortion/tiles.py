"""Tiles: rectangles of a target's pixels with the float32 source coordinates that lattices give them.

Coordinates count from a tile's own window of the source, so that float32 rounds them to some 1e-5 pixels whatever the
size of the image, and what is resampled stays in the processor's cache.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.geometry.camera import Camera
from camcal.undistortion.lattice import (
    BLIND,
    COLUMNS,
    EXACT,
    ROWS,
    Lattice,
    build_lattices,
    cubic_weights,
    look,
    without_lenses,
)

FloatMap: TypeAlias = npt.NDArray[np.float32]
Floats: TypeAlias = npt.NDArray[np.float32] | npt.NDArray[np.float64]
Window: TypeAlias = tuple[int, int, int, int]

OUTSIDE_PX = -1e6
"""Coordinate of a pixel that sees nothing."""

# OpenBLAS runs products of up to this many multiplications on the calling thread; its own threads would only spin.
_LARGEST_PRODUCT = 262_144
# Pixels along a row that are interpolated at once, from the few nodes around them.
_STRIP = 128


@dataclass(frozen=True, slots=True, eq=False)
class Smooth:
    """Coordinates that vary smoothly over a rectangle of (height, width) pixels, as products of small matrices.

    Attributes
    ----------
    down : ndarray of shape (2, height, N)
    across : ndarray of shape (2, N, width)
        x is down[0] @ across[0] and y is down[1] @ across[1]; float32.
    """

    down: FloatMap
    across: FloatMap

    def write(self, xy: FloatMap) -> None:
        """Write x and y into an array (2, height, width)."""
        _multiply(self.down, self.across, xy)


@dataclass(frozen=True, slots=True, eq=False)
class Rough:
    """What of a rectangle of pixels is not smooth.

    Attributes
    ----------
    blind : ndarray of shape (height, width)
        Whether the pixel's cell sees nothing.
    exact : ndarray of shape (N,)
        Flat indices of pixels that were computed one by one.
    exact_px : ndarray of shape (N, 2)
        Their source coordinates; NaN where they see nothing.
    """

    blind: BoolArray
    exact: IntArray
    exact_px: FloatArray

    @property
    def sees_everywhere(self) -> bool:
        """Whether every pixel sees something."""
        return not self.blind.any() and bool(np.isfinite(self.exact_px).all())

    def put_in(self, xy: FloatArray) -> None:
        """Replace coordinates (2, height, width) of the source; NaN where a pixel sees nothing."""
        np.copyto(xy, np.nan, where=self.blind)
        xy.reshape(2, -1)[:, self.exact] = self.exact_px.T

    def write(self, xy: FloatMap, origin: tuple[int, int]) -> None:
        """Replace coordinates (2, height, width), which count from `origin`."""
        np.copyto(xy, OUTSIDE_PX, where=self.blind)
        xy.reshape(2, -1)[:, self.exact] = np.nan_to_num(self.exact_px - origin, nan=OUTSIDE_PX).T


@dataclass(frozen=True, slots=True, eq=False)
class Tile:
    """A rectangle of a target's pixels and where they look.

    Attributes
    ----------
    top, left, height, width : int
        The rectangle in the target.
    window : tuple of int
        (left, top, right, bottom) of the source's pixels that its valid pixels look between, one more on each side where
        there is one; right and bottom exclusive.
    whole : bool
        Whether every pixel is valid.
    smooth : Smooth or None
        None if no pixel is valid.
    rough : Rough or None
        None if all is smooth.
    """

    top: int
    left: int
    height: int
    width: int
    window: Window = (0, 0, 0, 0)
    whole: bool = False
    smooth: Smooth | None = None
    rough: Rough | None = None

    @property
    def sees_nothing(self) -> bool:
        """Whether no pixel is valid."""
        return self.smooth is None

    def coordinates(self, out: FloatMap | None = None) -> FloatMap:
        """Source coordinates of the pixels, counted from the top left of the window.

        Parameters
        ----------
        out : ndarray of shape (2, height, width), optional
            float32; where to write them.

        Returns
        -------
        ndarray of shape (2, height, width)
            x and y, float32; `OUTSIDE_PX` where a pixel sees nothing. One that sees past the source's border may have any
            value out there.
        """
        xy = np.empty((2, self.height, self.width), np.float32) if out is None else out
        if self.smooth is None:
            xy.fill(OUTSIDE_PX)
        else:
            self.smooth.write(xy)
        if self.rough is not None:
            self.rough.write(xy, self.window[:2])
        return xy

    def is_valid(self, xy: FloatMap, low_px: FloatArray, high_px: FloatArray) -> BoolArray:
        """Tell which pixels look between two corners of the source, from their `coordinates`: shape (height, width)."""
        (left, top), (right, bottom) = ((corner - self.window[:2]).tolist() for corner in (low_px, high_px))
        x, y = xy
        valid: BoolArray = (x >= left) & (x <= right) & (y >= top) & (y <= bottom)
        return valid


def make_tiles(source: Camera, target: Camera, low_px: FloatArray, high_px: FloatArray) -> tuple[Tile, ...]:
    """Cover a target with tiles, row by row.

    Parameters
    ----------
    source, target : Camera
    low_px, high_px : ndarray of shape (2,)
        Source coordinates between which a pixel is valid.
    """
    width, height = target.size
    corners = np.array([(left, top) for top in range(0, height, ROWS) for left in range(0, width, COLUMNS)])
    slope, offset = without_lenses(source, target)
    tiles = []
    for (left, top), lattice in zip(corners.tolist(), build_lattices(source, target, corners), strict=True):
        tile = Tile(top, left, min(ROWS, height - top), min(COLUMNS, width - left))
        if not (lattice.kinds == BLIND).all():
            rough = _rough(lattice, tile, source, target)
            tile = _looking(tile, lattice, rough, (slope, offset + slope * (left, top)), (source.size, low_px, high_px))
        tiles.append(tile)
    return tuple(tiles)


def _looking(
    tile: Tile,
    lattice: Lattice,
    rough: Rough | None,
    straight: tuple[FloatArray, FloatArray],
    seen: tuple[tuple[int, int], FloatArray, FloatArray],
) -> Tile:
    """Complete a tile, given slope and offset without lenses, and the source's size and its range of valid coordinates."""
    (slope, offset), (size, low_px, high_px) = straight, seen
    down, across = _products(lattice, tile, slope)
    first, last = _extent(down, across, offset, rough)
    if not ((last >= low_px) & (first <= high_px)).all():
        return tile
    left, top = np.clip(np.floor(first) - 1, 0, np.array(size) - 1).astype(int).tolist()
    right, bottom = np.clip(np.floor(last) + 3, 1, size).astype(int).tolist()
    across[0, -1] += offset[0] - left
    down[1, :, -1] += offset[1] - top
    return replace(
        tile,
        window=(left, top, right, bottom),
        whole=bool((first >= low_px).all() and (last <= high_px).all()) and (rough is None or rough.sees_everywhere),
        smooth=Smooth(down.astype(np.float32), across.astype(np.float32)),
        rough=rough,
    )


def _products(lattice: Lattice, tile: Tile, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Matrices as in `Smooth`, float64, whose products are slope * (u, v) and the lattice's shifts.

    The way without lenses comes last in the sums, so that float32 rounds once what is large.
    """
    weights_v, weights_u = _weights(tile.height, lattice.step), _weights(_STRIP, lattice.step).T
    nodes = weights_v.shape[1]
    down, across = np.empty((2, tile.height, nodes + 1)), np.empty((2, nodes + 1, tile.width))
    down[:, :, :-1] = weights_v
    for left in range(0, tile.width, _STRIP):
        width = min(_STRIP, tile.width - left)
        first = left // lattice.step
        around = lattice.shifts[:, :nodes, first : first + len(weights_u)]
        np.matmul(around, weights_u[:, :width], out=across[:, :-1, left : left + width])
    down[0, :, -1] = across[1, -1] = 1
    across[0, -1] = slope[0] * np.arange(tile.width)
    down[1, :, -1] = slope[1] * np.arange(tile.height)
    return down, across


def _extent(down: FloatArray, across: FloatArray, offset: FloatArray, rough: Rough | None) -> tuple[FloatArray, FloatArray]:
    """Least and largest x and y of a tile, (2,) each; NaN where it sees nothing.

    Where all is smooth and the lens has not folded, neither has an extremum inside: those on the border are found.
    """
    if rough is not None:
        every = np.empty((2, down.shape[1], across.shape[2]))
        _multiply(down, across, every)
        every += offset[:, None, None]
        rough.put_in(every)
        flat = every.reshape(2, -1)
        return np.fmin.reduce(flat, axis=1), np.fmax.reduce(flat, axis=1)
    rows, columns = down[:, [0, -1]] @ across, down @ across[:, :, [0, -1]]
    border = np.concatenate([rows.reshape(2, -1), columns.reshape(2, -1)], axis=1)
    return border.min(axis=1) + offset, border.max(axis=1) + offset


def _rough(lattice: Lattice, tile: Tile, source: Camera, target: Camera) -> Rough | None:
    """Compute the pixels of a tile's cells that are not interpolated."""
    if not lattice.kinds.any():
        return None
    kinds = lattice.kinds.repeat(lattice.step, axis=0).repeat(lattice.step, axis=1)[: tile.height, : tile.width]
    v, u = np.nonzero(kinds == EXACT)
    return Rough(kinds == BLIND, v * tile.width + u, look(source, target, np.stack([tile.left + u, tile.top + v], axis=-1)))


@lru_cache(maxsize=64)
def _weights(count: int, step: int) -> FloatArray:
    """Weights (count, N) of the nodes around `count` pixels in a row or column."""
    return cubic_weights(count, step)


def _multiply(down: Floats, across: Floats, out: Floats) -> None:
    """Multiply (2, height, N) by (2, N, width), in as many pieces as it takes to stay on this thread."""
    pieces = -(-down[0].size * across.shape[2] // _LARGEST_PRODUCT)
    columns = -(-across.shape[2] // pieces)
    for a, b, product in zip(down, across, out, strict=True):
        for start in range(0, across.shape[2], columns):
            np.matmul(a, b[:, start : start + columns], out=product[:, start : start + columns])
