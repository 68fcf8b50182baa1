"""The camera of the undistorted image: how much of the source it keeps, without inventing any of it.

The target is a pinhole with the source's pixel aspect, so that nothing is stretched. `alpha` says how much is kept: 0 is
the largest frame in which every pixel sees the source, 1 the smallest frame that shows every pixel of the source.
"""

from __future__ import annotations

import numpy as np

from camcal.errors import InputError
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.undistortion.crop import cropped_to_valid
from camcal.undistortion.frames import covering_frame, largest_frame, region_border
from camcal.undistortion.lattice import samples_per_pixel

LARGEST_SIDE = 65_535
"""Pixels along a side that an undistorted image may have: what a JPEG can hold."""


def target_camera(
    camera: Camera,
    alpha: float = 0.0,
    *,
    fov_deg: float | None = None,
    size: tuple[int, int] | None = None,
    scale: float = 1.0,
    crop: str = "none",
) -> Camera:
    """Choose the pinhole camera of the undistorted image.

    First comes the image size (`size`, or the camera's size times `scale`), then the frame (`fov_deg`, or else `alpha`),
    and last the crop, which leaves the pixels as they are.

    Parameters
    ----------
    camera : Camera
        The camera that took the image.
    alpha : float
        0 (every pixel of the result sees the source) to 1 (every pixel of the source is in the result, as far as it looks no
        more than 80° to the side, up or down); in between, the frame is interpolated.
    fov_deg : float, optional
        Horizontal field of view of the result between its outer edges, degrees; the optical axis is in the middle.
    size : tuple of int, optional
        (width, height) of the result in pixels; the camera's by default.
    scale : float
        Factor by which the result is larger than the camera's image.
    crop : str
        "none", or "valid": only the largest rectangle in which every pixel sees the source.

    Returns
    -------
    Camera
        Without distortion and skew. A camera that has neither is its own target.

    Raises
    ------
    InputError
        If a value is out of range, two of them contradict each other, or the lens leaves nothing valid to show.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> for alpha in (0, 1):
    ...     print(camcal.target_camera(camera, alpha))
    Camera(640x480, fx=500.395, fy=503.282, cx=322.438, cy=235.73)
    Camera(640x480, fx=468.201, fy=470.902, cx=322.28, cy=235.782)
    """
    _check(alpha, fov_deg, size, scale, crop)
    result_size = size or (round(camera.size[0] * scale), round(camera.size[1] * scale))
    if min(result_size) < 2 or max(result_size) > LARGEST_SIDE:
        given = "--size" if size else "--scale"
        raise InputError(f"{given}: no image size (got {result_size[0]}x{result_size[1]}, expected 2 to {LARGEST_SIDE} each).")
    if fov_deg is not None:
        target = _of_field_of_view(camera, fov_deg, result_size)
    elif result_size == camera.size and not camera.dist.any() and camera.K[0, 1] == 0:
        target = camera
    else:
        target = _of_alpha(camera, alpha, result_size, by_edges=False)
        if samples_per_pixel(camera, target) > 1:
            target = _of_alpha(camera, alpha, result_size, by_edges=True)
    return cropped_to_valid(camera, target) if crop == "valid" else target


def _check(alpha: float, fov_deg: float | None, size: tuple[int, int] | None, scale: float, crop: str) -> None:
    """Refuse values out of range and contradictions."""
    if not 0 <= alpha <= 1:
        raise InputError(f"--alpha: out of range (got {alpha:g}, expected 0 to 1).")
    if fov_deg is not None and not 0 < fov_deg < 180:
        raise InputError(f"--fov: out of range (got {fov_deg:g}, expected more than 0 and less than 180 degrees).")
    if not 0 < scale < float("inf"):
        raise InputError(f"--scale: out of range (got {scale:g}, expected a positive factor).")
    if crop not in ("none", "valid"):
        raise InputError(f"--crop: unknown (got {crop}, expected none or valid).")
    if fov_deg is not None and alpha != 0:
        raise InputError(f"--fov and --alpha: both say how much is shown (got {fov_deg:g} and {alpha:g}). Give one of them.")
    if size is not None and scale != 1:
        raise InputError(f"--size and --scale: both say how large the result is (got {size} and {scale:g}). Give one of them.")


def _of_field_of_view(camera: Camera, fov_deg: float, size: tuple[int, int]) -> Camera:
    """Return the pinhole of the given horizontal field of view."""
    fx = size[0] / (2 * np.tan(np.radians(fov_deg) / 2))
    fy = fx * camera.K[1, 1] / camera.K[0, 0]
    return Camera(size, [[fx, 0, (size[0] - 1) / 2], [0, fy, (size[1] - 1) / 2], [0, 0, 1]])


def _of_alpha(camera: Camera, alpha: float, size: tuple[int, int], *, by_edges: bool) -> Camera:
    """Return the pinhole whose frame lies between the largest valid and the smallest covering one.

    A frame ends at the centres of the outermost pixels, or at their outer edges where a pixel has several samples.
    """
    span = np.array(size) - (0.0 if by_edges else 1.0)
    half = span / (2 * np.diag(camera.K)[:2])
    border = region_border(camera)
    inner_centre, inner_scale = (np.zeros(2), 0.0) if alpha == 1 else largest_frame(camera, border, half, size)
    outer_centre, outer_scale = (np.zeros(2), 0.0) if alpha == 0 else covering_frame(border, half)
    centre: FloatArray = (1 - alpha) * inner_centre + alpha * outer_centre
    scale = (1 - alpha) * inner_scale + alpha * outer_scale
    fx, fy = np.diag(camera.K)[:2] / scale
    middle = (np.array(size) - 1) / 2 - [fx, fy] * centre
    return Camera(size, [[fx, 0, middle[0]], [0, fy, middle[1]], [0, 0, 1]])
