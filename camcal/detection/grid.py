"""Grids of checkerboard corners: are they one, which way round they lie, and how far they really go."""

from __future__ import annotations

import numpy as np

from camcal.detection.sampling import Gray, sample
from camcal.detection.subpixel import refine
from camcal.geometry.arrays import BoolArray, FloatArray

# How far towards the middles of the four squares around a corner (.5) their colours are looked up: near the corner, where
# glare and shading are the same for all four, but outside the blur of the edges.
_COLOUR_REACH = (0.2, 0.35)
_COLOUR_REACH_PX = 2.5
_LEAST_CONTRAST = 6.0
_LEAST_SHARE_OF_CONTRAST = 0.2
# Share of the corners of a line that must look like corners for the line to belong to the board.
_LINE_SHARE = 0.5
_GRID_SHARE = 0.85
# Fewest corners of a line, with their squares inside the image, that can tell whether squares go on.
_LEAST_OF_A_LINE = 3
# Largest second difference of corners along a line, in spacings: perspective and lenses bend a grid, wrong grids jump.
_LARGEST_BEND = 0.4
_GROWTH_REACH = 0.25
# Spacings beyond a corner that must be in the image for its squares to be seen.
_ROOM_BEYOND = 0.4
_MOST_LINES = 100


def spacing_px(grid: FloatArray) -> FloatArray:
    """Distance to the nearest neighbour along rows and columns, shape (R, C), of a grid of shape (R, C, 2)."""
    spacing = np.full(grid.shape[:2], np.inf)
    across = np.linalg.norm(np.diff(grid, axis=1), axis=2)
    down = np.linalg.norm(np.diff(grid, axis=0), axis=2)
    spacing[:, 1:] = np.minimum(spacing[:, 1:], across)
    spacing[:, :-1] = np.minimum(spacing[:, :-1], across)
    spacing[1:] = np.minimum(spacing[1:], down)
    spacing[:-1] = np.minimum(spacing[:-1], down)
    return spacing


def contrasts(gray: Gray, grid: FloatArray) -> FloatArray:
    """How clearly, and with which colours, four squares meet at each corner.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    grid : ndarray of shape (R, C, 2)
        Corners in pixels.

    Returns
    -------
    ndarray of shape (R, C)
        Lightest dark square to darkest light one, in grey levels: positive where the colours are those of a board whose
        square up-left of corner [0, 0] is black, negative where they are the opposite, 0 where no such four squares
        meet (the outer edge of a board is such a place), NaN where a square lies outside the image.
    """
    along, down = np.gradient(grid, axis=1), np.gradient(grid, axis=0)
    shortest = np.minimum(np.linalg.norm(along, axis=2), np.linalg.norm(down, axis=2))
    reach = np.clip(_COLOUR_REACH_PX / np.maximum(shortest, 1.0), *_COLOUR_REACH)[..., None, None]
    steps = reach * np.stack([-along - down, along + down, along - down, down - along], axis=2)
    first, opposite, second, last = np.moveaxis(sample(gray, grid[:, :, None] + steps).astype(np.float64), 2, 0)
    black_up_left = np.minimum(second, last) - np.maximum(first, opposite)
    white_up_left = np.minimum(first, opposite) - np.maximum(second, last)
    signed = np.maximum(black_up_left, 0) - np.maximum(white_up_left, 0)
    row, column = np.indices(signed.shape)
    alternating: FloatArray = np.where((row + column) % 2 == 0, signed, -signed)
    return alternating


def is_grid(grid: FloatArray, values: FloatArray) -> bool:
    """Whether corners (R, C, 2) lie evenly and, by their `contrasts` (R, C), alternating squares meet along every line."""
    good = clear_corners(values)
    worst_line = min(good.mean(axis=0).min(), good.mean(axis=1).min())
    clear = np.isfinite(values).mean() > 0.5 and good.mean() >= _GRID_SHARE and worst_line >= _LINE_SHARE
    return bool(clear) and is_regular(grid)


