"""Frames: rectangles of the ideal image plane that show what a camera sees, as much of it as possible or all of it.

All coordinates are normalised (X / Z, Y / Z). What a camera sees is the region inside the fold of its lens that lands
between the outermost pixel centres of its image; a frame is centre ± scale * half.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from camcal.errors import InputError
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.geometry.camera import Camera

WIDEST_TANGENT = float(np.tan(np.radians(80.0)))
"""Half the widest field of view that a frame is given: beyond it a flat image is all stretch and no picture."""

# A frame that exactly touches the source's last pixel must not fail by rounding.
_TOUCH_PX = 1e-9
_DIRECTIONS = 2048
_HALVINGS = 52
# Between the directions an arc reaches farther than at them by less than this.
_BETWEEN_DIRECTIONS = 2e-6
# Where the frame can slide without growing, it stays near the middle: a shift by its half size must gain this share.
_PULL = 0.01
_GRID, _COARSE_POINTS, _FINE_POINTS = 17, 500, 4096
_GOLDEN, _SECTIONS = (5**0.5 - 1) / 2, 18
# How far the largest frame of whole pixels may be from the largest of all, as a share of it.
_BRACKET = 2e-3
# A frame that touches a fold must not cross it where its camera is rounded.
_HAIR = 1e-9


def sees_source(camera: Camera, ideal: FloatArray) -> BoolArray:
    """Tell for normalised points (..., 2) whether they land between the source's outermost pixel centres."""
    return camera.contains(camera.pixels_from_normalised(camera.lens.distort(ideal)), margin_px=0.5 - _TOUCH_PX)


def region_border(camera: Camera) -> FloatArray:
    """Points (N, 2) on the border of what a camera sees, no farther out than `WIDEST_TANGENT` along x and y.

    They are the outermost pixels, and where the lens has folded before it reaches them, the fold.

    Raises
    ------
    InputError
        If the lens leaves nothing to see around the image centre.
    """
    width, height = camera.size
    ideal = camera.unproject((around(width, height) + 1) / 2 * [width - 1, height - 1])[:, :2]
    seen = np.isfinite(ideal).all(axis=1)
    if not seen.all():
        ideal = np.concatenate([ideal[seen], _exits(camera)])
    return np.clip(ideal, -WIDEST_TANGENT, WIDEST_TANGENT)


def around(columns: int, rows: int) -> FloatArray:
    """Points (2 columns + 2 rows, 2) around the square [-1, 1]², corners included."""
    x, y = np.linspace(-1, 1, columns), np.linspace(-1, 1, rows)
    sides = [(x, np.full(columns, -1)), (x, np.ones(columns)), (np.full(rows, -1), y), (np.ones(rows), y)]
    return np.concatenate([np.stack(side, axis=-1) for side in sides])


def covering_frame(border: FloatArray, half: FloatArray) -> tuple[FloatArray, float]:
    """Centre (2,) and scale of the smallest frame that holds a region, from the region's border (N, 2)."""
    low, high = border.min(axis=0), border.max(axis=0)
    return (low + high) / 2, float(((high - low) / 2 / half).max()) * (1 + _BETWEEN_DIRECTIONS)


def largest_frame(camera: Camera, border: FloatArray, half: FloatArray, size: tuple[int, int]) -> tuple[FloatArray, float]:
    """Centre (2,) and scale of the largest frame that lies in what a camera sees.

    Parameters
    ----------
    camera : Camera
    border : ndarray of shape (N, 2)
        Its `region_border`.
    half : ndarray of shape (2,)
        Half width and height of the frame of scale 1.
    size : tuple of int
        Pixels across and down the frame; its outermost ones must see the source.

    Raises
    ------
    InputError
        If there is none.
    """
    middle = _middle(camera)
    centre, scale = _roomiest(border / half, middle / half, lambda c: sees_source(camera, c * half))
    centre = centre * half
    scale = _largest_scale(camera, centre, scale, around(*size) * half)
    if scale <= 0:
        raise InputError("undistort: the lens model leaves no valid pixel around the image centre. Calibrate again.")
    return centre, scale


def _middle(camera: Camera) -> FloatArray:
    """Where the middle of the image looks; straight ahead if the lens has folded there."""
    centre = camera.unproject([(camera.size[0] - 1) / 2, (camera.size[1] - 1) / 2])[:2]
    middle: FloatArray = centre if np.isfinite(centre).all() else np.zeros(2)
    return middle


