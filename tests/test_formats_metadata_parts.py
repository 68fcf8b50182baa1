"""Metadata within JPEG, PNG, WebP and JPEG 2000: every part is copied byte for byte, or named."""

from __future__ import annotations

import io
import zlib
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from described_images import (
    BLOCK,
    EXIF,
    NOTE,
    PICTURE,
    PROFILE,
    RGB,
    XMP,
    beside,
    box,
    chunk,
    chunks,
    described,
    plain,
    profiled_jp2,
    segment,
)
from PIL import Image as Pillow

from camcal.formats.imaging.pixels import AS_STORED, decode
from camcal.formats.metadata import carry_metadata


def test_segments_of_a_jpeg_are_copied_byte_for_byte() -> None:
    """All of them in their order: a thumbnail in EXIF, extended XMP, a profile in parts, Photoshop's, Adobe's, unknown ones."""
    thumbnail = cv2.imencode(".jpg", cv2.resize(PICTURE, (16, 12)))[1].tobytes()
    own = [
        segment(0xE1, b"Exif\0\0" + BLOCK + thumbnail),
        segment(0xE1, b"http://ns.adobe.com/xap/1.0/\0" + XMP),
        segment(0xE1, b"http://ns.adobe.com/xmp/extension/\0" + bytes(500)),
        *(segment(0xE2, b"ICC_PROFILE\0" + bytes((part, 3)) + bytes(60_000)) for part in (1, 2, 3)),
        segment(0xED, b"Photoshop 3.0\0" + b"8BIM" * 9),
        segment(0xEE, b"Adobe\0d\0\0\0\0\1"),
        segment(0xFE, b"one\0"),
        segment(0xEB, bytes(range(256))),
        segment(0xFE, b"two"),
    ]
    source = plain("jpg")[:2] + b"".join(own) + plain("jpg")[20:]
    encoded = plain("jpg")
    content, warnings = carry_metadata(source, encoded, NOTE)
    assert beside(encoded) == [encoded[2:20]]
    # JFIF's segment is the encoder's, not the source's: a file without one stays so.
    assert beside(content) == [*own, segment(0xFE, NOTE.encode())]
    assert content.endswith(encoded[20:])
    assert warnings == ()


def test_jfif_is_the_source_s() -> None:
    """With its resolution, and first, as JFIF demands."""
    content, _ = carry_metadata(described("jpg"), plain("jpg"), NOTE)
    assert beside(content)[:-1] == beside(described("jpg"))
    assert content[2:4] == b"\xff\xe0"


def test_pictures_behind_the_picture_are_named() -> None:
    """An index of further pictures would point to nothing: index and pictures are left out, and that is said."""
    index = segment(0xE2, b"MPF\0" + bytes(40))
    start, rest = plain("jpg")[:20], plain("jpg")[20:]
    content, warnings = carry_metadata(start + index + rest + plain("jpg"), plain("jpg"), NOTE)
    assert index not in content
    assert warnings == ("not carried over: what follows the picture in its file (more pictures, a film or a depth map)",)
    # Padding is nothing to speak of.
    assert carry_metadata(start + rest + bytes(64), plain("jpg"), NOTE)[1] == ()


def test_chunks_of_a_png_are_copied_byte_for_byte() -> None:
    """Colour, resolution, texts and unknown chunks that are safe to copy; what depends on pixels is named instead."""
    kept = [
        chunk(b"gAMA", (45455).to_bytes(4)),
        chunk(b"cHRM", bytes(32)),
        chunk(b"pHYs", bytes(8) + b"\1"),
        chunk(b"sBIT", b"\5\6\5"),
        chunk(b"eXIf", BLOCK),
        chunk(b"tIME", b"\x07\xe8\1\1\0\0\0"),
        chunk(b"zTXt", b"Author\0\0" + zlib.compress(b"x" * 99)),
        chunk(b"abCd", b"anything"),
    ]
    coded = chunks(plain("png"))
    header, pixels = coded[0][1], b"".join(raw for kind, raw in coded if kind == b"IDAT")
    end = chunk(b"IEND", b"")
    late = [chunk(b"tEXt", b"Title\0t"), chunk(b"abCd", b"behind")]
    source = b"".join([plain("png")[:8], header, *kept, chunk(b"abCD", b"unsafe"), pixels, *late, end])
    content, warnings = carry_metadata(source, plain("png"), NOTE)
    found = chunks(content)
    note = chunk(b"iTXt", b"Comment\0\0\0\0\0" + NOTE.encode())
    assert [raw for kind, raw in found if kind not in {b"IHDR", b"IDAT", b"IEND"}] == [*kept, *late, note]
    assert found[0][0] == b"IHDR"
    assert found[-1][0] == b"IEND"
    assert warnings == ("not carried over: chunk abCD",)


