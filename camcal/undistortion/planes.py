"""Planes of YCbCr images: luma at full size and chroma at a fraction of it, each through a map of its own.

Resampling planes as they come from a JPEG or a video saves the way to RGB and back, and half of the samples in 4:2:0. A
chroma plane is an image of a camera too: the same lens, with coarser pixels whose place among those of luma is the
siting.
"""

from __future__ import annotations

import numpy as np

from camcal.geometry.camera import Camera
from camcal.undistortion.maps import RIM_PX, UndistortMap, undistort_map

SITINGS = {
    "center": (0.5, 0.5),
    "left": (0.0, 0.5),
    "topleft": (0.0, 0.0),
    "top": (0.5, 0.0),
    "bottomleft": (0.0, 1.0),
    "bottom": (0.5, 1.0),
}
"""Where a chroma sample lies between the first (0) and the last (1) luma pixel that it belongs to, along x and y.

"center" is JPEG and MPEG-1, "left" MPEG-2, H.264 and HEVC, "topleft" HEVC of ultra high definition; FFmpeg's names.
"""


def plane_camera(camera: Camera, subsampling: tuple[int, int], siting: str = "center") -> Camera:
    """Return the camera whose image is a subsampled plane of a camera's image.

    Parameters
    ----------
    camera : Camera
    subsampling : tuple of int
        Pixels of the image per sample of the plane along x and y: (2, 2) for 4:2:0, (2, 1) for 4:2:2, (1, 1) for 4:4:4.
    siting : str
        Where the samples lie, one of `SITINGS`.

    Raises
    ------
    ValueError
        If the subsampling is not of whole positive numbers or the siting is unknown.
    """
    if min(subsampling) < 1 or siting not in SITINGS:
        raise ValueError(
            f"plane: unknown layout (got {subsampling} {siting}, expected whole numbers and one of {list(SITINGS)})"
        )
    factor = np.array(subsampling)
    first = np.array(SITINGS[siting]) * (factor - 1)
    K = camera.K.copy()
    K[:2, 2] -= first
    K[:2] /= factor[:, None]
    width, height = (-(-side // n) for side, n in zip(camera.size, subsampling, strict=True))
    return Camera((width, height), K, camera.lens)


def plane_map(undistort: UndistortMap, subsampling: tuple[int, int], siting: str = "center") -> UndistortMap:
    """Return the map of a subsampled plane, for the map of the whole image.

    Parameters
    ----------
    undistort : UndistortMap
    subsampling, siting
        As for `plane_camera`; the result has the layout of the source.

    Returns
    -------
    UndistortMap
        The given one if nothing is subsampled. A sample is valid if its centre sees the picture, which ends half a sample past
        the outermost ones: with fewer of them its rim would be grey, with more it would have a ring of colour around it.
    """
    if tuple(subsampling) == (1, 1):
        return undistort
    source, target = (plane_camera(camera, subsampling, siting) for camera in (undistort.source, undistort.target))
    return undistort_map(source, target, samples=undistort.samples, rim_px=1 - 1 / max(subsampling) + RIM_PX)
