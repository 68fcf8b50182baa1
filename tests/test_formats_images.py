"""Images read raw and written whole: depth, channels and every pixel, or a refusal."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np
import pytest
from described_images import ENCODED, GREY, PICTURE

from camcal.errors import InputError
from camcal.formats.images import EXTENSIONS, find_images, read_gray, read_image, write_image
from camcal.formats.imaging.opencv_log import quiet


@pytest.mark.parametrize("extension", sorted(EXTENSIONS))
def test_every_extension_is_readable(tmp_path: Path, extension: str) -> None:
    """What counts as an image can be read, in colour and in grey; what is cut off in the middle is refused."""
    done, encoded = cv2.imencode(extension, ENCODED.get(extension, PICTURE))
    assert done
    whole, half = tmp_path / f"whole{extension}", tmp_path / f"half{extension}"
    whole.write_bytes(encoded.tobytes())
    half.write_bytes(encoded.tobytes()[: encoded.size // 2])
    assert read_image(whole).shape[:2] == (40, 60)
    assert read_gray(whole).shape == (40, 60)
    assert [image.name for image in find_images([whole]).images] == [whole.name]
    for read in (read_image, read_gray):
        with pytest.raises(InputError, match=r"half\.\w+: truncated"):
            read(half)


@pytest.mark.parametrize(
    ("extension", "image"),
    [
        (".png", GREY),
        (".png", GREY.astype(np.uint16) * 257),
        (".png", np.dstack([PICTURE, GREY])),
        (".tif", PICTURE.astype(np.uint16) * 257),
        (".tif", PICTURE.astype(np.float32) / 3),
        (".bmp", PICTURE),
        (".pgm", GREY.astype(np.uint16) * 257),
        (".pfm", GREY.astype(np.float32) / 3),
    ],
    ids=lambda value: value if isinstance(value, str) else f"{value.dtype}-{value.ndim}",
)
def test_pixels_survive_lossless_formats(tmp_path: Path, extension: str, image: np.ndarray) -> None:
    """Depth, channels and every pixel come back."""
    write_image(tmp_path / f"image{extension}", image)
    found = read_image(tmp_path / f"image{extension}")
    assert found.dtype == image.dtype
    np.testing.assert_array_equal(found, image)


@pytest.mark.parametrize(
    ("image", "dtype"),
    [
        (PICTURE, np.uint8),
        (PICTURE.astype(np.uint16) * 257, np.uint16),
        (PICTURE.astype(np.float32), np.float32),
        (np.dstack([PICTURE, GREY]), np.uint8),
    ],
    ids=["uint8", "uint16", "float32", "alpha"],
)
def test_grey_keeps_the_depth(tmp_path: Path, image: np.ndarray, dtype: type) -> None:
    """Grey is 0.299 R + 0.587 G + 0.114 B, in the depth of the file."""
    write_image(tmp_path / "image.tif", image)
    grey = read_gray(tmp_path / "image.tif")
    assert grey.dtype == dtype
    expected = image[..., :3].astype(np.float64) @ [0.114, 0.587, 0.299]
    # Fixed-point weights of 14 bits and one rounding; floats are exact to 1e-6 of the range.
    tolerance = 1e-3 if dtype is np.float32 else 0.5 + int(image.max()) * 3 * 2.0**-14
    assert np.abs(grey - expected).max() <= tolerance


@pytest.mark.parametrize(
    ("extension", "image"),
    [
        (".png", GREY.astype(np.float32)),
        (".jpg", GREY.astype(np.uint16)),
        (".jpg", np.dstack([PICTURE, GREY])),
        (".pgm", PICTURE),
        (".webp", GREY.astype(np.uint16)),
        (".tif", GREY.astype(np.float64)),
        (".tif", np.dstack([GREY, GREY])),
        (".txt", GREY),
        ("", GREY),
    ],
)
def test_lossy_combinations_are_refused(tmp_path: Path, extension: str, image: np.ndarray) -> None:
    """Floats to PNG, 16 bits or alpha to JPEG, colour to PGM: refused, and nothing is written."""
    with pytest.raises(InputError, match=r"cannot hold|not a format to write"):
        write_image(tmp_path / f"image{extension}", image)
    assert not list(tmp_path.iterdir())


def test_a_photo_with_something_behind_its_end_is_read(tmp_path: Path) -> None:
    """Phones append films and depth maps to their JPEGs."""
    content = cv2.imencode(".jpg", PICTURE)[1].tobytes()
    path = tmp_path / "motion.jpg"
    path.write_bytes(content + b"\0" * 100 + b"\xff\xda" + b"film" * 100)
    assert read_image(path).shape == (40, 60, 3)
    assert [image.name for image in find_images([path]).images] == ["motion.jpg"]


def test_a_thumbnail_does_not_hide_that_a_photo_is_cut_off(tmp_path: Path) -> None:
    """The thumbnail within a JPEG's header has an end mark of its own."""
    thumbnail = cv2.imencode(".jpg", cv2.resize(PICTURE, (16, 12)))[1].tobytes()
    content = cv2.imencode(".jpg", PICTURE)[1].tobytes()
    segment = b"\xff\xe1" + (len(thumbnail) + 2).to_bytes(2) + thumbnail
    path = tmp_path / "photo.jpg"
    path.write_bytes(content[:2] + segment + content[2:])
    assert read_image(path).shape == (40, 60, 3)
    path.write_bytes(content[:2] + segment + content[2:-50])
    with pytest.raises(InputError, match="truncated"):
        find_images([path])


@pytest.mark.parametrize("extension", [".png", ".jp2", ".webp", ".tiff"])
def test_formats_with_a_choice_are_written_without_loss(tmp_path: Path, extension: str) -> None:
    """OpenCV's own defaults for JPEG 2000 and WebP lose something."""
    write_image(tmp_path / f"a{extension}", PICTURE)
    np.testing.assert_array_equal(read_image(tmp_path / f"a{extension}"), PICTURE)


def test_log_level_survives_overlapping_threads() -> None:
    """Of two blocks, the one that began first ends first: the level returns when both are over."""
    level = cv2.utils.logging.getLogLevel()
    with ExitStack() as first, ExitStack() as second:
        first.enter_context(quiet())
        second.enter_context(quiet())
        first.close()
        assert cv2.utils.logging.getLogLevel() == cv2.utils.logging.LOG_LEVEL_SILENT
    assert cv2.utils.logging.getLogLevel() == level


def test_log_level_of_opencv_is_left_as_it_was(tmp_path: Path) -> None:
    """Reading a broken file quietly does not silence OpenCV for good."""
    level = cv2.utils.logging.getLogLevel()
    (tmp_path / "a.bmp").write_bytes(cv2.imencode(".bmp", GREY)[1].tobytes()[:200])
    with pytest.raises(InputError):
        read_image(tmp_path / "a.bmp")
    assert cv2.utils.logging.getLogLevel() == level
