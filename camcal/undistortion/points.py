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

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> target = camcal.target_camera(camera)
    >>> straight = camcal.undistort_points([[100, 50], [500, 400]], camera, target)
    >>> camcal.distort_points(straight, camera, target).round(9).tolist()
    [[100.0, 50.0], [500.0, 400.0]]
    """
    return target.project(camera.unproject(points_px))


def distort_points(points_px: npt.ArrayLike, camera: Camera, target: Camera) -> FloatArray:
    """Find where points of the undistorted image lie in the image that the camera took.

    The inverse of `undistort_points`, to the last bits.

    Parameters
    ----------
    points_px : array_like of shape (..., 2)
        Pixels of the target; they may lie outside its image.
    camera : Camera
        The camera that took the image.
    target : Camera
        The camera of the undistorted image, looking the same way.

    Returns
    -------
    ndarray of shape (..., 2)
        Pixels of the camera, inside its image or not; NaN past the fold of the lens, which the camera cannot see.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> target = camcal.target_camera(camera)
    >>> camcal.distort_points(target.K[:2, 2], camera, target).round(9).tolist()
    [322.0, 236.0]
    """
    return camera.project(target.unproject(points_px))
