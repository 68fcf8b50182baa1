"""Metadata: byte for byte within a format, as whole blocks between formats, and named where they cannot go along."""

from __future__ import annotations

import io
import struct
import zlib
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image as Pillow
from PIL import ImageCms, PngImagePlugin, TiffImagePlugin

from camcal.formats.imaging.pixels import AS_STORED, decode
from camcal.formats.imaging.tiff_tags import SHORT, Directory, Tag, read_directories, text_tag, tiff_block
from camcal.formats.metadata import carry_metadata

RNG = np.random.default_rng(0)
PICTURE = cv2.GaussianBlur(RNG.integers(0, 255, (40, 60, 3), dtype=np.uint8), (0, 0), 3)
RGB = Pillow.fromarray(PICTURE[..., ::-1])
NOTE = "camcal: lens distortion removed"
PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
XMP = b'<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/"/><?xpacket end="w"?>'


def made_exif() -> Pillow.Exif:
    """Orientation, maker, exposure, a maker's note and a place."""
    exif = Pillow.Exif()
    exif[0x0112] = 6
    exif[0x010F] = "Maker"
    exif.get_ifd(0x8769)[0x829A] = 0.008
    exif.get_ifd(0x8769)[0x927C] = bytes(range(256))
    exif.get_ifd(0x8825)[2] = (48.0, 1.0, 2.5)
    return exif


EXIF = made_exif().tobytes()
BLOCK = EXIF.removeprefix(b"Exif\0\0")


def plain(kind: str) -> bytes:
    """An encoded picture without metadata."""
    return cv2.imencode(f".{kind}", PICTURE)[1].tobytes()


def described(kind: str) -> bytes:
    """An encoded picture with EXIF, XMP, profile, resolution and, where there are such, comments."""
    stream = io.BytesIO()
    if kind == "jpg":
        RGB.save(stream, "JPEG", exif=EXIF, icc_profile=PROFILE, xmp=XMP, comment=b"hello", dpi=(300, 300))
    elif kind == "png":
        texts = PngImagePlugin.PngInfo()
        texts.add_text("Comment", "hello")
        texts.add_text("Author", "somebody " * 50, zip=True)
        texts.add_itxt("XML:com.adobe.xmp", XMP.decode(), zip=True)
        RGB.save(stream, "PNG", exif=EXIF, icc_profile=PROFILE, pnginfo=texts, dpi=(300, 300))
    elif kind == "webp":
        RGB.save(stream, "WEBP", lossless=True, exif=EXIF, icc_profile=PROFILE, xmp=XMP)
    else:
        exif = made_exif()
        tags = TiffImagePlugin.ImageFileDirectory_v2()
        tags[700] = XMP
        for code in (0x0112, 0x010F):
            tags[code] = exif[code]
        for code in (0x8769, 0x8825):
            tags[code] = dict(exif.get_ifd(code))
        RGB.save(stream, "TIFF", tiffinfo=tags, icc_profile=PROFILE, dpi=(300, 300))
    return stream.getvalue()


def segments(content: bytes) -> list[tuple[int, bytes]]:
    """Segments of a JPEG up to its first scan."""
    found = []
    position = 2
    while content[position + 1] != 0xDA:
        end = position + 2 + int.from_bytes(content[position + 2 : position + 4])
        found.append((content[position + 1], content[position:end]))
        position = end
    return found


def beside(content: bytes) -> list[bytes]:
    """Application and comment segments of a JPEG."""
    return [raw for marker, raw in segments(content) if 0xE0 <= marker <= 0xEF or marker == 0xFE]


def segment(marker: int, body: bytes) -> bytes:
    """A JPEG segment."""
    return bytes((0xFF, marker)) + (len(body) + 2).to_bytes(2) + body


def chunks(content: bytes) -> list[tuple[bytes, bytes]]:
    """Chunks of a PNG."""
    found = []
    position = 8
    while position < len(content):
        end = position + 12 + int.from_bytes(content[position : position + 4])
        found.append((content[position + 4 : position + 8], content[position:end]))
        position = end
    return found


def chunk(kind: bytes, body: bytes) -> bytes:
    """A PNG chunk."""
    return len(body).to_bytes(4) + kind + body + zlib.crc32(kind + body).to_bytes(4)


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


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_tags_of_every_kind_of_tiff(order: str, big: bool) -> None:
    """Both byte orders, classic and BigTIFF: numbers of every width arrive, and those of the pixels are the new file's."""
    extra = [
        (274, 3, 1, 6, True),
        (65000, 4, 3, (1, 70_000, 3), True),
        (65001, 12, 2, (0.1, -1e300), True),
        (65002, 5, 1, (1, 3), True),
        (65003, 9, 2, (-5, 7), True),
        (65004, 7, 5, b"\1\2\3\4\5", True),
        (65005, 11, 1, 0.5, True),
        (65006, 8, 3, (-1, 2, -3), True),
    ]
    stream = io.BytesIO()
    described = {"description": "text", "software": "maker", "resolution": (300, 150), "resolutionunit": 3}
    tifffile.imwrite(
        stream, PICTURE, photometric="rgb", byteorder=order, bigtiff=big, extratags=extra, rowsperstrip=7, **described
    )
    content, warnings = carry_metadata(stream.getvalue(), plain("tif"), NOTE)
    with tifffile.TiffFile(io.BytesIO(stream.getvalue())) as before, tifffile.TiffFile(io.BytesIO(content)) as after:
        tags = {tag.code: tag.value for tag in after.pages[0].tags}
        for code in (270, 274, 282, 283, 296, 305, *range(65000, 65007)):
            assert tags[code] == before.pages[0].tags[code].value
        assert tags[34665]["ImageHistory"] == NOTE
    assert tags[278] != 7
    assert warnings == ()


