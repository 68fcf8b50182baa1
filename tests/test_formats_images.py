"""Images found by the rules, read raw, written whole."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image as Pillow

from camcal.errors import InputError
from camcal.formats.images import EXTENSIONS, find_images, read_gray, read_image, write_image
from camcal.formats.imaging.header import image_format, image_size
from camcal.formats.imaging.jpeg_header import jpeg_header
from camcal.formats.imaging.pixels import quiet

RNG = np.random.default_rng(0)
# Smooth, so that no codec has to give up on it.
PICTURE = cv2.GaussianBlur(RNG.integers(0, 255, (40, 60, 3), dtype=np.uint8), (0, 0), 3)
GREY = PICTURE[..., 0].copy()
# Beside colours, formats of their own kind: grey only, bits, floats.
ENCODED = {
    ".pgm": GREY,
    ".pbm": GREY,
    ".pfm": GREY.astype(np.float32),
    ".hdr": PICTURE / np.float32(255),
    ".pic": PICTURE / np.float32(255),
}


def make(folder: Path, *names: str) -> None:
    """Write the same small image under several names."""
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(cv2.imencode(".png", GREY)[1].tobytes())


def found_names(*inputs: str | Path) -> list[str]:
    """Names of the images found."""
    return [image.name for image in find_images(inputs).images]


def test_folder_gives_its_images_sorted(tmp_path: Path) -> None:
    """By name, whatever the case of the extension; other files are counted, folders and hidden files are not images."""
    make(tmp_path, "b.png", "a.PNG", "c.jpeg", ".hidden.png", "below/d.png")
    (tmp_path / "notes.txt").write_text("x")
    found = find_images([tmp_path])
    assert [image.name for image in found.images] == ["a.PNG", "b.png", "c.jpeg"]
    assert [image.path for image in found.images] == [tmp_path / "a.PNG", tmp_path / "b.png", tmp_path / "c.jpeg"]
    assert not any(image.named for image in found.images)
    assert [path.name for path in found.passed_over] == [".hidden.png", "notes.txt"]


def test_named_files_and_patterns(tmp_path: Path) -> None:
    """A file is named, what a pattern finds is not; a name with brackets in it is a file before it is a pattern."""
    make(tmp_path, "a1.png", "a2.png", "b1.png", "c[1].png", "deep/er/a3.png")
    (tmp_path / "a1.txt").write_text("x")
    found = find_images([tmp_path / "b1.png", str(tmp_path / "a*"), str(tmp_path / "c[1].png")])
    assert [(image.name, image.named) for image in found.images] == [
        ("a1.png", False),
        ("a2.png", False),
        ("b1.png", True),
        ("c[1].png", True),
    ]
    assert [path.name for path in found.passed_over] == ["a1.txt"]
    assert found_names(str(tmp_path / "**" / "a*.png")) == ["a1.png", "a2.png", "a3.png"]


def test_a_file_counts_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However it is reached: relative, absolute, through a folder or through a link."""
    make(tmp_path, "a.png", "b.png")
    (tmp_path / "link").symlink_to(tmp_path)
    monkeypatch.chdir(tmp_path)
    found = find_images([tmp_path, "a.png", "./b.png", tmp_path / "link", "link/a.png"])
    assert [(image.name, image.named) for image in found.images] == [("a.png", True), ("b.png", True)]


def test_equal_file_names_are_told_apart(tmp_path: Path) -> None:
    """By the path below the folder they have in common, with forward slashes; alone, a file name is enough."""
    make(tmp_path, "run/left/0.png", "run/left/1.png", "run/right/0.png")
    assert found_names(tmp_path / "run/left", tmp_path / "run/right") == ["left/0.png", "left/1.png", "right/0.png"]
    assert found_names(tmp_path / "run/left/1.png", tmp_path / "run/right") == ["0.png", "1.png"]


@pytest.mark.skipif(os.name != "posix", reason="file names of arbitrary bytes are POSIX's")
def test_names_fit_into_text_files(tmp_path: Path) -> None:
    """Bytes that are not UTF-8 and line breaks in a file name become escapes."""
    content = cv2.imencode(".png", GREY)[1].tobytes()
    with open(os.fsencode(tmp_path) + b"/caf\xe9\n.png", "wb") as stream:  # noqa: PTH123 - a path of bytes
        stream.write(content)
    (image,) = find_images([tmp_path]).images
    assert image.name == r"caf\xe9\n.png"
    assert read_image(image.path).shape == (40, 60)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("missing", "missing: no such file"),
        ("missing.png", "missing.png: no such file"),
        ("empty", "no images in this folder (it is empty)"),
        ("texts", "no images in this folder (2 of .heic, 1 of .txt)"),
        ("above", "no images in this folder (but there are some in images/)"),
        ("texts/*", "no image matches this pattern (3 other files do)"),
        ("*.jpg", "no image matches this pattern (0 other files do)"),
        ("texts/a.txt", "a.txt: not an image (got '.txt'"),
        ("texts/zero.png", "zero.png: empty file"),
    ],
)
def test_inputs_without_an_image_are_refused(tmp_path: Path, given: str, message: str) -> None:
    """Each input must give an image; the message says what is there instead."""
    (tmp_path / "empty").mkdir()
    make(tmp_path, "above/images/a.png")
    (tmp_path / "texts").mkdir()
    for name in ("a.txt", "b.heic", "c.heic"):
        (tmp_path / "texts" / name).write_text("x")
    if given.endswith("zero.png"):
        (tmp_path / given).touch()
    with pytest.raises(InputError) as caught:
        find_images([tmp_path / "above/images", tmp_path / given])
    assert message in str(caught.value)


def test_a_folder_that_cannot_be_read_is_an_input_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So is a name that the system cannot hold."""

    def refused(self: Path) -> None:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "iterdir", refused)
    for given in (tmp_path, "x" * 5000, "x" * 5000 + "*"):
        with pytest.raises(InputError, match=r"cannot be read|no such file|no image matches"):
            find_images([given])


def test_nothing_asked_for_is_refused() -> None:
    """No inputs, no images."""
    with pytest.raises(InputError, match="images: none given"):
        find_images([])


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
    assert found_names(whole) == [whole.name]
    for read in (read_image, read_gray):
        with pytest.raises(InputError, match=r"half\.\w+: truncated"):
            read(half)


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
    assert found_names(path) == ["motion.jpg"]


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


@pytest.mark.parametrize("extension", [".png", ".jp2", ".webp", ".tiff"])
def test_formats_with_a_choice_are_written_without_loss(tmp_path: Path, extension: str) -> None:
    """OpenCV's own defaults for JPEG 2000 and WebP lose something."""
    write_image(tmp_path / f"a{extension}", PICTURE)
    np.testing.assert_array_equal(read_image(tmp_path / f"a{extension}"), PICTURE)


@pytest.mark.parametrize("quality", range(1, 101))
def test_quality_of_a_jpeg_is_known(quality: int) -> None:
    """The lowest at which libjpeg's steps are as fine: its own figure, or a lower one with the same tables."""
    content = cv2.imencode(".jpg", PICTURE, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
    found = jpeg_header(content).quality
    again = cv2.imencode(".jpg", PICTURE, [cv2.IMWRITE_JPEG_QUALITY, found])[1].tobytes()
    assert found <= quality
    assert again == content


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
