"""Where the pixels of one camera look in the image of another, as lattices of exact nodes and what lies between them.

The way from pixel to pixel is smooth: a bicubic polynomial through 4 x 4 nodes follows it closer than a float32
coordinate resolves, from nodes many pixels apart. Each cell of a lattice is tried in its four quarters. Where such a
polynomial does not hold (near the fold of a lens), the nodes move closer, and in the end every pixel is one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.geometry.camera import Camera

Kinds: TypeAlias = npt.NDArray[np.uint8]

SMOOTH, EXACT, BLIND = 0, 1, 2
"""Kinds of cells: interpolated, computed pixel by pixel, seeing nothing of the source."""

TOLERANCE_PX = 7e-5
"""How far an interpolated coordinate may be off in the quarters of its cell, for 1e-4 in the middle: half of what a float32
resolves in an image 4000 pixels wide."""

ROWS, COLUMNS = 64, 1024
"""Pixels that one lattice covers."""

SAMPLES = (1, 2, 4, 8, 16)
"""How many samples per pixel, along x and y, a map may have."""

# Up to this many source pixels per sample, linear interpolation leaves out little and folds back little.
_SPACING_PX = 1.5
_STEPS = (64, 32, 16, 8)
# Wider steps, as a share of the focal length, hold for lenses only that hardly distort: no use to try them.
_WIDEST_STEP = 0.04
# Farther than any image reaches: such a coordinate is never interpolated.
_FAR_PX = 1e6
# Nodes that are worked out at once, so that the largest image needs no more memory than a small one.
_NODES_AT_ONCE = 1 << 18


@dataclass(frozen=True, slots=True, eq=False)
class Lattice:
    """Source coordinates of a rectangle of a target's pixels, at nodes `step` pixels apart.

    Attributes
    ----------
    step : int
        Pixels between nodes; divides `ROWS` and `COLUMNS`.
    shifts : ndarray of shape (2, rows + 3, columns + 3)
        x and y at the nodes ((j - 1) step, (i - 1) step), counted from the rectangle's top left, less what they would be
        if neither camera had a lens; pixels; 0 where it is not known.
    kinds : ndarray of shape (rows, columns)
        uint8 kind of each cell of step x step pixels; cells outside the target are smooth.
    """

    step: int
    shifts: FloatArray
    kinds: Kinds


def look(source: Camera, target: Camera, pixels: npt.ArrayLike) -> FloatArray:
    """Find in the source what pixels (..., 2) of the target see; NaN where that is nothing."""
    return source.project(target.unproject(pixels))


def without_lenses(source: Camera, target: Camera) -> tuple[FloatArray, FloatArray]:
    """Slope and offset, each (x, y), of what target pixels would see in the source if neither had a lens or skew."""
    slope = np.diag(source.K)[:2] / np.diag(target.K)[:2]
    return slope, source.K[:2, 2] - slope * target.K[:2, 2]


def samples_per_pixel(source: Camera, target: Camera) -> int:
    """Return how many samples per pixel of the target, along x and y, see every pixel of the source."""
    spacing_px = np.sqrt(source.K[0, 0] * source.K[1, 1] / (target.K[0, 0] * target.K[1, 1]))
    return next((samples for samples in SAMPLES if spacing_px <= _SPACING_PX * samples), SAMPLES[-1])


def build_lattices(source: Camera, target: Camera, corners: IntArray) -> list[Lattice]:
    """Build one lattice for each rectangle of `ROWS` x `COLUMNS` pixels, as wide-meshed as its way from pixel to pixel allows.

    Parameters
    ----------
    source, target : Camera
    corners : ndarray of shape (T, 2)
        (left, top) of each rectangle in the target.
    """
    found: dict[int, Lattice] = {}
    waiting = np.arange(len(corners))
    widest = _WIDEST_STEP * min(target.K[0, 0], target.K[1, 1])
    for step in [step for step in _STEPS if step <= widest] or _STEPS[-1:]:
        still = []
        at_once = max(_NODES_AT_ONCE * step * step // (ROWS * COLUMNS), 1)
        for start in range(0, len(waiting), at_once):
            group = waiting[start : start + at_once]
            for index, lattice in zip(group.tolist(), _lattices(source, target, corners[group], step), strict=True):
                if step == _STEPS[-1] or not (lattice.kinds == EXACT).any():
                    found[index] = lattice
                else:
                    still.append(index)
        waiting = np.array(still, dtype=np.int64)
    return [found[index] for index in range(len(corners))]


def cubic_weights(count: int, step: int) -> FloatArray:
    """Weights (count, cells + 3) of the nodes for `count` pixels from the start of a cell on: Lagrange's cubic."""
    pixels = np.arange(count)
    cell, t = pixels // step, pixels % step / step
    weights = np.zeros((count, -(-count // step) + 3))
    cubic = (-t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2, -(t + 1) * t * (t - 2) / 2, (t + 1) * t * (t - 1) / 6)
    for node, weight in enumerate(cubic):
        weights[pixels, cell + node] = weight
    return weights


def _lattices(source: Camera, target: Camera, corners: IntArray, step: int) -> list[Lattice]:
    """Build the lattices of one step."""
    rows, columns = ROWS // step, COLUMNS // step
    at_nodes = _grids(corners, rows + 3, columns + 3, step, -step)
    slope, offset = without_lenses(source, target)
    nodes = look(source, target, at_nodes)
    nodes[~(np.abs(nodes) < _FAR_PX).all(axis=-1)] = np.nan
    quarters = look(source, target, _grids(corners, 2 * rows, 2 * columns, step // 2, step // 4))
    kinds = _kinds(nodes, quarters, step * slope, source.size)
    kinds[(at_nodes[:, 1:-2, 1:-2] >= target.size).any(axis=-1)] = SMOOTH
    shifts = np.moveaxis(np.nan_to_num(nodes - slope * at_nodes - offset), -1, 1)
    return [Lattice(step, *parts) for parts in zip(shifts, kinds, strict=True)]


def _grids(corners: IntArray, rows: int, columns: int, step: int, start: int) -> FloatArray:
    """Points (T, rows, columns, 2) `step` apart, the first at `start` along both axes from each corner."""
    grid = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1)
    return (corners[:, None, None] + (start + step * grid)).astype(np.float64)


def _kinds(nodes: FloatArray, quarters: FloatArray, room_px: FloatArray, size: tuple[int, int]) -> Kinds:
    """Sort cells by what the nodes (T, rows + 3, columns + 3, 2) and the cells' quarters (T, 2 rows, 2 columns, 2) see."""
    rows, columns = nodes.shape[1] - 3, nodes.shape[2] - 3
    around = np.stack([nodes[:, i : i + rows, j : j + columns] for i in range(4) for j in range(4)])
    weights = cubic_weights(4, 4)[1::2]
    smooth = np.ones(around.shape[1:-1], bool)
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        guess = np.einsum("n,n...->...", np.outer(weights[i], weights[j]).ravel(), around)
        with np.errstate(invalid="ignore"):
            smooth &= (np.abs(guess - quarters[:, i::2, j::2]) <= TOLERANCE_PX).all(axis=-1)
    kinds = np.full(smooth.shape, BLIND, np.uint8)
    kinds[_may_see(around, room_px, size)] = EXACT
    kinds[smooth] = SMOOTH
    return kinds


def _may_see(around: FloatArray, room_px: FloatArray, size: tuple[int, int]) -> BoolArray:
    """Tell which cells may see the source: what their nodes (16, ..., 2) see, with some room, touches it."""
    known = np.isfinite(around)
    low = np.where(known, around, np.inf).min(axis=0) - room_px
    high = np.where(known, around, -np.inf).max(axis=0) + room_px
    sees: BoolArray = ((high >= 0) & (low <= np.array(size) - 1)).all(axis=-1)
    return sees