def test_what_describes_a_palette_stays_behind() -> None:
    """Significant bits and background of a palette say nothing of colours."""
    stream = io.BytesIO()
    RGB.quantize(8).save(stream, "PNG")
    raw = stream.getvalue()
    palette = next(raw.index(kind) for kind in (b"PLTE",)) - 4
    source = raw[:palette] + chunk(b"sBIT", b"\5\6\5") + raw[palette:]
    content, _ = carry_metadata(source, plain("png"), NOTE)
    assert {kind for kind, _ in chunks(content)} == {b"IHDR", b"IDAT", b"IEND", b"iTXt"}


def test_chunks_of_a_webp_are_copied_byte_for_byte() -> None:
    """Unknown ones too; the flags say what is there, alpha included."""
    stream = io.BytesIO()
    image = RGB.copy()
    image.putalpha(100)
    image.save(stream, "WEBP", lossless=True, icc_profile=PROFILE, xmp=XMP)
    unknown = b"abcd" + (3).to_bytes(4, "little") + b"xyz\0"
    source = stream.getvalue() + unknown
    source = source[:4] + (len(source) - 8).to_bytes(4, "little") + source[8:]
    encoded = cv2.imencode(".webp", np.dstack([PICTURE, PICTURE[..., :1]]), [cv2.IMWRITE_WEBP_QUALITY, 101])[1].tobytes()
    content, warnings = carry_metadata(source, encoded, NOTE)
    result = Pillow.open(io.BytesIO(content))
    assert (result.mode, result.info["icc_profile"], result.info["xmp"]) == ("RGBA", PROFILE, XMP)
    assert result.getexif().get_ifd(0x8769)[37395] == NOTE
    assert content.endswith(unknown)
    assert int.from_bytes(content[4:8], "little") == len(content) - 8
    assert warnings == ()


def test_the_note_in_a_webp_with_exif_is_xmp() -> None:
    """EXIF stays as it is, byte for byte, and the note is where XMP keeps a history; what would be a mark-up is escaped."""
    stream = io.BytesIO()
    RGB.save(stream, "WEBP", lossless=True, exif=EXIF)
    content, warnings = carry_metadata(stream.getvalue(), plain("webp"), f"{NOTE} <&>")
    image = Pillow.open(io.BytesIO(content))
    history = ElementTree.fromstring(image.info["xmp"].strip()).find(".//{http://ns.adobe.com/photoshop/1.0/}History")
    assert history is not None
    assert history.text == f"{NOTE} <&>"
    assert image.info["exif"].removeprefix(b"Exif\0\0") == BLOCK
    assert warnings == ()


def test_boxes_of_a_jpeg_2000_are_copied_byte_for_byte() -> None:
    """Profile, EXIF and what nobody knows; the note is XMP, and XMP of its own stays as it is."""
    exif, unknown = box(b"uuid", b"JpgTiffExif->JP2" + BLOCK), box(b"abcd", b"xyz")
    content, warnings = carry_metadata(profiled_jp2(exif, unknown), plain("jp2"), NOTE)
    assert warnings == ()
    assert exif + unknown in content
    assert content.count(box(b"colr", b"\2\0\0" + PROFILE)) == content.count(b"colr") == 1
    assert b"<photoshop:History>" + NOTE.encode() in content
    assert Pillow.open(io.BytesIO(content)).size == (60, 40)
    np.testing.assert_array_equal(decode("a", content, AS_STORED), decode("a", plain("jp2"), AS_STORED))
    packet = box(b"uuid", bytes.fromhex("be7acfcb97a942e89c71999491e3afac") + XMP)
    content, (warning,) = carry_metadata(profiled_jp2(packet), plain("jp2"), NOTE)
    assert (packet in content, NOTE.encode() in content) == (True, False)
    assert "a note of the correction" in warning


@pytest.mark.parametrize("cut", [4, 12, 40, 60, 90, 300])
def test_half_a_jpeg_2000_does_no_harm(cut: int) -> None:
    """Boxes that are cut off are none."""
    carry_metadata(profiled_jp2()[:cut], plain("png"), NOTE)
