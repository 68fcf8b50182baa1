"""One image file in, one out: exact pixels, nothing converted or lost unnoticed, whatever comes in."""

from __future__ import annotations

import errno
import io
import subprocess
import sys
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image as Pillow

from camcal.errors import InputError
from camcal.formats.imaging.jpeg_header import jpeg_header
from camcal.geometry.camera import Camera
from camcal.undistortion.maps import undistort_map, valid_mask
from camcal.workflows.undistort.image import ImageOptions, undistort_image_file

# Odd on purpose: chrominance then ends between two pixels.
SIZE = WIDTH, HEIGHT = 163, 117
K = [[150.0, 0, 83], [0, 151, 57], [0, 0, 1]]
DIST = [-0.2, 0.05, 0.001, -0.002, 0, 0, 0, 0]
MAP = undistort_map(Camera(SIZE, K, DIST), Camera(SIZE, K))
VALID = valid_mask(MAP) == 255

RNG = np.random.default_rng(5)


def picture(sigma: float = 2.5) -> np.ndarray:
    """A smooth colour picture of full contrast."""
    noise = RNG.normal(size=(HEIGHT, WIDTH, 3))
    return cv2.normalize(cv2.GaussianBlur(noise, (0, 0), sigma), None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)


COLOUR = picture()
GREY = COLOUR[..., 0].copy()
ALPHA = COLOUR[..., 1].copy()
DEEP = COLOUR.astype(np.uint16) * 257
FLOATS = COLOUR.astype(np.float32) / 7
SAMPLINGS = ("411", "420", "422", "440", "444")


def exact(image: np.ndarray) -> np.ndarray:
    """What OpenCV's maps and float arithmetic make of an image: float64, NaN where nothing is seen."""
    map_x, map_y = cv2.initUndistortRectifyMap(np.array(K), np.array(DIST), None, np.array(K), SIZE, cv2.CV_32FC1)
    result = cv2.remap(image.astype(np.float32), map_x, map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.where(VALID.reshape(VALID.shape + (1,) * (image.ndim - 2)), result.astype(np.float64), np.nan)


def psnr(image: np.ndarray, reference: np.ndarray) -> float:
    """Peak signal to noise ratio in dB where the reference is known."""
    return float(10 * np.log10(255**2 / np.nanmean((image.astype(np.float64) - reference) ** 2)))


def jpeg(image: np.ndarray, sampling: str = "420", quality: int = 95, progressive: bool = False) -> bytes:
    """Encode a JPEG."""
    factor = getattr(cv2, f"IMWRITE_JPEG_SAMPLING_FACTOR_{sampling}")
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, factor]
    return cv2.imencode(".jpg", image, [*options, cv2.IMWRITE_JPEG_PROGRESSIVE, int(progressive)])[1].tobytes()


def encoded(image: Pillow.Image, kind: str, **options: object) -> bytes:
    """Encode by Pillow."""
    stream = io.BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()


def tiff(image: np.ndarray, **options: object) -> bytes:
    """Encode a TIFF by tifffile; colours in the order red, green, blue."""
    stream = io.BytesIO()
    tifffile.imwrite(stream, image, **options)
    return stream.getvalue()


def undistorted(folder: Path, content: bytes, source: str, target: str | None = None, **options: object) -> tuple[Path, tuple]:
    """Undistort a file of some content; where to, and the warnings."""
    (folder / "in").mkdir(exist_ok=True)
    (folder / "out").mkdir(exist_ok=True)
    path, result = folder / "in" / source, folder / "out" / (target or source)
    path.write_bytes(content)
    return result, undistort_image_file(path, result, MAP, ImageOptions(**options))


def as_stored(path: Path) -> np.ndarray:
    """Decode with depth and channels kept."""
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