def clear_corners(values: FloatArray) -> BoolArray:
    """Where contrasts (R, C) have the common sign and enough strength; those outside the image count as good.

    Finders make up corners that are covered; these are not clear.
    """
    inside = np.isfinite(values)
    typical = float(np.median(values[inside])) if inside.any() else 0.0
    clear: BoolArray = ~inside | (values * np.sign(typical) > max(_LEAST_CONTRAST, _LEAST_SHARE_OF_CONTRAST * abs(typical)))
    return clear


def is_regular(grid: FloatArray) -> bool:
    """Whether corners (R, C, 2) lie evenly: every cell turns the same way, and no line jumps."""
    along, down = np.diff(grid, axis=1), np.diff(grid, axis=0)
    turn = _cross(along[:-1], down[:, :-1])
    if not ((turn > 0).all() or (turn < 0).all()):
        return False
    return all(_bend(grid if axis else np.swapaxes(grid, 0, 1)) <= _LARGEST_BEND for axis in (0, 1))


def right_handed(grid: FloatArray) -> FloatArray:
    """The grid, read so that x right and y down as printed turn as they do in the image (a board is never mirrored)."""
    turn = _cross(np.diff(grid, axis=1)[:-1], np.diff(grid, axis=0)[:, :-1]).sum()
    return grid if turn > 0 else grid[:, ::-1]


def oriented(grid: FloatArray, values: FloatArray, columns: int, rows: int) -> tuple[FloatArray, FloatArray]:
    """Read a right-handed grid the way its board is printed.

    Parameters
    ----------
    grid : ndarray of shape (R, C, 2)
        Corners in pixels; (R, C) is (rows, columns) or (columns, rows).
    values : ndarray of shape (R, C)
        Their contrasts.
    columns, rows : int
        Inner corners of the board.

    Returns
    -------
    grid : ndarray of shape (rows, columns, 2)
        The square up-left of the first corner is black wherever one of the board's turns allows that; of the turns that
        are left, it is the one whose first corner lies nearest to the top left of the image.
    values : ndarray of shape (rows, columns)
        Contrasts of that reading.
    """
    turns = [(np.rot90(grid, quarter), _turned_contrasts(values, quarter)) for quarter in range(4)]
    fitting = [turn for turn in turns if turn[1].shape == (rows, columns)]
    black = [turn for turn in fitting if np.nanmedian(turn[1]) > 0]
    return min(black or fitting, key=lambda turn: float(turn[0][0, 0].sum()))


def _turned_contrasts(values: FloatArray, quarter: int) -> FloatArray:
    """Contrasts of the grid turned by `np.rot90`: an odd turn swaps the diagonals, and the count starts at another corner."""
    rows, columns = values.shape
    first = ((0, 0), (0, columns - 1), (rows - 1, columns - 1), (rows - 1, 0))[quarter]
    turned: FloatArray = np.rot90(values, quarter) * (-1.0) ** (sum(first) + quarter)
    return turned


def trimmed(gray: Gray, grid: FloatArray) -> FloatArray:
    """Take away outer lines that are not corners of the board; a grid below 3 x 3 comes back as it is then."""
    while min(grid.shape[:2]) >= 3:
        good = clear_corners(contrasts(gray, grid))
        shares = (good[0].mean(), good[-1].mean(), good[:, 0].mean(), good[:, -1].mean())
        worst = int(np.argmin(shares))
        if shares[worst] >= _LINE_SHARE:
            break
        grid = (grid[1:], grid[:-1], grid[:, 1:], grid[:, :-1])[worst]
    return grid


def grown(gray: Gray, grid: FloatArray) -> FloatArray:
    """Add lines of corners on every side, as far as the squares go on.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8; the image in which the grid was found.
    grid : ndarray of shape (R, C, 2)
        Corners in pixels, at least 3 x 3.

    Returns
    -------
    ndarray of shape (R + a, C + b, 2)
    """
    side = 0
    unchanged = 0
    while unchanged < 4 and max(grid.shape[:2]) < _MOST_LINES:
        turned = np.rot90(grid, side)
        line = _next_line(gray, turned)
        if line is None:
            unchanged, side = unchanged + 1, (side + 1) % 4
        else:
            unchanged, grid = 0, np.rot90(np.concatenate([line[None], turned]), -side)
    return grid


