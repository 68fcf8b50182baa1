"""Image files that are cut off or damaged anywhere: refused one by one, and nothing of another image in their place."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from image_files import COLOUR, DEEP, FLOATS, GREY, RGB, encoded, jpeg, tiff, undistorted
from messages import one_line
from undistort_files import make_images, picture

from camcal.errors import InputError
from camcal.formats.imaging.fidelity import refuse_loss
from camcal.formats.imaging.header import image_size
from camcal.formats.imaging.pixels import check_content
from camcal.formats.metadata import carry_metadata

CONTENTS = {
    "a.jpg": jpeg(COLOUR),
    "exif.jpg": encoded(RGB, "JPEG", exif=b"Exif\0\0" + tiff(GREY[:4, :4]), dpi=(300, 300), comment=b"text"),
    "a.png": encoded(RGB, "PNG", dpi=(300, 300)),
    "palette.png": encoded(RGB.quantize(), "PNG"),
    "bit.png": encoded(RGB.convert("1"), "PNG", transparency=0),
    "a.webp": encoded(RGB, "WEBP", lossless=True),
    "lossy.webp": encoded(RGB, "WEBP", exif=b"Exif\0\0" + tiff(GREY[:4, :4])),
    "a.bmp": encoded(RGB, "BMP"),
    "palette.bmp": encoded(RGB.quantize(), "BMP"),
    "a.tif": tiff(COLOUR, resolution=(300, 300)),
    "big.tif": tiff(COLOUR, bigtiff=True, resolution=(300, 300)),
    "order.tif": tiff(DEEP, bigtiff=True, byteorder=">"),
    "a.gif": encoded(RGB.quantize(), "GIF"),
    "a.avif": encoded(RGB, "AVIF"),
    "floats.pfm": cv2.imencode(".pfm", FLOATS)[1].tobytes(),
    **{f"a{end}": cv2.imencode(end, COLOUR)[1].tobytes() for end in (".ppm", ".jp2", ".sr")},
}
TARGETS = [cv2.imencode(end, COLOUR)[1].tobytes() for end in (".jpg", ".png", ".tif", ".webp", ".bmp", ".jp2", ".ppm")]
HEADER_BYTES = 200
COPIES = 60


def damaged(name: str) -> list[bytes]:
    """Beginnings of every length that a header may have, and copies with bytes overwritten, mostly near the beginning."""
    content, draw = CONTENTS[name], random.Random(name)
    found = [content[:length] for length in range(HEADER_BYTES)]
    for _ in range(COPIES):
        copy = bytearray(content)
        for _ in range(draw.choice((1, 2, 8))):
            copy[draw.randrange(draw.choice((16, 64, HEADER_BYTES, len(copy))))] = draw.choice((0, 1, 127, 128, 255))
        found.append(bytes(copy))
    return found


def refusal(attempt: Callable[[], object]) -> str:
    """Say why something is refused; nothing if it is not."""
    try:
        attempt()
    except InputError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("name", CONTENTS)
def test_no_damage_is_more_than_a_refusal(tmp_path: Path, name: str) -> None:
    """A parser that meets what cannot be refuses the file: nothing else may leave it, or a run over many would end there."""
    path = tmp_path / name
    for content in damaged(name):
        image_size(content)
        path.write_bytes(content)
        attempts = [
            lambda content=content: check_content(path, content),
            lambda content=content: refuse_loss(path, content),
            lambda content=content: undistorted(tmp_path, content, name, "a.png"),
        ]
        attempts += [lambda content=content, new=new: carry_metadata(content, new, "note", path) for new in TARGETS]
        for attempt in attempts:
            assert "\n" not in refusal(attempt)


@pytest.mark.parametrize("name", CONTENTS)
def test_a_header_alone_never_shows_the_image_before_it(tmp_path: Path, name: str) -> None:
    """OpenCV leaves memory as it is when it cannot read a header: the image before must not come out a second time."""
    undistorted(tmp_path, CONTENTS[name], f"before_{name}", "before.tif")
    for length in range(1, HEADER_BYTES):
        with pytest.raises(InputError, match=name):
            undistorted(tmp_path, CONTENTS[name][:length], name, "after.tif")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["before.tif"]


def test_a_picture_may_begin_like_the_mark(tmp_path: Path) -> None:
    """What tells that memory was left as it was may stand in a picture too: it is read all the same, on top of its like."""
    image = COLOUR.copy()
    image.reshape(-1)[:8] = 85, 170, 17, 204, 51, 238, 102, 153
    content = cv2.imencode(".bmp", image)[1].tobytes()
    results = [undistorted(tmp_path, content, "a.bmp", f"{index}.bmp")[0].read_bytes() for index in range(3)]
    assert results[0] == results[1] == results[2]


@pytest.mark.parametrize("length", [2, 12, 17, 25, 45])
def test_a_cut_bmp_in_a_folder_is_passed_over(tmp_path: Path, run, camera_file: Path, length: int) -> None:
    """The images before and behind it are done; it is named."""
    folder = make_images(tmp_path / "in", "a.bmp", "b.bmp", "c.bmp")
    (folder / "b.bmp").write_bytes((folder / "b.bmp").read_bytes()[:length])
    code, _, err = run("undistort", folder, "--camera", camera_file, "-o", tmp_path / "out", "-j", "1")
    assert code == 2
    assert f"b.bmp: passed over: truncated image (it ends after {length} bytes)" in err
    assert sorted(path.name for path in (tmp_path / "out").glob("*.bmp")) == ["a.bmp", "c.bmp"]


@pytest.mark.parametrize("place", [slice(8, 16), slice(12, 16)])
def test_a_bigtiff_that_points_far_beyond_its_end(tmp_path: Path, run, camera_file: Path, place: slice) -> None:
    """Its first directory would stand where no file reaches: refused in one line by every command that reads images."""
    content = bytearray(tiff(picture(), bigtiff=True))
    content[place] = b"\xff" * (place.stop - place.start)
    path = tmp_path / "far.tif"
    path.write_bytes(bytes(content))
    assert image_size(bytes(content)) is None
    for arguments in (
        ("undistort", path, "--camera", camera_file, "-o", tmp_path / "out"),
        ("detect", path, "--board", "checkerboard:7x6:20mm"),
        ("calibrate", path, "--board", "checkerboard:7x6:20mm", "-o", tmp_path / "out"),
    ):
        code, _, err = run(*arguments)
        assert code in {2, 3}
        assert "far.tif" in one_line(err)


def test_resolution_that_a_png_cannot_hold(tmp_path: Path) -> None:
    """4,294,967,295 pixels per centimetre are more than 2^31 - 1 per metre, where PNG's numbers end."""
    content = tiff(COLOUR, resolution=(2**32 - 1, 2**32 - 1), resolutionunit=3)
    path, _ = undistorted(tmp_path, content, "a.tif", "a.png")
    scale = path.read_bytes().partition(b"pHYs")[2]
    assert np.frombuffer(scale[:8], ">u4").tolist() == [2**31 - 1] * 2
