"""What pixels an image's header promises, against what decoding gives."""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image as Pillow

from camcal.formats.imaging.foretold import foretold_pixels
from camcal.formats.imaging.pixels import channels_of, decode_into

COLOUR = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)
GREY, ALPHA, DEEP = COLOUR[..., 0], np.dstack([COLOUR, COLOUR[..., :1]]), COLOUR.astype(np.uint16) * 257
RGB, PALETTE = Pillow.fromarray(COLOUR), Pillow.fromarray(COLOUR).quantize(16)


def _pillow(image: Pillow.Image, kind: str, **options: object) -> bytes:
    """Encode by Pillow."""
    stream = io.BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()


def _tiff(image: np.ndarray, **options: object) -> bytes:
    """Encode by tifffile."""
    stream = io.BytesIO()
    tifffile.imwrite(stream, image, **options)
    return stream.getvalue()


def _opencv(extension: str, image: np.ndarray) -> bytes:
    """Encode by OpenCV."""
    return cv2.imencode(extension, image)[1].tobytes()


FILES = {
    "jpeg": _pillow(RGB, "JPEG"),
    "grey jpeg": _pillow(RGB.convert("L"), "JPEG"),
    "png": _pillow(RGB, "PNG"),
    "grey png": _pillow(RGB.convert("L"), "PNG"),
    "1-bit png": _pillow(RGB.convert("1"), "PNG"),
    "grey png with alpha": _pillow(RGB.convert("LA"), "PNG"),
    "png with alpha": _pillow(RGB.convert("RGBA"), "PNG"),
    "palette png": _pillow(PALETTE, "PNG"),
    "palette png, one transparent": _pillow(PALETTE, "PNG", transparency=3),
    "png, one colour transparent": _pillow(RGB, "PNG", transparency=(1, 2, 3)),
    "png, one grey transparent": _pillow(RGB.convert("L"), "PNG", transparency=3),
    "16-bit png": _opencv(".png", DEEP),
    "pgm": _opencv(".pgm", GREY),
    "16-bit pgm": _opencv(".pgm", DEEP[..., 0]),
    "ppm": _opencv(".ppm", COLOUR),
    "tiff": _tiff(COLOUR),
    "tiff with alpha": _tiff(ALPHA, photometric="rgb", extrasamples=["unassalpha"]),
    "16-bit tiff": _tiff(DEEP),
    "float tiff": _tiff(GREY.astype(np.float32)),
    "1-bit tiff": _tiff(GREY > 100),
    "tiff, white is zero": _tiff(GREY, photometric="miniswhite"),
    "palette tiff": _tiff(GREY, photometric="palette", colormap=np.zeros((3, 256), np.uint16)),
    "jpeg in tiff": _pillow(RGB, "TIFF", compression="jpeg"),
}


@pytest.mark.parametrize("kind", FILES)
def test_the_header_tells_what_decoding_gives(tmp_path, kind):
    """The same dtype and number of channels."""
    path = Path(tmp_path / "image")
    path.write_bytes(FILES[kind])
    image, _ = decode_into(path, FILES[kind], None)
    assert foretold_pixels(FILES[kind]) == (image.dtype, channels_of(image))


def test_other_formats_are_not_foretold():
    """What no header here is read for shows when it is decoded."""
    assert foretold_pixels(_pillow(RGB, "WEBP")) is None
    assert foretold_pixels(_pillow(RGB, "GIF")) is None
    assert foretold_pixels(b"P5 no numbers") is None
