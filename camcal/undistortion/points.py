"""Points through a lens and back: pixels of a camera to pixels of the camera without its lens, exactly."""

from __future__ import annotations

import numpy.typing as npt

from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera


def undistort_points(points_px: npt.ArrayLike, camera: Camera, target: Camera) -> FloatArray:
    """Find where points of an image lie in the undistorted image.

    Parameters
    ----------
    points_px : array_like of shape (..., 2)
        Pixels of the camera; they may lie outside its image.
    camera : Camera
        The camera that took the image.
    target : Camera
        The camera of the undistorted image, looking the same way.

    Returns
    -------
    ndarray of shape (..., 2)
        Pixels of the target, inside its image or not; NaN where nothing valid reaches the point, past the fold of the lens.
    """
    return target.project(camera.unproject(points_px))


def distort_points(points_px: npt.ArrayLike, camera: Camera, target: Camera) -> FloatArray:
    """Find where points of the undistorted image lie in the image that the camera took.

    The inverse of `undistort_points`, to the last bits: of the points (..., 2) in pixels of the target, pixels of the
    camera; NaN for those past the fold of the lens, which the camera cannot see.
    """
    return camera.project(target.unproject(points_px))