def _exits(camera: Camera) -> FloatArray:
    """Where rays across the ideal plane leave what the camera sees: (N, 2), one point for each of many directions."""
    origin = next((o for o in (np.zeros(2), _middle(camera)) if sees_source(camera, o)), None)
    if origin is None:
        raise InputError("undistort: the lens model leaves no valid pixel around the image centre. Calibrate again.")
    angle = np.linspace(0, 2 * np.pi, _DIRECTIONS, endpoint=False)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    low, high = np.zeros(_DIRECTIONS), np.full(_DIRECTIONS, 2 * WIDEST_TANGENT)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        seen = sees_source(camera, origin + middle[:, None] * direction)
        low, high = np.where(seen, middle, low), np.where(seen, high, middle)
    exits: FloatArray = origin + low[:, None] * direction
    return exits


def _roomiest(border: FloatArray, middle: FloatArray, inside: Callable[[FloatArray], BoolArray]) -> tuple[FloatArray, float]:
    """Centre (2,) and half side of the largest square in a region, from the region's border (N, 2).

    The half side is the distance from the centre to the nearest point of the border, by the larger coordinate. The best
    centre of a grid is refined by a search along y for each step of a search along x, so that no ridge can stop it.
    """
    low, high = border.min(axis=0), border.max(axis=0)
    axes = [np.linspace(low[i], high[i], _GRID) for i in (0, 1)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    coarse = _value(grid, border[:: max(len(border) // _COARSE_POINTS, 1)], middle)
    centre = grid[np.argmax(np.where(inside(grid), coarse, -np.inf))]
    spacing = (high - low) / (_GRID - 1)
    for _ in range(_GRID):
        found = _climbed(centre, 2 * spacing, border, middle)
        if (np.abs(found - centre) < 1.9 * spacing).all():
            break
        centre = found
    return found, float(_room(found[None], border)[0])


def _climbed(centre: FloatArray, reach: FloatArray, border: FloatArray, middle: FloatArray) -> FloatArray:
    """Return the best centre (2,) no farther than `reach` (2,) from the given one along x and y."""
    farthest = float(_room(centre[None], border)[0]) + 2 * reach.max()
    near = border[np.abs(border - centre).max(axis=1) <= farthest + reach.max()]
    near = near[:: len(near) // _FINE_POINTS + 1]

    def along_y(x: float) -> tuple[float, float]:
        return _highest(lambda y: float(_value(np.array([[x, y]]), near, middle)[0]), centre[1], reach[1])

    x, _ = _highest(lambda x: along_y(x)[1], centre[0], reach[0])
    return np.array([x, along_y(x)[0]])


def _highest(function: Callable[[float], float], middle: float, reach: float) -> tuple[float, float]:
    """Where a function with one peak within middle ± reach is highest, and how high: golden section search."""
    low, high = middle - reach, middle + reach
    left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_left, at_right = function(left), function(right)
    for _ in range(_SECTIONS):
        if at_left >= at_right:
            high, right, at_right = right, left, at_left
            left = high - _GOLDEN * (high - low)
            at_left = function(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + _GOLDEN * (high - low)
            at_right = function(right)
    return (left, at_left) if at_left >= at_right else (right, at_right)


def _value(centres: FloatArray, border: FloatArray, middle: FloatArray) -> FloatArray:
    """Room around centres (M, 2), less what their distance to the middle takes away: shape (M,)."""
    value: FloatArray = _room(centres, border) - _PULL * np.abs(centres - middle).max(axis=1)
    return value


def _room(centres: FloatArray, border: FloatArray) -> FloatArray:
    """Distance (M,) of centres (M, 2) to the nearest of a border's points (N, 2), by the larger coordinate."""
    away = np.abs(centres[:, None, 0] - border[:, 0])
    np.maximum(away, np.abs(centres[:, None, 1] - border[:, 1]), out=away)
    distance: FloatArray = away.min(axis=1)
    return distance


def _largest_scale(camera: Camera, centre: FloatArray, scale: float, frame: FloatArray) -> float:
    """Largest scale, near the given one, at which the pixels around a frame (N, 2) all see the source; 0 if none does."""
    low, high = scale * (1 - _BRACKET), scale * (1 + _BRACKET)
    wrong = frame[~sees_source(camera, centre + high * frame)]
    if not sees_source(camera, centre + low * frame).all():
        low, wrong = 0.0, frame
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        fits = sees_source(camera, centre + middle * wrong).all()
        low, high = (middle, high) if fits else (low, middle)
    return low * (1 - _HAIR)
