"""Formats of one image file undistorted: its coding is kept, what must be converted is said, what would be lost is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from image_files import (
    ALPHA,
    COLOUR,
    DEEP,
    FLOATS,
    GREY,
    HEIGHT,
    RGB,
    SAMPLINGS,
    SIZE,
    TURNED,
    WIDTH,
    as_stored,
    encoded,
    jpeg,
    tiff,
    undistorted,
)
from PIL import Image as Pillow

from camcal.errors import InputError
from camcal.formats.imaging.jpeg_header import jpeg_header


@pytest.mark.parametrize("sampling", SAMPLINGS)
@pytest.mark.parametrize(("quality", "expected"), [(60, 95), (95, 95), (99, 99)])
def test_coding_of_a_jpeg_is_kept(tmp_path: Path, sampling: str, quality: int, expected: int) -> None:
    """Chrominance is as fine as it was, and the quality at least 95, or the source's if that is higher."""
    content = jpeg(COLOUR, sampling, quality)
    path, _ = undistorted(tmp_path, content, "a.jpg")
    before, after = jpeg_header(content), jpeg_header(path.read_bytes())
    assert before.quality == quality
    assert (after.factors, after.quality, after.size, after.is_progressive) == (before.factors, expected, SIZE, False)
    path, _ = undistorted(tmp_path, content, "a.jpg", quality=71)
    assert jpeg_header(path.read_bytes()).quality == 71


@pytest.mark.parametrize(("asked", "written"), [(None, 1), ("zlib", 8)])
def test_compression_of_a_tiff_is_kept(tmp_path: Path, asked: str | None, written: int) -> None:
    """None stays none, deflate stays deflate."""
    path, _ = undistorted(tmp_path, tiff(GREY, compression=asked), "a.tif")
    with tifffile.TiffFile(path) as file:
        assert file.pages[0].compression == written


PALETTE = Pillow.fromarray(COLOUR[..., ::-1]).quantize(16)
GREY_ALPHA = Pillow.merge("LA", [Pillow.fromarray(GREY), Pillow.fromarray(ALPHA)])


@pytest.mark.parametrize(
    ("name", "content", "shape", "warning"),
    [
        ("a.png", encoded(PALETTE, "PNG"), (HEIGHT, WIDTH, 3), "palette image"),
        ("a.png", encoded(PALETTE, "PNG", transparency=3), (HEIGHT, WIDTH, 4), "palette image"),
        ("a.png", encoded(GREY_ALPHA, "PNG"), (HEIGHT, WIDTH, 4), "grey with alpha"),
        ("a.png", encoded(RGB.convert("1"), "PNG"), (HEIGHT, WIDTH), "1-bit image"),
        ("a.png", encoded(RGB.convert("L"), "PNG", transparency=5), (HEIGHT, WIDTH, 4), "transparent: written as colour with"),
        ("a.png", encoded(RGB, "PNG", transparency=(1, 2, 3)), (HEIGHT, WIDTH, 4), "transparent: written as an alpha"),
        ("a.bmp", encoded(PALETTE, "BMP"), (HEIGHT, WIDTH, 3), "palette image"),
        ("a.bmp", encoded(RGB.convert("1"), "BMP"), (HEIGHT, WIDTH), "1-bit image"),
        ("a.tif", encoded(PALETTE, "TIFF"), (HEIGHT, WIDTH, 3), "palette image"),
        ("a.tif", encoded(RGB.convert("1"), "TIFF"), (HEIGHT, WIDTH), "1-bit image"),
        ("a.tif", encoded(RGB.convert("YCbCr"), "TIFF"), (HEIGHT, WIDTH, 3), "luminance and chrominance"),
        ("a.pgm", b"P5 163 117 1023\n" + DEEP[..., 0].astype(">u2").tobytes(), (HEIGHT, WIDTH), "range up to 1023"),
        ("a.jpg", encoded(RGB, "PNG"), (HEIGHT, WIDTH, 3), "in truth a png file"),
    ],
)
def test_what_must_be_converted_is_said(tmp_path: Path, name: str, content: bytes, shape: tuple, warning: str) -> None:
    """Palettes, bits and transparent values cannot be interpolated: what they become is said in a warning."""
    path, warnings = undistorted(tmp_path, content, name)
    assert as_stored(path).shape == shape
    assert len(warnings) == 1
    assert warning in warnings[0]