def continues(gray: Gray, grid: FloatArray) -> bool:
    """Whether the squares go on beyond a grid of shape (R, C, 2), so that it is only a part of the board."""
    framed = np.full((grid.shape[0] + 2, grid.shape[1] + 2, 2), np.nan)
    framed[1:-1, 1:-1] = grid
    for side in range(4):
        np.rot90(framed, side)[0, 1:-1] = _extrapolated(np.rot90(grid, side))
    values = contrasts(gray, framed)
    typical = np.nanmedian(values[2:-2, 2:-2])
    for side in range(4):
        turned = np.rot90(values, side)[:, 1:-1]
        if _line_is_good(turned[0], typical) and _next_line(gray, np.rot90(grid, side)) is not None:
            return True
    return False


def leaves_image(gray: Gray, grid: FloatArray) -> tuple[bool, bool]:
    """Whether more rows, and whether more columns, of a grid (R, C, 2) would lie outside the image with their squares."""
    height, width = gray.shape
    leaves = []
    for side in range(4):
        turned = np.rot90(grid, side)
        line = _extrapolated(turned)
        line = line + _ROOM_BEYOND * (line - turned[0])
        inside = ((line > 0) & (line < [width - 1, height - 1])).all(axis=1)
        leaves.append(bool(inside.mean() < 0.5))
    return leaves[0] or leaves[2], leaves[1] or leaves[3]


def _next_line(gray: Gray, grid: FloatArray) -> FloatArray | None:
    """The line of corners (C, 2) before row 0, or None where the squares do not go on."""
    guess = _extrapolated(grid)
    if not _goes_on(gray, grid, guess):
        return None
    gaps = np.linalg.norm(guess - grid[0], axis=1)
    found = refine(gray, guess, np.maximum(_GROWTH_REACH * gaps, 2))
    line = np.where(np.isfinite(found), found, guess)
    return line if _goes_on(gray, grid, line) and is_regular(np.concatenate([line[None], grid[:2]])) else None


def _extrapolated(grid: FloatArray) -> FloatArray:
    """Where the line of corners (C, 2) before row 0 would be: the spacing goes on changing as it did (perspective)."""
    step, before = grid[0] - grid[1], grid[1] - grid[2]
    ratio = np.linalg.norm(step, axis=1) / np.linalg.norm(before, axis=1)
    line: FloatArray = grid[0] + step * np.clip(ratio, 0.6, 1.6)[:, None]
    return line


def _goes_on(gray: Gray, grid: FloatArray, line: FloatArray) -> bool:
    """Whether squares meet at a line (C, 2) before row 0, in the colours that the grid goes on with."""
    values = contrasts(gray, np.concatenate([line[None], grid[:3]]))
    # A line that starts the count one row earlier has the opposite sign; all of them share it here.
    return _line_is_good(values[0], float(np.nanmedian(values[1:])))


def _line_is_good(values: FloatArray, typical: float) -> bool:
    """Whether most of a line's contrasts (C,) are of the board's sign and strength."""
    inside = values[np.isfinite(values)]
    if inside.size < _LEAST_OF_A_LINE:
        return False
    good = inside * np.sign(typical) > max(_LEAST_CONTRAST, _LEAST_SHARE_OF_CONTRAST * abs(typical))
    return bool(good.mean() >= _LINE_SHARE)


def _bend(lines: FloatArray) -> float:
    """Largest second difference along lines of shape (L, P, 2) over the spacing there."""
    if lines.shape[1] < 3:
        return 0.0
    steps = np.diff(lines, axis=1)
    lengths = np.linalg.norm(steps, axis=2)
    bends = np.linalg.norm(np.diff(steps, axis=1), axis=2) / np.maximum(lengths[:, 1:], lengths[:, :-1])
    return float(bends.max())


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Component along z of the cross product of vectors (..., 2)."""
    value: FloatArray = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return value