@pytest.mark.parametrize(
    ("name", "image"),
    [
        ("a.png", GREY),
        ("a.png", COLOUR),
        ("a.png", np.dstack([COLOUR, np.full_like(GREY, 200)])),
        ("a.png", DEEP[..., 0].copy()),
        ("a.png", DEEP),
        ("a.tif", COLOUR),
        ("a.tif", DEEP),
        ("a.tif", FLOATS),
        ("a.tif", FLOATS[..., 0].copy()),
        ("a.bmp", COLOUR),
        ("a.bmp", GREY),
        ("a.webp", COLOUR),
        ("a.ppm", DEEP),
        ("a.pgm", GREY),
        ("a.pfm", FLOATS),
        ("a.jp2", DEEP),
    ],
    ids=lambda value: value if isinstance(value, str) else f"{value.dtype}-{value.ndim}",
)
def test_pixels_are_exact(tmp_path: Path, name: str, image: np.ndarray) -> None:
    """Depth and channels are kept, and each value is the interpolated one, up to rounding and the maps' 1/5000 pixel."""
    lossless = {"a.webp": [cv2.IMWRITE_WEBP_QUALITY, 101], "a.jp2": [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, 1000]}
    path, warnings = undistorted(tmp_path, cv2.imencode(name[1:], image, lossless.get(name, []))[1].tobytes(), name)
    result = as_stored(path)
    assert warnings == ()
    assert (result.dtype, result.shape) == (image.dtype, image.shape)
    scale = {"uint8": 1, "uint16": 257, "float32": 1 / 7}[image.dtype.name]
    # Neighbours differ by 40 of 255 levels at most here; OpenCV's own coordinates and weights are float32.
    assert np.nanmax(np.abs(result - exact(image))) <= (0 if image.dtype == np.float32 else 0.5) + 40 * scale * 1e-3


@pytest.mark.parametrize("progressive", [False, True])
@pytest.mark.parametrize("sampling", SAMPLINGS)
def test_a_jpeg_is_as_close_as_its_coding_allows(tmp_path: Path, sampling: str, progressive: bool) -> None:
    """To the exact result, encoded with the same sampling and quality."""
    content = jpeg(COLOUR, sampling, progressive=progressive)
    source = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    path, warnings = undistorted(tmp_path, content, "a.jpg")
    best = np.nan_to_num(exact(source)).round().astype(np.uint8)
    best = cv2.imdecode(np.frombuffer(jpeg(best, sampling), np.uint8), cv2.IMREAD_COLOR)
    assert warnings == ()
    assert jpeg_header(path.read_bytes()).is_progressive == progressive
    # Pixels that are rounded the other way change blocks here and there.
    assert psnr(as_stored(path), exact(source)) == pytest.approx(psnr(best, exact(source)), abs=0.05)


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


def test_grey_jpeg_stays_grey(tmp_path: Path) -> None:
    """One plane in, one out."""
    path, _ = undistorted(tmp_path, jpeg(GREY), "a.jpg")
    source = cv2.imdecode(np.frombuffer(jpeg(GREY), np.uint8), cv2.IMREAD_UNCHANGED)
    assert as_stored(path).ndim == 2
    assert psnr(as_stored(path), exact(source)) > 45


def test_jpeg_of_red_green_and_blue(tmp_path: Path) -> None:
    """A JPEG without luminance is read as what it is; the mark that says so would turn the result's colours."""
    content = encoded(Pillow.fromarray(COLOUR[..., ::-1]), "JPEG", keep_rgb=True, quality=95)
    assert jpeg_header(content).colour == "rgb"
    path, _ = undistorted(tmp_path, content, "a.jpg")
    result = np.asarray(Pillow.open(path).convert("RGB"))[..., ::-1]
    assert psnr(result, exact(COLOUR)) > 40


def test_padding_of_a_jpeg_is_no_damage_but_said(tmp_path: Path) -> None:
    """Cameras put bytes between the pixels and the end mark; a decoder cannot tell them from what is left of lost pixels."""
    content = jpeg(COLOUR)[:-2] + bytes(20) + b"\xff\xd9"
    path, (warning,) = undistorted(tmp_path, content, "a.jpg")
    assert "perhaps damaged: look at it" in warning
    source = cv2.imdecode(np.frombuffer(jpeg(COLOUR), np.uint8), cv2.IMREAD_COLOR)
    assert psnr(as_stored(path), exact(source)) > 38


