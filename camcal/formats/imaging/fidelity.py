"""What of an image would be lost, and what changed, when its pixels are decoded, resampled and encoded again."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2

from camcal.errors import InputError
from camcal.formats.imaging.kinds import damage_refused, image_format, kind_of
from camcal.formats.imaging.opencv_log import quiet
from camcal.formats.imaging.pixels import JPEG_EXTENSIONS, Coding

GOOD_QUALITY = 95
"""Quality of lossy formats where neither the user nor the source asks for more."""

_EXTENSION_FORMATS = {
    **dict.fromkeys((".jpg", ".jpeg", ".jpe"), "jpeg"),
    **dict.fromkeys((".tif", ".tiff"), "tiff"),
    ".png": "png",
    ".webp": "webp",
    ".bmp": "bmp",
    ".gif": "gif",
}
_FULL_SCALES = (255, 65535)


def refuse_loss(path: Path, content: bytes) -> None:
    """Refuse an image that holds more than one picture, or colours that would turn into other ones.

    Raises
    ------
    InputError
        If so, with a way out; or if what tells is damaged.
    """
    with damage_refused(path):
        obstacle = _obstacle(path, content)
    if obstacle:
        raise InputError(
            f"{path}: cannot be changed without loss ({obstacle}). "
            "Save it as a single grey, RGB or RGBA image of 8 or 16 unsigned bits or of 32-bit floats first."
        )


def expansions(path: Path, content: bytes) -> list[str]:
    """Say what became of pixels when they were decoded, where they are not stored as they are now.

    Parameters
    ----------
    path : Path
    content : bytes
        Of the file.

    Returns
    -------
    list of str
        One clause each.

    Raises
    ------
    InputError
        If what tells is damaged.
    """
    kind = image_format(content)
    found = []
    named = _EXTENSION_FORMATS.get(path.suffix.lower(), kind)
    if named != kind:
        found.append(f"in truth a {kind} file, not {named} as its name says")
    module = kind_of(content)
    if module:
        with damage_refused(path):
            found += module.expansions(content)
    elif kind == "gif":
        found.append("palette image: written with full colours, because colours in between are not in the palette")
    elif kind == "netpbm":
        found += _map_expansions(content)
    return found


def has_alpha(content: bytes) -> bool:
    """Whether a fourth channel of an image is an alpha by which colours are to be weighed."""
    if image_format(content) != "tiff":
        return True
    from camcal.formats.imaging import tiff

    return tiff.has_alpha(content)


def coding_like(content: bytes, target: Path, quality: int | None) -> Coding:
    """Choose how to encode an image: as its source was where that is known, and without loss where nothing was lost yet.

    Parameters
    ----------
    content : bytes
        Of the source.
    target : Path
    quality : int or None
        What the user asks for; if nothing, `GOOD_QUALITY`, or that of the source if it is higher.
    """
    like: dict[str | None, Callable[[bytes], Coding]] = {"jpeg": _like_jpeg, "tiff": _like_tiff, "webp": _like_webp}
    source = like.get(image_format(content))
    coding = source(content) if source else Coding()
    if target.suffix.lower() in JPEG_EXTENSIONS:
        coding = replace(coding, quality=coding.quality or GOOD_QUALITY)
    return replace(coding, quality=quality or coding.quality)


def _like_jpeg(content: bytes) -> Coding:
    from camcal.formats.imaging.jpeg_header import jpeg_header

    header = jpeg_header(content)
    return Coding(max(GOOD_QUALITY, header.quality), header.subsampling, header.is_progressive) if header else Coding()


def _like_tiff(content: bytes) -> Coding:
    from camcal.formats.imaging.tiff import lossless_compression

    return Coding(subsampling=(1, 1), tiff_compression=lossless_compression(content))


def _like_webp(content: bytes) -> Coding:
    from camcal.formats.imaging.webp import webp_is_lossy

    return Coding(quality=GOOD_QUALITY if webp_is_lossy(content) else None)


def _obstacle(path: Path, content: bytes) -> str | None:
    """Say why an image cannot be changed without losing some of it."""
    if image_format(content) in {"gif", "avif"}:
        with quiet():
            count = cv2.imcount(str(path))
        return f"animated image of {count} frames" if count > 1 else None
    module = kind_of(content)
    return module.obstacle(content) if module else None


def _map_expansions(content: bytes) -> list[str]:
    """Say what becomes of the pixels of a PBM, PGM or PPM."""
    if content[1:2] in b"14":
        return ["1-bit image: written with 8 bits"]
    plain = re.sub(rb"#[^\n]*", b"", content[:4096])
    found = re.match(rb"P.\s+\d+\s+\d+\s+(\d+)\s", plain)
    full = int(found[1]) if found else 255
    return [] if full in _FULL_SCALES else [f"values of a range up to {full}: unchanged, but written in a wider range"]
