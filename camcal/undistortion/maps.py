"""Maps between the images of two cameras that look the same way: for every pixel of one, where to look in the other.

A map is a few exact nodes per tile; their float32 coordinates are worked out when a tile is resampled, which costs a
fraction of the resampling. So a map is small, ready at once, and never stands in memory as two images of floats.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import FloatArray, frozen_floats
from camcal.geometry.camera import Camera
from camcal.undistortion.lattice import SAMPLES, samples_per_pixel
from camcal.undistortion.resample import undistort_image
from camcal.undistortion.tiles import OUTSIDE_PX, FloatMap, Tile, make_tiles

__all__ = ["OUTSIDE_PX", "RIM_PX", "UndistortMap", "dense_map", "distort_map", "undistort_image", "undistort_map", "valid_mask"]

RIM_PX = 1e-3
"""How far past the source's outermost pixel centres a pixel still looks at them: more than rounding, and nothing to see."""


@dataclass(frozen=True, slots=True, eq=False)
class UndistortMap:
    """Where each pixel of the target looks in the source.

    Attributes
    ----------
    source : Camera
        The camera of the image that is resampled.
    target : Camera
        The camera of the image that results.
    samples : int
        Samples per pixel of the target along x and y (1, 2, 4 ...), which are averaged.
    low_px, high_px : ndarray of shape (2,)
        Source coordinates between which a sample is valid.
    tiles : tuple of Tile
        They cover the target's samples.
    """

    source: Camera
    target: Camera
    samples: int
    low_px: FloatArray
    high_px: FloatArray
    tiles: tuple[Tile, ...]


def undistort_map(camera: Camera, target: Camera, *, samples: int | None = None, rim_px: float = RIM_PX) -> UndistortMap:
    """Find for each pixel of the undistorted image where to look in the source.

    A pixel is valid if its ray falls between the source's outermost pixel centres and the lens has not folded: all that
    linear interpolation reads lies inside the source then. Wider kernels mirror the source at its outermost pixels.

    Parameters
    ----------
    camera : Camera
        The camera that took the source.
    target : Camera
        The camera to render for, looking the same way; any camera will do, one with a lens too.
    samples : int, optional
        Samples per pixel along x and y: 1, 2, 4, 8 or 16. By default as many as keep a smaller image from aliasing: 1
        unless a pixel of the target covers more than 1.5 pixels of the source (judged by the focal lengths).
    rim_px : float
        How far past the source's outermost pixel centres a pixel still counts as valid.

    Returns
    -------
    UndistortMap
        Its coordinates agree with `camera.project(target.unproject(pixel))` to 2e-4 pixels.

    Raises
    ------
    ValueError
        If `samples` is another number.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> straight = camcal.undistort_map(camera, camcal.target_camera(camera, scale=0.25))
    >>> straight.target.size, straight.samples
    ((160, 120), 4)
    """
    per_pixel = samples_per_pixel(camera, target) if samples is None else samples
    if per_pixel not in SAMPLES:
        raise ValueError(f"samples: not a number of samples per pixel (got {samples}, expected one of {SAMPLES})")
    low = frozen_floats([-rim_px, -rim_px], (2,), "low_px")
    high = frozen_floats([camera.size[0] - 1 + rim_px, camera.size[1] - 1 + rim_px], (2,), "high_px")
    width, height = target.size
    sampled = target if per_pixel == 1 else target.scaled((width * per_pixel, height * per_pixel))
    return UndistortMap(camera, target, per_pixel, low, high, make_tiles(camera, sampled, low, high))


def distort_map(camera: Camera, ideal: Camera, *, samples: int | None = None) -> UndistortMap:
    """Find for each pixel of the image that a camera would take where to look in an image without its lens.

    Parameters
    ----------
    camera : Camera
        The camera whose lens is added.
    ideal : Camera
        The camera of the image at hand, usually a pinhole.
    samples : int, optional
        As for `undistort_map`.
    """
    return undistort_map(ideal, camera, samples=samples)


def dense_map(undistort: UndistortMap) -> tuple[FloatMap, FloatMap]:
    """Write out a map as `cv2.remap` takes it.

    Parameters
    ----------
    undistort : UndistortMap

    Returns
    -------
    map_x, map_y : ndarray of shape (height, width)
        float32 source coordinates of the centre of each pixel of the target; `OUTSIDE_PX` where it is not valid.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> map_x, map_y = camcal.dense_map(camcal.undistort_map(camera, camcal.target_camera(camera)))
    >>> map_x.shape, map_x.dtype
    ((480, 640), dtype('float32'))
    """
    if undistort.samples != 1:
        undistort = undistort_map(undistort.source, undistort.target, samples=1, rim_px=-float(undistort.low_px[0]))
    width, height = undistort.target.size
    dense = np.full((2, height, width), OUTSIDE_PX, np.float32)
    for tile in undistort.tiles:
        if not tile.sees_nothing:
            xy = tile.coordinates()
            valid = tile.is_valid(xy, undistort.low_px, undistort.high_px)
            block = dense[:, tile.top : tile.top + tile.height, tile.left : tile.left + tile.width]
            np.copyto(block, xy + np.array(tile.window[:2], np.float32)[:, None, None], where=valid)
    return dense[0], dense[1]


def valid_mask(undistort: UndistortMap) -> npt.NDArray[np.uint8]:
    """Tell which pixels of the target see the source.

    Parameters
    ----------
    undistort : UndistortMap

    Returns
    -------
    ndarray of shape (height, width)
        uint8: 255 where all samples of a pixel see the source, else 0.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> for alpha in (0, 1):
    ...     mask = camcal.valid_mask(camcal.undistort_map(camera, camcal.target_camera(camera, alpha)))
    ...     print(f"alpha {alpha}: {(mask > 0).mean():.2f} of the pixels see the source")
    alpha 0: 1.00 of the pixels see the source
    alpha 1: 0.93 of the pixels see the source
    """
    width, height = undistort.target.size
    n = undistort.samples
    mask = np.zeros((height * n, width * n), np.uint8)
    for tile in undistort.tiles:
        if not tile.sees_nothing:
            block = mask[tile.top : tile.top + tile.height, tile.left : tile.left + tile.width]
            block[...] = 255 * (tile.whole | tile.is_valid(tile.coordinates(), undistort.low_px, undistort.high_px))
    if n > 1:
        mask = mask.reshape(height, n, width, n).min(axis=(1, 3))
    return mask
