"""Metadata between formats: whole blocks go along, and what cannot is named."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
from described_images import BLOCK, EXIF, NOTE, PICTURE, PROFILE, RGB, XMP, box, chunk, described, plain, profiled_jp2, segments
from PIL import Image as Pillow

from camcal.formats.imaging.pixels import AS_STORED, decode
from camcal.formats.metadata import carry_metadata


@pytest.mark.parametrize("new", ["jpg", "png", "webp", "tif"])
@pytest.mark.parametrize("old", ["jpg", "png", "webp", "tif"])
def test_metadata_reach_every_format(old: str, new: str) -> None:
    """Pillow finds the same EXIF, XMP and profile in the result, whatever the two formats; the pixels are not touched."""
    encoded = plain(new)
    content, warnings = carry_metadata(described(old), encoded, NOTE)
    image = Pillow.open(io.BytesIO(content))
    exif = image.getexif()
    assert exif[0x010F] == "Maker"
    assert exif[0x0112] == 6
    assert float(exif.get_ifd(0x8769)[0x829A]) == pytest.approx(0.008)
    assert exif.get_ifd(0x8769)[0x927C] == bytes(range(256))
    assert tuple(map(float, exif.get_ifd(0x8825)[2])) == (48.0, 1.0, 2.5)
    assert image.info["icc_profile"] == PROFILE
    assert image.info["xmp"] == XMP
    if "webp" not in (old, new):
        # Whole dots per metre, which PNG stores, are finer than 0.02 dots per inch.
        assert image.info["dpi"] == pytest.approx((300, 300), abs=0.02)
    np.testing.assert_array_equal(decode("new", content, AS_STORED), decode("plain", encoded, AS_STORED))
    lost = (["comments"] if old in {"jpg", "png"} else []) + ["a note of the correction"] if new == "webp" else []
    if old == new:
        lost = lost[-1:]
    assert bool(warnings) == bool(lost)
    assert all(name in warnings[0] for name in lost)


@pytest.mark.parametrize("new", ["png", "jpg"])
def test_what_follows_a_png_is_named(new: str) -> None:
    """Padding is nothing to speak of."""
    assert carry_metadata(plain("png") + bytes(9), plain(new), NOTE)[1] == ()
    warning = "not carried over: what follows the picture in its file"
    assert carry_metadata(plain("png") + b"more", plain(new), NOTE)[1] == (warning,)


@pytest.mark.parametrize("new", ["bmp", "png", "tif", "jpg"])
def test_resolution_of_a_bmp(new: str) -> None:
    """11,811 pixels per metre are 300 dots per inch (11811 x 0.0254 = 299.9994) in every format that tells."""
    stream = io.BytesIO()
    RGB.save(stream, "BMP", dpi=(300, 300))
    content, warnings = carry_metadata(stream.getvalue(), plain(new), NOTE)
    assert Pillow.open(io.BytesIO(content)).info["dpi"] == pytest.approx((300, 300), abs=0.02)
    assert warnings == ()


def test_profile_in_a_bmp() -> None:
    """A header of the latest version may have one in the file: it goes where it can, and is missed by name where it cannot."""
    content = plain("bmp")
    start = int.from_bytes(content[10:14], "little")
    header = bytearray(124)
    header[:40] = content[14:54]
    header[:4] = (124).to_bytes(4, "little")
    header[56:60] = b"DEBM"
    pixels = content[start:]
    header[112:120] = struct.pack("<II", 124 + len(pixels), len(PROFILE))
    source = content[:10] + (138).to_bytes(4, "little") + bytes(header) + pixels + PROFILE
    np.testing.assert_array_equal(decode("a.bmp", source, AS_STORED), PICTURE)
    assert Pillow.open(io.BytesIO(carry_metadata(source, plain("png"), NOTE)[0])).info["icc_profile"] == PROFILE
    assert carry_metadata(source, plain("bmp"), NOTE)[1] == ("not carried over: colour profile",)


@pytest.mark.parametrize("other", ["jpg", "png", "tif"])
def test_metadata_from_and_to_jpeg_2000(other: str) -> None:
    """There and back: EXIF and profile are the same bytes; boxes that only it has are named."""
    there, _ = carry_metadata(described(other), plain("jp2"), NOTE)
    np.testing.assert_array_equal(decode("a", there, AS_STORED), decode("a", plain("jp2"), AS_STORED))
    back, warnings = carry_metadata(there, plain("jpg"), NOTE)
    image = Pillow.open(io.BytesIO(back))
    assert image.info["icc_profile"] == PROFILE
    assert image.getexif()[0x010F] == "Maker"
    assert image.info["xmp"] == XMP
    assert warnings == ()
    assert carry_metadata(profiled_jp2(box(b"abcd", b"xyz")), plain("png"), NOTE)[1] == ("not carried over: box abcd",)


def test_blocks_too_large_for_a_segment_are_named() -> None:
    """65,533 bytes fit into a segment; a profile is cut into as many as it takes, EXIF and XMP cannot be."""
    profile = bytes(np.random.default_rng(0).integers(0, 256, 200_000, dtype=np.uint8))
    source = b"".join(
        [
            plain("png")[:33],
            chunk(b"iCCP", b"x\0\0" + zlib.compress(profile)),
            chunk(b"eXIf", BLOCK + bytes(70_000)),
            chunk(b"iTXt", b"XML:com.adobe.xmp\0\0\0\0\0" + XMP + b" " * 70_000),
            plain("png")[33:],
        ]
    )
    content, (warning,) = carry_metadata(source, plain("jpg"), NOTE)
    assert Pillow.open(io.BytesIO(content)).info["icc_profile"] == profile
    assert warning == f"not carried over: EXIF of {len(BLOCK) + 70_000} bytes, XMP of {len(XMP) + 70_000} bytes"


def test_long_texts_are_not_cut() -> None:
    """A text that no segment of a JPEG can hold is named; the one that just fits, and the note, are there whole."""
    fits, long = "é" * 32_766 + "!", "b" * 65_534
    texts = [chunk(b"iTXt", b"Comment\0\0\0\0\0" + text.encode()) for text in (fits, long)]
    source = b"".join([plain("png")[:33], *texts, plain("png")[33:]])
    content, warnings = carry_metadata(source, plain("jpg"), NOTE)
    assert warnings == ("not carried over: comments of more than 65533 bytes",)
    assert [raw[4:].decode() for marker, raw in segments(content) if marker == 0xFE] == [fits, NOTE]


def test_formats_without_metadata_lose_them_by_name() -> None:
    """A PPM holds pixels and nothing else."""
    content, (warning,) = carry_metadata(described("jpg"), plain("ppm"), NOTE)
    assert content == plain("ppm")
    assert warning == "not carried over: EXIF, XMP, colour profile, comments, resolution"
    assert carry_metadata(plain("ppm"), plain("bmp"), NOTE) == (plain("bmp"), ())


def test_metadata_of_other_formats_are_named() -> None:
    """Those of AVIF are not read; if there are any, that is said."""
    stream = io.BytesIO()
    RGB.save(stream, "AVIF", exif=EXIF)
    assert carry_metadata(stream.getvalue(), plain("png"), NOTE)[1] == ("not carried over: metadata, its orientation",)


def test_a_turned_avif_is_named() -> None:
    """It says by a box, and not in EXIF, that players turn it: pixels are not, so that the picture would lie on its side."""
    stream = io.BytesIO()
    turned = Pillow.Exif()
    turned[274] = 6
    RGB.save(stream, "AVIF", exif=turned.tobytes())
    assert b"irot" in stream.getvalue()
    without_exif = stream.getvalue().replace(b"Exif", b"none")
    assert carry_metadata(without_exif, plain("png"), NOTE)[1] == ("not carried over: its orientation",)
