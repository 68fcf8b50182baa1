"""Pictures to undistort in files of every kind, what they must become, and what they became."""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
import tifffile
from PIL import Image as Pillow

from camcal.geometry.camera import Camera
from camcal.undistortion.maps import undistort_map, valid_mask
from camcal.workflows.undistort.image import ImageOptions, undistort_image_file

# Odd on purpose: chrominance then ends between two pixels.
SIZE = WIDTH, HEIGHT = 163, 117
K = [[150.0, 0, 83], [0, 151, 57], [0, 0, 1]]
DIST = [-0.2, 0.05, 0.001, -0.002, 0, 0, 0, 0]
MAP = undistort_map(Camera(SIZE, K, DIST), Camera(SIZE, K))
VALID = valid_mask(MAP) == 255


def picture(sigma: float = 2.5) -> np.ndarray:
    """A smooth colour picture of full contrast."""
    noise = np.random.default_rng(5).normal(size=(HEIGHT, WIDTH, 3))
    return cv2.normalize(cv2.GaussianBlur(noise, (0, 0), sigma), None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


COLOUR = picture()
GREY = COLOUR[..., 0].copy()
ALPHA = COLOUR[..., 1].copy()
DEEP = COLOUR.astype(np.uint16) * 257
FLOATS = COLOUR.astype(np.float32) / 7
SAMPLINGS = ("411", "420", "422", "440", "444")
RGB = Pillow.fromarray(COLOUR[..., ::-1])
TURNED = RGB.transpose(Pillow.Transpose.ROTATE_180)


def exact(image: np.ndarray) -> np.ndarray:
    """What OpenCV's maps and float arithmetic make of an image: float64, NaN where nothing is seen."""
    map_x, map_y = cv2.initUndistortRectifyMap(np.array(K), np.array(DIST), None, np.array(K), SIZE, cv2.CV_32FC1)
    result = cv2.remap(image.astype(np.float32), map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.where(VALID.reshape(VALID.shape + (1,) * (image.ndim - 2)), result.astype(np.float64), np.nan)


def psnr(image: np.ndarray, reference: np.ndarray) -> float:
    """Peak signal to noise ratio in dB where the reference is known."""
    return float(10 * np.log10(255**2 / np.nanmean((image.astype(np.float64) - reference) ** 2)))


def jpeg(image: np.ndarray, sampling: str = "420", quality: int = 95, progressive: bool = False) -> bytes:
    """Encode a JPEG."""
    factor = getattr(cv2, f"IMWRITE_JPEG_SAMPLING_FACTOR_{sampling}")
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, factor]
    return cv2.imencode(".jpg", image, [*options, cv2.IMWRITE_JPEG_PROGRESSIVE, int(progressive)])[1].tobytes()


def encoded(image: Pillow.Image, kind: str, **options: object) -> bytes:
    """Encode by Pillow."""
    stream = io.BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()


def tiff(image: np.ndarray, **options: object) -> bytes:
    """Encode a TIFF by tifffile; colours in the order red, green, blue."""
    stream = io.BytesIO()
    tifffile.imwrite(stream, image, **options)
    return stream.getvalue()


def undistorted(folder: Path, content: bytes, source: str, target: str | None = None, **options: object) -> tuple[Path, tuple]:
    """Undistort a file of some content; where to, and the warnings."""
    (folder / "in").mkdir(exist_ok=True)
    (folder / "out").mkdir(exist_ok=True)
    path, result = folder / "in" / source, folder / "out" / (target or source)
    path.write_bytes(content)
    return result, undistort_image_file(path, result, MAP, ImageOptions(**options))


def as_stored(path: Path) -> np.ndarray:
    """Decode with depth and channels kept."""
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
