"""Planes of YCbCr images: luma at full size and chroma at a fraction of it, each through a map of its own.

Resampling planes as they come from a JPEG or a video saves the way to RGB and back, and half of the samples in 4:2:0. A
chroma plane is an image of a camera too: the same lens, with coarser pixels whose place among those of luma is the
siting.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from camcal.geometry.camera import Camera
from camcal.undistortion.maps import UndistortMap, undistort_map
from camcal.undistortion.resample import undistort_image

if TYPE_CHECKING:
    from camcal.observations import Image

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

# A chroma sample is used by luma pixels next to it, so it is made up (from the outermost chroma) a little past the rim.
_CHROMA_RIM_PX = 1.5


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
        The given one if nothing is subsampled. A sample that any valid pixel of the image uses is valid.
    """
    if tuple(subsampling) == (1, 1):
        return undistort
    source, target = (plane_camera(camera, subsampling, siting) for camera in (undistort.source, undistort.target))
    return undistort_map(source, target, samples=undistort.samples, rim_px=_CHROMA_RIM_PX)


def undistort_planes(
    planes: Sequence[Image],
    undistort: UndistortMap,
    chroma: UndistortMap,
    *,
    fill: Sequence[float] = (0, 128, 128),
    interpolation: str = "linear",
    out: Sequence[Image | None] | None = None,
) -> tuple[Image, ...]:
    """Resample the planes of a YCbCr image.

    Parameters
    ----------
    planes : sequence of ndarray of shape (height, width)
        Y; or Y, Cb, Cr; or Y, Cb, Cr and alpha. uint8 or uint16.
    undistort, chroma : UndistortMap
        The map of the image, and its `plane_map` for Cb and Cr.
    fill : sequence of float
        For each plane, the value of pixels that see nothing; the default is black of a JPEG with three planes.
    interpolation : str
        As for `undistort_image`.
    out : sequence of ndarray, optional
        Where to write each plane.
    """
    maps = (undistort, chroma, chroma, undistort)
    outs = [None] * len(planes) if out is None else out
    return tuple(
        undistort_image(plane, maps[i], interpolation=interpolation, fill=fill[i], out=outs[i])
        for i, plane in enumerate(planes)
    )
