"""Tags of TIFF and EXIF: numbers of every kind arrive, a history grows, and damaged ones do no harm."""

from __future__ import annotations

import io
import struct

import cv2
import numpy as np
import pytest
import tifffile
from described_images import BLOCK, NOTE, PICTURE, chunk, described, plain

from camcal.formats.imaging.pixels import AS_STORED, decode
from camcal.formats.imaging.tiff_tags import SHORT, Directory, Tag, read_directories, text_tag, tiff_block
from camcal.formats.metadata import carry_metadata


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
