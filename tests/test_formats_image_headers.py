"""Headers of images: format, size, orientation and quality, before anything is decoded."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from described_images import ENCODED, GREY, PICTURE
from PIL import Image as Pillow

from camcal.errors import InputError
from camcal.formats.images import EXTENSIONS, read_gray, read_image
from camcal.formats.imaging.header import image_format, image_size
from camcal.formats.imaging.jpeg_header import jpeg_header


@pytest.mark.parametrize("extension", [".png", ".jpg", ".tif", ".webp"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_not_applied(tmp_path: Path, extension: str, orientation: int) -> None:
    """A photo whose metadata ask for any turn or mirroring is read as the sensor saw it."""
    exif = Pillow.Exif()
    exif[0x0112] = orientation
    turned, plain = tmp_path / f"turned{extension}", tmp_path / f"plain{extension}"
    Pillow.fromarray(PICTURE[..., ::-1]).save(turned, exif=exif)
    Pillow.fromarray(PICTURE[..., ::-1]).save(plain)
    np.testing.assert_array_equal(read_image(turned), read_image(plain))
    np.testing.assert_array_equal(read_gray(turned), read_gray(plain))
    if extension in {".png", ".tif"}:
        np.testing.assert_array_equal(read_image(turned), PICTURE)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_orientation_is_found_in_every_kind_of_tiff(tmp_path: Path, order: str, big: bool) -> None:
    """Both byte orders, ordinary and BigTIFF, 16 bits: a quarter turn is not applied."""
    image = GREY.astype(np.uint16) * 257
    path = tmp_path / "turned.tif"
    tifffile.imwrite(path, image, byteorder=order, bigtiff=big, extratags=[(274, 3, 1, 6, True)])  # type: ignore[arg-type]
    np.testing.assert_array_equal(read_image(path), image)


@pytest.mark.parametrize("extension", sorted(EXTENSIONS))
def test_size_is_known_before_decoding(extension: str) -> None:
    """From the header of every format that is read; of half a header, nothing or the same."""
    content = cv2.imencode(extension, ENCODED.get(extension, PICTURE))[1].tobytes()
    assert image_format(content) is not None
    assert image_size(content) == (60, 40)
    for length in (1, 5, 12, 17, 25):
        assert image_size(content[:length]) in {None, (60, 40)}


@pytest.mark.parametrize("size", [(1, 1), (300, 2), (16383, 1), (2, 16383)])
@pytest.mark.parametrize("options", [{"lossless": True}, {"quality": 80}])
def test_size_of_webp(size: tuple[int, int], options: dict[str, object]) -> None:
    """Both kinds of WebP, with and without the chunk that metadata need, up to the largest sides."""
    for more in ({}, {"exif": Pillow.Exif().tobytes()}):
        stream = io.BytesIO()
        Pillow.new("RGB", size).save(stream, "WEBP", **options, **more)
        assert image_size(stream.getvalue()) == size


@pytest.mark.parametrize(
    ("content", "size"),
    [
        (b"P6\n# a comment\n 7\t8\n255\n", (7, 8)),
        (b"P7\nWIDTH 7\nHEIGHT 8\nDEPTH 1\nMAXVAL 255\nENDHDR\n", (7, 8)),
        (b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 7\n", (7, 8)),
        (b"BM" + bytes(16) + (7).to_bytes(4, "little") + (-8).to_bytes(4, "little", signed=True), (7, 8)),
        (b"BM" + bytes(12) + (12).to_bytes(4, "little") + b"\7\0\x08\0", (7, 8)),
        (b"\xff\x4f\xff\x51" + bytes(4) + b"".join(n.to_bytes(4) for n in (10, 12, 3, 4)), (7, 8)),
        (b"P6\nseven 8\n255\n", None),
        (b"\x89PNG\r\n\x1a\n" + bytes(30), None),
        (b"\xff\xd8\xff\xd9", None),
        (b"II*\0\xff\xff\xff\xff", None),
        (b"no image at all", None),
    ],
)
def test_sizes_in_odd_headers(content: bytes, size: tuple[int, int] | None) -> None:
    """Comments in a PPM, a BMP from top to bottom or of the oldest kind, bare JPEG 2000, headers not what they seem."""
    assert image_size(content) == size


@pytest.mark.parametrize("read", [read_image, read_gray])
def test_too_many_pixels_are_refused(tmp_path: Path, read: Callable[..., np.ndarray]) -> None:
    """Before decoding: the file is cut off behind its header, and the message is about the pixels."""
    path = tmp_path / "a.ppm"
    path.write_bytes(b"P6\n30000 20000\n255\n")
    with pytest.raises(InputError, match=r"a.ppm: too many pixels \(got 30000x20000, expected at most 400 million\)"):
        read(path)
    path.write_bytes(cv2.imencode(".ppm", PICTURE)[1].tobytes())
    assert read(path, most_pixels=2400).shape[:2] == (40, 60)
    with pytest.raises(InputError, match="too many pixels"):
        read(path, most_pixels=2399)


@pytest.mark.parametrize("quality", range(1, 101))
def test_quality_of_a_jpeg_is_known(quality: int) -> None:
    """The lowest at which libjpeg's steps are as fine: its own figure, or a lower one with the same tables."""
    content = cv2.imencode(".jpg", PICTURE, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
    found = jpeg_header(content).quality
    again = cv2.imencode(".jpg", PICTURE, [cv2.IMWRITE_JPEG_QUALITY, found])[1].tobytes()
    assert found <= quality
    assert again == content
