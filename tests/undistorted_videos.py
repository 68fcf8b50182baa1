"""Small videos undistorted in a line: the cameras, what becomes of a plane of pixels, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from undistort_files import CAMERA
from videos import SIZE

from camcal.errors import InputError
from camcal.formats.video.codecs import EncodingOptions
from camcal.geometry.camera import Camera
from camcal.undistortion.maps import undistort_map
from camcal.workflows.undistort.video import VideoOptions, VideoResult, undistort_video

# The one sees the source with every pixel, the other sees past it on every side.
INNER = Camera(SIZE, [[62, 0, 31.1], [0, 63, 24.2], [0, 0, 1]])
OUTER = Camera(SIZE, [[38, 0, 31.1], [0, 39, 24.2], [0, 0, 1]])
MAP = undistort_map(CAMERA, INNER)

# Codec of the pictures, codec of the sound and the encoder's options.
CONTAINERS = {
    ".mp4": ("libx264", "aac", {}),
    ".mov": ("libx264", "pcm_s16le", {}),
    ".mkv": ("libx264", "flac", {}),
    ".webm": ("libvpx-vp9", "libopus", {"cpu-used": "8", "b": "0", "crf": "30"}),
    ".ts": ("libx264", "aac", {}),
    ".avi": ("mjpeg", "pcm_s16le", {}),
}


def undistort(
    source: Path, suffix: str = "", *, target: Path | None = None, camera: Camera = CAMERA, new: Camera = INNER, **options
) -> VideoResult:
    """Undistort, beside the source unless a target is given, with options of the encoding given by name."""
    own = {name: options.pop(name) for name in ("frames", "interpolation", "as_progressive") if name in options}
    target = target or source.with_name(f"{source.stem}_out{suffix or source.suffix}")
    chosen = VideoOptions(encoding=EncodingOptions(**options), **own)
    return undistort_video(source, target, undistort_map(camera, new), options=chosen)


def refused(source: Path, match: str, target: str = "refused.mp4", **options) -> str:
    """Undistort what cannot be, check that nothing is left, and return the one line that says why."""
    before = sorted(source.parent.iterdir())
    with pytest.raises(InputError, match=match) as raised:
        undistort(source, target=source.parent / target, **options)
    assert sorted(source.parent.iterdir()) == before
    text = str(raised.value)
    assert "\n" not in text
    return text


def sampled(plane: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Interpolate a plane linearly at points (..., 2) between its outermost samples."""
    last = np.array(plane.shape[::-1]) - 1
    xy = np.clip(xy, 0, last)
    low = np.minimum(xy.astype(int), last - 1)
    (u, v), (i, j) = np.moveaxis(xy - low, -1, 0), np.moveaxis(low, -1, 0)
    value = plane.astype(np.float64)
    return (1 - v) * ((1 - u) * value[j, i] + u * value[j, i + 1]) + v * ((1 - u) * value[j + 1, i] + u * value[j + 1, i + 1])
