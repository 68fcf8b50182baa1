"""The camera of the undistorted image: how much of the source it keeps, without inventing any of it.

The target is a pinhole with the source's pixel aspect, so that nothing is stretched. `alpha` says how much is kept: 0 is
the largest frame in which every pixel sees the source, 1 the smallest frame that shows every pixel of the source.
"""

from __future__ import annotations

import numpy as np

from camcal.errors import InputError
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.geometry.camera import Camera

_FOLD_SAMPLES = 2000
_SEARCH_SAMPLES = 48
_SEARCH_HALVINGS = 16
_SEARCH_ROUNDS = 16
_FINAL_HALVINGS = 48
# Where the frame can slide without growing, it stays near the middle: a smaller gain is no reason to move.
_WORTH_MOVING = 1.001
_WIDEST_TANGENT = np.tan(np.radians(80.0))
"""Half the widest field of view that a flat image is given: beyond it a pinhole is all stretch and no picture."""


def target_camera(camera: Camera, alpha: float = 0.0) -> Camera:
    """Choose the pinhole camera of the undistorted image, of the same image size.

    Parameters
    ----------
    camera : Camera
        The camera that took the image.
    alpha : float
        0 (every pixel of the result sees the source) to 1 (every pixel of the source is in the result); in between,
        the frame is interpolated.

    Returns
    -------
    Camera
        Without distortion and skew.

    Raises
    ------
    InputError
        If alpha is outside 0..1, or the lens leaves no valid pixel around the principal point.
    """
    if not 0 <= alpha <= 1:
        raise InputError(f"--alpha: out of range (got {alpha:g}, expected 0 to 1).")
    if not camera.dist.any() and camera.K[0, 1] == 0:
        return camera
    half = np.array([(camera.size[0] - 1) / (2 * camera.K[0, 0]), (camera.size[1] - 1) / (2 * camera.K[1, 1])])
    inner_centre, inner_scale = _largest_valid_frame(camera, half)
    if alpha == 0:
        return _framed(camera, inner_centre, inner_scale * half)
    outer_centre, outer_scale = _smallest_covering_frame(camera, half)
    centre = (1 - alpha) * inner_centre + alpha * outer_centre
    scale = (1 - alpha) * inner_scale + alpha * outer_scale
    return _framed(camera, centre, scale * half)


def _framed(camera: Camera, centre: FloatArray, half: FloatArray) -> Camera:
    """Return the pinhole whose outermost pixel centres see centre ± half (normalised coordinates)."""
    width, height = camera.size
    fx, fy = (width - 1) / (2 * half[0]), (height - 1) / (2 * half[1])
    cx, cy = (width - 1) / 2 - fx * centre[0], (height - 1) / 2 - fy * centre[1]
    return Camera(camera.size, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _border(columns: int, rows: int) -> FloatArray:
    """Points (2 columns + 2 rows, 2) around the square [-1, 1]², corners included."""
    x, y = np.linspace(-1, 1, columns), np.linspace(-1, 1, rows)
    sides = [(x, np.full(columns, -1)), (x, np.ones(columns)), (np.full(rows, -1), y), (np.ones(rows), y)]
    return np.concatenate([np.stack(side, axis=-1) for side in sides])


def _sees_source(camera: Camera, ideal: FloatArray) -> BoolArray:
    """Tell for normalised points (..., 2) whether they land between the source's outermost pixel centres."""
    uv = camera.pixels_from_normalised(camera.lens.distort(ideal))
    # A frame that exactly touches the source's last pixel must not fail by rounding.
    return camera.contains(uv, margin_px=0.5 - 1e-9)


def _largest_valid_frame(camera: Camera, half: FloatArray) -> tuple[FloatArray, float]:
    """Centre (2,) and scale of the largest frame whose border sees the source everywhere.

    For each of nine centres the scale is found by bisection on a coarse border; the search moves to the best and narrows.
    The last bisection runs over the border pixels themselves.
    """
    border = _border(_SEARCH_SAMPLES, _SEARCH_SAMPLES) * half
    principal = camera.normalised_from_pixels(np.array([(camera.size[0] - 1) / 2, (camera.size[1] - 1) / 2]))
    centre = camera.lens.undistort(principal)
    if not np.isfinite(centre).all():
        centre = np.zeros(2)
    offsets = np.stack(np.meshgrid([0, -1, 1], [0, -1, 1]), axis=-1).reshape(-1, 2)
    step = 0.25 * half
    best_scale = 0.0
    for _ in range(_SEARCH_ROUNDS):
        centres = centre + offsets * step
        scales = _valid_scale(camera, centres, border, _SEARCH_HALVINGS)
        best = int(np.argmax(scales))
        if scales[best] > best_scale * _WORTH_MOVING and best != 0:
            centre, best_scale = centres[best], float(scales[best])
        else:
            best_scale = max(best_scale, float(scales[0]))
            step = step / 2
    scale = float(_valid_scale(camera, centre[None], _border(*camera.size) * half, _FINAL_HALVINGS)[0])
    if scale <= 0:
        raise InputError("undistort: the lens model leaves no valid pixel around the image centre. Calibrate again.")
    return centre, scale


def _valid_scale(camera: Camera, centres: FloatArray, border: FloatArray, halvings: int) -> FloatArray:
    """Largest scale (C,) at which the border (B, 2) around each centre (C, 2) still sees the source; 0 where none does."""
    low, high = np.zeros(centres.shape[0]), np.full(centres.shape[0], 4.0)
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        fits = _sees_source(camera, centres[:, None] + middle[:, None, None] * border).all(axis=1)
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    return low


def _smallest_covering_frame(camera: Camera, half: FloatArray) -> tuple[FloatArray, float]:
    """Centre (2,) and scale of the smallest frame that holds every valid source pixel, at most 160° wide."""
    width, height = camera.size
    border = (_border(width, height) + 1) / 2 * [width - 1, height - 1]
    ideal = camera.unproject(border)[:, :2]
    valid = np.isfinite(ideal).all(axis=1)
    radius = camera.lens.valid_radius
    if not valid.all() and np.isfinite(radius):
        # Where the lens turns back inside the image, the picture ends at the fold.
        angle = np.linspace(0, 2 * np.pi, _FOLD_SAMPLES)
        fold = 0.999 * radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        ideal = np.concatenate([ideal[valid], fold[_sees_source(camera, fold)]])
    ideal = np.clip(ideal, -_WIDEST_TANGENT, _WIDEST_TANGENT)
    low, high = ideal.min(axis=0), ideal.max(axis=0)
    return (low + high) / 2, float(((high - low) / 2 / half).max())