def test_history_grows() -> None:
    """What was done before stays, in its own line."""
    once, _ = carry_metadata(plain("tif"), plain("tif"), "first")
    twice, _ = carry_metadata(once, plain("tif"), "second")
    with tifffile.TiffFile(io.BytesIO(twice)) as file:
        assert file.pages[0].tags[34665].value["ImageHistory"] == "first\nsecond"


def test_reduced_images_of_a_tiff_are_named() -> None:
    """A preview would still show the lens."""
    stream = io.BytesIO()
    with tifffile.TiffWriter(stream) as file:
        file.write(PICTURE, photometric="rgb")
        file.write(PICTURE[::4, ::4], photometric="rgb", subfiletype=1)
    _, warnings = carry_metadata(stream.getvalue(), plain("tif"), NOTE)
    assert warnings == ("not carried over: reduced images",)


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


def box(kind: bytes, body: bytes) -> bytes:
    """A JPEG 2000 box."""
    return (8 + len(body)).to_bytes(4) + kind + body


def profiled_jp2(*beside: bytes) -> bytes:
    """A JPEG 2000 with a colour profile, and other boxes before the pixels."""
    content = plain("jp2")
    start, end = content.index(b"jp2h") - 4, content.index(b"jp2c") - 4
    stored = content[start + 8 : content.index(b"colr") - 4]
    return content[:start] + box(b"jp2h", stored + box(b"colr", b"\2\0\0" + PROFILE)) + b"".join(beside) + content[end:]


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


@pytest.mark.parametrize("cut", [4, 12, 40, 60, 90, 300])
def test_half_a_jpeg_2000_does_no_harm(cut: int) -> None:
    """Boxes that are cut off are none."""
    carry_metadata(profiled_jp2()[:cut], plain("png"), NOTE)


def test_blocks_too_large_for_a_segment_are_named() -> None:
    """65,533 bytes fit into a segment; a profile is cut into as many as it takes, EXIF and XMP cannot be."""
    profile = bytes(RNG.integers(0, 256, 200_000, dtype=np.uint8))
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


def test_another_size_contradicts_exif() -> None:
    """EXIF is not touched, but a warning says that its size is the source's."""
    small = cv2.imencode(".jpg", PICTURE[:20, :30])[1].tobytes()
    assert carry_metadata(described("jpg"), small, NOTE)[1] == ("EXIF still states the size of the source",)
    assert carry_metadata(plain("jpg"), small, NOTE)[1] == ()


@pytest.mark.parametrize("cut", range(0, len(BLOCK), 7))
def test_damaged_exif_does_no_harm(cut: int) -> None:
    """However it is cut off, what is left of it is read, and a TIFF with it can be opened."""
    source = plain("png")[:33] + chunk(b"eXIf", BLOCK[:cut]) + plain("png")[33:]
    content, _ = carry_metadata(source, plain("tif"), NOTE)
    with tifffile.TiffFile(io.BytesIO(content)) as file:
        np.testing.assert_array_equal(decode("tiff", content, AS_STORED), PICTURE)
        assert file.pages[0].tags[34665].value["ImageHistory"] == NOTE


def test_directories_that_lead_in_circles() -> None:
    """A chain that returns to its start, and a part that is its own part, are read once or a few times."""
    looped = b"II*\0" + struct.pack("<IHHHIII", 8, 1, 34665, 4, 1, 8, 8)
    (directory,) = read_directories(looped)
    assert list(directory.parts) == [34665]
    assert read_directories(b"II*\0") == []
    assert read_directories(b"II*\0" + struct.pack("<IH", 8, 65535)) == []


def test_tags_come_back_from_a_block() -> None:
    """Written and read again: short values in the entry, long ones behind, parts of parts."""
    inner = Directory({1: text_tag(1, "R98")})
    outer = Directory(
        {271: text_tag(271, "a long maker"), 274: Tag(274, SHORT, b"\6\0")}, {34665: Directory({}, {40965: inner})}
    )
    (found,) = read_directories(tiff_block(outer))
    assert found.tags[271].value == b"a long maker\0"
    assert found.number(274, 0) == 6
    assert found.parts[34665].parts[40965].tags[1].value == b"R98\0"