@pytest.mark.parametrize(
    ("image", "target"), [(GREY, "a.webp"), (GREY, "a.ppm"), (DEEP[..., 0], "a.ppm")], ids=["webp", "ppm", "deep"]
)
def test_grey_becomes_colour_where_there_is_no_grey(tmp_path: Path, image: np.ndarray, target: str) -> None:
    """The three colours are what grey becomes in a PNG; that it is said, as it is of grey with alpha."""
    content = cv2.imencode(".png", image)[1].tobytes()
    plain, _ = undistorted(tmp_path, content, "a.png")
    path, warnings = undistorted(tmp_path, content, "a.png", target)
    np.testing.assert_array_equal(as_stored(path), np.dstack([as_stored(plain)] * 3))
    suffix = target.removeprefix("a")
    assert warnings[0] == f"grey: written as colour, the same value in each, because {suffix} has no grey"


def test_a_grey_jpeg_becomes_a_webp(tmp_path: Path) -> None:
    """Which has three channels of one value, but for what its coding of colours rounds."""
    path, warnings = undistorted(tmp_path, jpeg(GREY), "a.jpg", "a.webp")
    assert np.ptp(as_stored(path).astype(int), axis=2).max() <= 1
    assert "grey: written as colour" in warnings[0]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.jpg", encoded(RGB.convert("CMYK"), "JPEG"), "CMYK"),
        ("a.tif", encoded(RGB.convert("CMYK"), "TIFF"), "neither grey nor RGB"),
        ("a.tif", encoded(RGB.convert("LAB"), "TIFF"), "neither grey nor RGB"),
        ("a.tif", tiff(np.stack([GREY, ALPHA])), "2 images in one file"),
        ("a.tif", tiff(GREY.astype(np.float64)), "64 bits, float"),
        ("a.tif", tiff(GREY.astype(np.float16)), "16 bits, float"),
        ("a.tif", tiff(GREY.astype(np.int16)), "16 bits, signed"),
        ("a.tif", tiff(GREY.astype(np.uint32)), "32 bits, unsigned"),
        ("a.tif", tiff(np.moveaxis(DEEP, -1, 0), photometric="rgb", planarconfig="separate"), "stored apart"),
        ("a.tif", tiff(np.dstack([GREY] * 5), photometric="minisblack", planarconfig="contig"), "5 channels"),
        ("a.png", encoded(RGB, "PNG", save_all=True, append_images=[TURNED]), "animated"),
        ("a.webp", encoded(RGB, "WEBP", save_all=True, append_images=[TURNED]), "animated"),
        ("a.gif", encoded(RGB, "GIF", save_all=True, append_images=[TURNED]), "animated image of 2 frames"),
    ],
)
def test_what_would_be_lost_is_refused(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    """More than one picture in a file, colours that are not RGB, samples that are not computed with."""
    with pytest.raises(InputError, match=rf"{name}: cannot be changed without loss \(.*{message}"):
        undistorted(tmp_path, content, name, "a.png")
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize(
    ("image", "target", "message"),
    [
        (DEEP, "a.jpg", r"a.jpg: .*got uint16 with 3, .*Write .png or .tiff instead"),
        (DEEP, "a.webp", r"a.webp: .*Write .png or .tiff instead"),
        (FLOATS, "a.png", r"a.png: .*got float32 with 3, .*Write .tiff instead"),
        (np.dstack([COLOUR, ALPHA]), "a.jpg", r"a.jpg: .*got uint8 with 4, .*Write .png or .tiff instead"),
        (COLOUR, "a.pgm", r"a.pgm: .*got uint8 with 3, expected uint8 or uint16 with 1 channel\). Write .png or .tiff instead"),
        (COLOUR, "a.gif", r"a.gif: not a format to write \(got '.gif', expected one of .jpg"),
        (COLOUR, "a", r"a: not a format to write"),
    ],
)
def test_formats_that_cannot_hold_the_pixels_are_refused(tmp_path: Path, image: np.ndarray, target: str, message: str) -> None:
    """16 bits or alpha to JPEG, floats to PNG: refused with the formats that can, and nothing is written."""
    with pytest.raises(InputError, match=message):
        undistorted(tmp_path, cv2.imencode(".tiff", image)[1].tobytes(), "a.tiff", target)
    assert not list((tmp_path / "out").iterdir())