@pytest.mark.parametrize(("name", "target"), [("a.jpg", "a.jpg"), ("a.jpg", "a.png"), ("a.png", "a.png")])
def test_pixels_that_see_nothing_are_filled(tmp_path: Path, name: str, target: str) -> None:
    """With the colour asked for."""
    fill = (200.0, 30.0, 90.0)
    wide = Camera(SIZE, [[60.0, 0, 81], [0, 60, 58], [0, 0, 1]])
    source = tmp_path / f"source_{name}"
    source.write_bytes(jpeg(COLOUR, "444") if name.endswith("jpg") else cv2.imencode(".png", COLOUR)[1].tobytes())
    maps = undistort_map(Camera(SIZE, K, DIST), wide)
    undistort_image_file(source, tmp_path / target, maps, ImageOptions(fill=fill))
    corner = as_stored(tmp_path / target)[:8, :8].reshape(-1, 3)
    assert not (valid_mask(maps)[:8, :8]).any()
    # Rounding to luminance and chrominance and back costs two levels at most.
    assert np.abs(corner - fill).max() <= (2 if target.endswith("jpg") else 0)


@pytest.mark.parametrize("kind", ["PNG", "WEBP"])
def test_transparent_colours_do_not_bleed(tmp_path: Path, kind: str) -> None:
    """A red disc on transparent green stays red: colours count as much as their alpha says."""
    disc = cv2.circle(np.zeros((HEIGHT, WIDTH), np.uint8), (80, 60), 30, 255, -1)
    image = np.dstack([np.zeros_like(disc), 255 - disc, disc, disc])
    content = encoded(Pillow.fromarray(cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA)), kind, lossless=True, exact=True)
    path, _ = undistorted(tmp_path, content, f"a.{kind.lower()}")
    result = as_stored(path)
    assert result[result[..., 3] > 0][:, 1].max() == 0


