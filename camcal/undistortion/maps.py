"""Maps that take the lens out: for every pixel of the undistorted image, where to look in the source."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import BoolArray
from camcal.geometry.camera import Camera
from camcal.observations import Image

_ROWS_AT_ONCE = 256


@dataclass(frozen=True, slots=True, eq=False)
class UndistortMap:
    """Where each pixel of the undistorted image comes from.

    Attributes
    ----------
    camera : Camera
        The camera that took the source.
    target : Camera
        The camera of the undistorted image.
    map_x, map_y : ndarray of shape (height, width)
        float32 source pixel of each target pixel; -1e6 where it sees nothing.
    valid : ndarray of shape (height, width)
        Whether the pixel sees the source.
    """

    camera: Camera
    target: Camera
    map_x: npt.NDArray[np.float32]
    map_y: npt.NDArray[np.float32]
    valid: BoolArray


def undistort_map(camera: Camera, target: Camera) -> UndistortMap:
    """Compute the map from a target camera to the source.

    Parameters
    ----------
    camera : Camera
        The camera that took the source.
    target : Camera
        The camera to render for, looking the same way.
    """
    width, height = target.size
    map_x, map_y = np.empty((height, width), np.float32), np.empty((height, width), np.float32)
    valid = np.empty((height, width), bool)
    columns = np.arange(width, dtype=np.float64)
    for top in range(0, height, _ROWS_AT_ONCE):
        rows = np.arange(top, min(top + _ROWS_AT_ONCE, height), dtype=np.float64)
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
        source = camera.project(target.unproject(pixels))
        inside = camera.contains(source, margin_px=0.5 - 1e-6)
        band = slice(top, top + rows.size)
        valid[band] = inside
        source[~inside] = -1e6
        map_x[band], map_y[band] = source[..., 0], source[..., 1]
    return UndistortMap(camera, target, map_x, map_y, valid)


def undistort_image(image: Image, undistort: UndistortMap, *, fill: float = 0.0) -> Image:
    """Resample an image through a map, by linear interpolation.

    Parameters
    ----------
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32, of the source camera's size.
    undistort : UndistortMap
    fill : float
        Value of pixels that see nothing.

    Returns
    -------
    ndarray
        The undistorted image, of the target's size and the source's depth and channels.

    Raises
    ------
    ValueError
        If the image is not of the source camera's size.
    """
    height, width = image.shape[:2]
    if (width, height) != undistort.camera.size:
        raise ValueError(f"image: wrong size (got {width}x{height}, expected {undistort.camera.size})")
    border = (fill,) * 4
    result: Image = cv2.remap(
        image,
        undistort.map_x,
        undistort.map_y,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=border,
    )
    result[~undistort.valid] = fill
    return result
