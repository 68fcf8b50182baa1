"""Pixels of one image file undistorted: exact in every depth, in JPEG as close as its coding allows, alpha and all."""

from __future__ import annotations

import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from image_files import (
    COLOUR,
    DEEP,
    DIST,
    FLOATS,
    GREY,
    HEIGHT,
    MAP,
    SAMPLINGS,
    SIZE,
    WIDTH,
    K,
    as_stored,
    encoded,
    exact,
    jpeg,
    psnr,
    tiff,
    undistorted,
)
from PIL import Image as Pillow

from camcal.formats.imaging.jpeg_header import jpeg_header
from camcal.geometry.camera import Camera
from camcal.undistortion.maps import undistort_map, valid_mask
from camcal.workflows.undistort.image import ImageOptions, undistort_image_file


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