@pytest.mark.parametrize("bits", [1, 2, 8, 16])
def test_one_grey_value_is_transparent(tmp_path: Path, bits: int) -> None:
    """Pixels of that value, and no others, are transparent; the others keep their grey."""
    top = (1 << bits) - 1
    grey = np.zeros((HEIGHT, WIDTH), np.uint16)
    grey[:, : WIDTH // 2] = top
    cells = [row.astype(">u2").tobytes() if bits == 16 else np.packbits(unpacked(row, bits)).tobytes() for row in grey]
    header = WIDTH.to_bytes(4) + HEIGHT.to_bytes(4) + bytes((bits, 0, 0, 0, 0))
    pixels = zlib.compress(b"".join(b"\0" + cell for cell in cells))
    parts = ((b"IHDR", header), (b"tRNS", top.to_bytes(2)), (b"IDAT", pixels), (b"IEND", b""))
    chunks = (len(body).to_bytes(4) + kind + body + zlib.crc32(kind + body).to_bytes(4) for kind, body in parts)
    path, warnings = undistorted(tmp_path, b"".join((b"\x89PNG\r\n\x1a\n", *chunks)), "a.png")
    result = as_stored(path)
    full = 65535 if bits == 16 else 255
    assert result.dtype == (np.uint16 if bits == 16 else np.uint8)
    assert any("one pixel value of it is transparent" in warning for warning in warnings)
    left, right = result[10:-10, 10 : WIDTH // 2 - 5], result[10:-10, WIDTH // 2 + 5 : -10]
    assert (left[..., 3] == 0).all()
    assert (right == (0, 0, 0, full)).all()


def unpacked(row: np.ndarray, bits: int) -> np.ndarray:
    """Bits of whole numbers, the highest first."""
    return (row[:, None] >> np.arange(bits - 1, -1, -1) & 1).astype(np.uint8)


@pytest.mark.parametrize(("extra", "alpha"), [("assocalpha", 1), ("unassalpha", 2), ("unspecified", 0)])
def test_fourth_channel_of_a_tiff_keeps_its_meaning(tmp_path: Path, extra: str, alpha: int) -> None:
    """OpenCV multiplies 8-bit colours by an unassociated alpha as it decodes; here they come out as they went in."""
    image = np.dstack([COLOUR[..., ::-1], np.full_like(GREY, 100)])
    path, warnings = undistorted(tmp_path, tiff(image, photometric="rgb", extrasamples=[extra]), "a.tif")
    with tifffile.TiffFile(path) as file:
        page = file.pages[0]
        result = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED) if alpha != 2 else None
        assert [int(sample) for sample in page.extrasamples] == [alpha]
    pixels = np.asarray(Pillow.open(path)) if result is None else cv2.cvtColor(result, cv2.COLOR_BGRA2RGBA)
    assert warnings == ()
    assert np.nanmax(np.abs(pixels - exact(image))) <= 0.5 + 40 * 1e-3


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_values_that_grow_darker_stay_so(tmp_path: Path, dtype: type) -> None:
    """A TIFF in which 0 is white keeps its values and says the same of them."""
    image = GREY.astype(dtype)
    path, _ = undistorted(tmp_path, tiff(image, photometric="miniswhite", compression="zlib"), "a.tif")
    with tifffile.TiffFile(path) as file:
        assert file.pages[0].photometric.name == "MINISWHITE"
        assert np.nanmax(np.abs(file.pages[0].asarray() - exact(image))) <= 0.5 + 40 * 1e-3


@pytest.mark.parametrize(("interpolation", "reach"), [("linear", 1), ("cubic", 12), ("lanczos", 13)])
def test_pixels_that_are_no_numbers(tmp_path: Path, interpolation: str, reach: int) -> None:
    """A NaN stays as near as the interpolation reads; where that is not just beside it, a warning says how far."""
    image = np.ones(SIZE[::-1], np.float32)
    image[60, 80] = np.nan
    path, warnings = undistorted(tmp_path, tiff(image), "a.tif", interpolation=interpolation)
    spoilt = np.argwhere(np.isnan(as_stored(path)))
    u, v = MAP.target.project(MAP.source.unproject([80, 60]))
    assert len(spoilt) >= 1
    # The target's pixels are less than 1.5 times as fine as the source's.
    assert np.abs(spoilt - [v, u]).max() <= 1.5 * (reach + 1)
    expected = f"NaN or infinite pixels spoil others up to {reach} px away: --interpolation linear only their neighbours"
    assert warnings == (() if interpolation == "linear" else (expected,))


@pytest.mark.parametrize(("asked", "written"), [(None, 1), ("zlib", 8)])
def test_compression_of_a_tiff_is_kept(tmp_path: Path, asked: str | None, written: int) -> None:
    """None stays none, deflate stays deflate."""
    path, _ = undistorted(tmp_path, tiff(GREY, compression=asked), "a.tif")
    with tifffile.TiffFile(path) as file:
        assert file.pages[0].compression == written


PALETTE = Pillow.fromarray(COLOUR[..., ::-1]).quantize(16)
RGB = Pillow.fromarray(COLOUR[..., ::-1])
GREY_ALPHA = Pillow.merge("LA", [Pillow.fromarray(GREY), Pillow.fromarray(ALPHA)])
TURNED = RGB.transpose(Pillow.Transpose.ROTATE_180)


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
        (COLOUR, "a.pgm", r"a.pgm: .*Write .png or .tiff instead"),
        (COLOUR, "a.gif", r"a.gif: not a format to write \(got '.gif', expected one of .jpg"),
        (COLOUR, "a", r"a: not a format to write"),
    ],
)
def test_formats_that_cannot_hold_the_pixels_are_refused(tmp_path: Path, image: np.ndarray, target: str, message: str) -> None:
    """16 bits or alpha to JPEG, floats to PNG: refused with the formats that can, and nothing is written."""
    with pytest.raises(InputError, match=message):
        undistorted(tmp_path, cv2.imencode(".tiff", image)[1].tobytes(), "a.tiff", target)
    assert not list((tmp_path / "out").iterdir())


