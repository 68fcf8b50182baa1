"""The largest rectangle of pixels that all see the source."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from camcal.errors import InputError
from camcal.geometry.arrays import BoolArray, IntArray
from camcal.geometry.camera import Camera
from camcal.undistortion.frames import sees_source
from camcal.undistortion.lattice import samples_per_pixel

_NODES = 128


def cropped_to_valid(camera: Camera, target: Camera) -> Camera:
    """Crop a target to the largest rectangle of pixels that all see the source, each with all its samples.

    Parameters
    ----------
    camera : Camera
        The camera that took the source.
    target : Camera
        The camera of the undistorted image; it may have a lens.

    Returns
    -------
    Camera
        The target with a smaller image, its principal point moved along. No side of that image can grow by a pixel.

    Raises
    ------
    InputError
        If no two rows and columns of pixels see the source.
    """
    view = _View(camera, target, samples_per_pixel(camera, target))
    box = _grown(view, _started(view))
    (left, top), (right, bottom) = box.tolist()
    K = target.K.copy()
    K[:2, 2] -= left, top
    return Camera((right - left + 1, bottom - top + 1), K, target.lens)


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """What of a source the pixels of a target see, with so many samples along x and y."""

    source: Camera
    target: Camera
    samples: int

    def pixels_see(self, pixels: IntArray) -> BoolArray:
        """Tell for pixels (..., 2) whether the samples in their corners see the source."""
        sees = np.ones(pixels.shape[:-1], bool)
        for end in product({0, self.samples - 1}, repeat=2):
            sees &= self._samples_see(self.samples * pixels + end)
        return sees

    def box_sees(self, box: IntArray) -> bool:
        """Tell whether every pixel of a rectangle sees the source; what the camera sees has no holes, so its rim will do."""
        (left, top), (right, bottom) = (self.samples * box + [[0, 0], [self.samples - 1] * 2]).tolist()
        u, v = np.arange(left, right + 1), np.arange(top, bottom + 1)
        rows, columns = ((u, np.full_like(u, y)) for y in (top, bottom)), ((np.full_like(v, x), v) for x in (left, right))
        return bool(self._samples_see(np.concatenate([np.stack(side, axis=-1) for side in (*rows, *columns)])).all())

    def _samples_see(self, samples: IntArray) -> BoolArray:
        """Tell for samples (..., 2), counted across the whole target, whether they see the source."""
        pixels = (samples + 0.5) / self.samples - 0.5
        return sees_source(self.source, self.target.unproject(pixels)[..., :2])


def _started(view: _View) -> IntArray:
    """First and last pixel ((left, top), (right, bottom)) of a rectangle that sees the source, from a coarse grid."""
    u, v = (np.unique(np.linspace(0, n - 1, _NODES).round().astype(np.int64)) for n in view.target.size)
    grid = np.stack(np.meshgrid(u, v), axis=-1)
    left, top, right, bottom = _largest_rectangle(view.pixels_see(grid), u, v)
    # What lies between nodes that see the source may not, where the border of what it sees bends inwards.
    while right > left and bottom > top:
        box = np.array([(u[left], v[top]), (u[right], v[bottom])])
        if view.box_sees(box):
            return box
        left, top, right, bottom = left + 1, top + 1, right - 1, bottom - 1
    raise InputError("--crop: no rectangle of valid pixels is left. Show less around it (smaller --alpha or --fov).")


def _largest_rectangle(seen: BoolArray, u: IntArray, v: IntArray) -> tuple[int, int, int, int]:
    """Left, top, right and bottom index of the largest rectangle of true nodes at (v, u); right = left if there is none."""
    best, found = 0, (0, 0, 0, 0)
    columns = np.arange(len(u))
    for top in range(len(v)):
        clear = np.logical_and.accumulate(seen[top:], axis=0)
        before = np.maximum.accumulate(np.where(clear, -1, columns), axis=1)
        left = np.minimum(before + 1, columns)
        area = (u[columns] - u[left]) * (v[top:] - v[top])[:, None]
        area = np.where(clear, area, 0)
        bottom, right = np.unravel_index(int(area.argmax()), area.shape)
        if area[bottom, right] > best:
            best = int(area[bottom, right])
            found = int(left[bottom, right]), top, int(right), top + int(bottom)
    return found


def _grown(view: _View, box: IntArray) -> IntArray:
    """Move the sides of a rectangle outwards, by ever smaller steps, as long as all its pixels see the source."""
    step = 1 << (max(view.target.size) // _NODES + 1).bit_length()
    while step:
        for end, axis in ((0, 0), (1, 0), (0, 1), (1, 1)):
            strip = box.copy()
            strip[1 - end, axis] = box[end, axis]
            strip[end, axis] += step if end else -step
            if 0 <= strip[end, axis] < view.target.size[axis] and view.box_sees(strip):
                box = box.copy()
                box[end, axis] = strip[end, axis]
        step //= 2
    return box
