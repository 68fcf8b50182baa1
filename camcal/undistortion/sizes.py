"""A camera for images of another size than it was calibrated at."""

from __future__ import annotations

from camcal.errors import InputError
from camcal.geometry.camera import Camera

# A side that was scaled and rounded to whole pixels is off by half of one at most.
_ROUNDED_PX = 0.5


def rescaled_camera(camera: Camera, size: tuple[int, int]) -> Camera:
    """Scale a camera for images of the same picture at another size.

    Parameters
    ----------
    camera : Camera
    size : tuple of int
        (width, height) of the images in pixels.

    Returns
    -------
    Camera
        The camera itself if the size is its own.

    Raises
    ------
    InputError
        If the sides are not those of the camera scaled by one factor and rounded: then the images were cropped or turned, and
        no scaling makes the camera fit.
    """
    (width, height), (own_width, own_height) = size, camera.size
    if (width, height) == (own_width, own_height):
        return camera
    if min(size) < 1 or not _same_aspect(size, camera.size):
        turned = _same_aspect((height, width), camera.size) if min(size) > 0 else False
        advice = "The image is turned by 90°: turn it back." if turned else "Use a camera calibrated at this aspect ratio."
        raise InputError(
            f"--rescale: the aspect ratio differs (got {width}x{height}, expected {own_width}x{own_height} scaled). {advice}"
        )
    return camera.scaled(size)


def advice_on_size(size: tuple[int, int], expected: tuple[int, int]) -> str:
    """Say what to do with an image of another (width, height) than its camera's."""
    if _same_aspect(size, expected):
        return "Undistort images of each size by themselves: with a camera calibrated at that size, or with --rescale."
    if _same_aspect(size[::-1], expected):
        return "It is turned by 90°: turn it back, or use a camera calibrated this way round."
    return "Use the camera file that was calibrated at this size."


def _same_aspect(size: tuple[int, int], own: tuple[int, int]) -> bool:
    """Tell whether one factor, with rounding, takes one size to the other."""
    lows = [(side - _ROUNDED_PX) / own_side for side, own_side in zip(size, own, strict=True)]
    highs = [(side + _ROUNDED_PX) / own_side for side, own_side in zip(size, own, strict=True)]
    return max(lows) <= min(highs)