WHOLE = jpeg(COLOUR)
# Cut in the middle, with the end mark put back: nothing but decoding tells.
PATCHED = WHOLE[: len(WHOLE) // 2] + b"\xff\xd9"


@pytest.mark.parametrize(
    ("name", "content", "target", "message"),
    [
        ("a.jpg", b"", "a.jpg", "a.jpg: empty file"),
        ("a.jpg", b"not a picture", "a.jpg", "a.jpg: not an image"),
        ("a.jpg", WHOLE[: len(WHOLE) // 2], "a.jpg", "a.jpg: truncated image"),
        ("a.jpg", PATCHED, "a.jpg", "a.jpg: truncated or damaged image"),
        ("a.jpg", PATCHED, "a.png", "a.jpg: truncated or damaged image"),
        ("a.png", encoded(RGB, "PNG")[:-40], "a.png", "a.png: truncated image"),
        ("a.png", encoded(RGB, "PNG")[:-40] + bytes(40), "a.png", "a.png: damaged image"),
        ("a.tif", tiff(COLOUR)[:5000], "a.tif", "a.tif: "),
        ("a.tif", b"II*\0\x08\0\0\0", "a.tif", "a.tif: cannot be changed without loss"),
        ("a.jpg", jpeg(COLOUR[:, :160]), "a.jpg", r"a.jpg: not the camera's image size \(got 160x117, expected 163x117\)"),
        ("a.png", encoded(RGB.crop((0, 0, 163, 90)), "PNG"), "a.png", r"not the camera's image size \(got 163x90"),
    ],
)
def test_bad_input_is_an_error_of_one_line(tmp_path: Path, name: str, content: bytes, target: str, message: str) -> None:
    """Empty, cut off, damaged, no image, of another size: the file is named, and nothing is written."""
    with pytest.raises(InputError, match=message) as caught:
        undistorted(tmp_path, content, name, target)
    assert "\n" not in str(caught.value)
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize("extension", [".bmp", ".ppm", ".webp", ".png", ".tif", ".jp2"])
def test_half_a_file_never_shows_the_image_before_it(tmp_path: Path, extension: str) -> None:
    """Memory that is used again still holds the last image; of a file that ends early, none of that may come out."""
    whole = cv2.imencode(extension, COLOUR)[1].tobytes()
    undistorted(tmp_path, whole, f"whole{extension}")
    with pytest.raises(InputError, match="half"):
        undistorted(tmp_path, whole[: len(whole) // 2], f"half{extension}")


def test_bombs_are_refused_before_they_are_decoded(tmp_path: Path) -> None:
    """A header that asks for 3600 million pixels; and the limit is settable."""
    content = bytearray(encoded(RGB, "BMP"))
    content[18:26] = (60_000).to_bytes(4, "little") * 2
    with pytest.raises(InputError, match=r"a.bmp: too many pixels \(got 60000x60000, expected at most 400 million\)"):
        undistorted(tmp_path, bytes(content), "a.bmp")
    with pytest.raises(InputError, match=r"a.jpg: too many pixels"):
        undistorted(tmp_path, jpeg(COLOUR), "a.jpg", most_pixels=WIDTH * HEIGHT - 1)
    undistorted(tmp_path, jpeg(COLOUR), "a.jpg", most_pixels=WIDTH * HEIGHT)


def test_an_image_is_never_replaced_by_its_result(tmp_path: Path) -> None:
    """Under its own name or another one."""
    source = tmp_path / "a.jpg"
    source.write_bytes(jpeg(COLOUR))
    (tmp_path / "link.jpg").symlink_to(source)
    (tmp_path / "hard.jpg").hardlink_to(source)
    for target in (source, tmp_path / "link.jpg", tmp_path / "hard.jpg"):
        with pytest.raises(InputError, match="would replace its own input"):
            undistort_image_file(source, target, MAP)
    assert source.read_bytes() == jpeg(COLOUR)


def test_missing_and_unreadable_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file that cannot be read or written is named."""
    with pytest.raises(InputError, match=r"missing.jpg: no such file"):
        undistort_image_file(tmp_path / "missing.jpg", tmp_path / "a.jpg", MAP)
    (tmp_path / "b.jpg").write_bytes(jpeg(COLOUR))
    with pytest.raises(InputError, match=r"nowhere.a.jpg: cannot be written \(no such file or directory\)"):
        undistort_image_file(tmp_path / "b.jpg", tmp_path / "nowhere/a.jpg", MAP)

    def refused(self: Path) -> bytes:
        raise PermissionError(errno.EACCES, "Permission denied", str(self))

    monkeypatch.setattr(Path, "read_bytes", refused)
    with pytest.raises(InputError, match=r"b.jpg: cannot be read \(permission denied\)"):
        undistort_image_file(tmp_path / "b.jpg", tmp_path / "a.jpg", MAP)


def test_a_full_disk_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither half a file nor a temporary one; an earlier result stays."""
    path, _ = undistorted(tmp_path, jpeg(COLOUR), "a.jpg")
    before = path.read_bytes()
    write = Path.write_bytes

    def full(self: Path, data: bytes) -> int:
        if self.parent.name == "out":
            write(self, data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device", str(self))
        return write(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"a.jpg: cannot be written \(no space left on device\)"):
        undistorted(tmp_path, jpeg(GREY), "a.jpg")
    assert [entry.name for entry in path.parent.iterdir()] == ["a.jpg"]
    assert path.read_bytes() == before


def test_the_same_bytes_on_any_thread_in_any_order(tmp_path: Path) -> None:
    """Memory that is used again, on two threads and for images of many kinds, changes nothing."""
    contents = {
        "grey.jpg": jpeg(GREY),
        "fine.jpg": jpeg(COLOUR, "444"),
        "a.jpg": WHOLE,
        "a.png": encoded(RGB, "PNG"),
        "deep.png": cv2.imencode(".png", DEEP)[1].tobytes(),
        "alpha.png": cv2.imencode(".png", np.dstack([COLOUR, ALPHA]))[1].tobytes(),
        "grey.png": cv2.imencode(".png", GREY)[1].tobytes(),
        "a.bmp": encoded(RGB, "BMP"),
        "floats.tif": cv2.imencode(".tif", FLOATS)[1].tobytes(),
    }
    single = {name: undistorted(tmp_path, content, name)[0].read_bytes() for name, content in contents.items()}
    (tmp_path / "both").mkdir()

    def again(index: int) -> bool:
        name = list(contents)[index % len(contents)]
        target = tmp_path / "both" / f"{index}_{name}"
        undistort_image_file(tmp_path / "in" / name, target, MAP)
        return target.read_bytes() == single[name]

    with ThreadPoolExecutor(2) as pool:
        assert all(pool.map(again, RNG.permutation(5 * len(contents)).tolist()))


@pytest.mark.parametrize("name", ["ä b.png", "名.jpg"])
def test_any_file_name_will_do(tmp_path: Path, name: str) -> None:
    """Names that OpenCV cannot open everywhere are read all the same."""
    content = jpeg(COLOUR) if name.endswith("jpg") else encoded(RGB, "PNG")
    path, warnings = undistorted(tmp_path, content, name)
    assert warnings == ()
    assert path.exists()


def test_light_is_averaged_if_asked_for(tmp_path: Path) -> None:
    """Between black and white pixels lies half the light, sRGB 188, in a JPEG too."""
    stripes = np.zeros((HEIGHT, WIDTH), np.uint8)
    stripes[:, ::2] = 255
    moved = Camera(SIZE, [[150.0, 0, 83.5], [0, 151, 57], [0, 0, 1]])
    maps = undistort_map(Camera(SIZE, K), moved)
    source = tmp_path / "a.jpg"
    source.write_bytes(jpeg(np.dstack([stripes] * 3), "444", 100))
    for gamma, level in ((None, 128), ("srgb", 188)):
        undistort_image_file(source, tmp_path / "b.jpg", maps, ImageOptions(gamma=gamma))
        assert np.abs(as_stored(tmp_path / "b.jpg")[20:-20, 20:-20].astype(int) - level).max() <= 3


@pytest.mark.parametrize("options", [{"quality": 0}, {"quality": 101}, {"most_pixels": 0}])
def test_options_out_of_range_are_refused(options: dict[str, int]) -> None:
    """The message names the option."""
    with pytest.raises(InputError, match=r"--(quality|most-pixels): "):
        ImageOptions(**options)


def test_nothing_heavy_is_imported_before_it_is_needed() -> None:
    """A PNG needs neither FFmpeg nor Pillow nor pydantic."""
    heavy = {"av", "simplejpeg", "PIL", "pydantic", "tifffile"}
    code = f"import sys, camcal.workflows.undistort.image; print(*{heavy!r} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
