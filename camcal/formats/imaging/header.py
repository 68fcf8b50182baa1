"""What the bytes of an image file tell before it is decoded: its format, its size, and whether it is whole."""

from __future__ import annotations

import re
import struct

from camcal.errors import InputError
from camcal.formats.imaging.kinds import SURPRISES, image_format, kind_of

__all__ = ["MOST_PIXELS", "image_defect", "image_format", "image_size", "refuse_bomb"]

MOST_PIXELS = 400_000_000
"""Pixels of an image beyond which it is taken for a trap, unless the user allows more."""

# Text headers stand at the front; the boxes of AVIF may come after some metadata.
_TEXT_BYTES = 4096
_BOX_BYTES = 1 << 20


def image_defect(content: bytes) -> str | None:
    """Say what is wrong with a file as a whole, if anything can be told without decoding it.

    A decoder would find out too, but libpng prints it to the terminal, and nobody decodes every image twice.
    """
    kind = kind_of(content)
    return kind.defect(content) if kind else None


def image_size(content: bytes) -> tuple[int, int] | None:
    """Read (width, height) in pixels from a file's header; None where it is not to be found."""
    try:
        size = _size(content)
    except SURPRISES:
        return None
    return size if size and min(size) > 0 else None


def refuse_bomb(path: object, content: bytes, most_pixels: int) -> None:
    """Refuse an image that would take more memory than its file suggests, before it takes it.

    Raises
    ------
    InputError
        If the header states more pixels than allowed.
    """
    size = image_size(content)
    if size and size[0] * size[1] > most_pixels:
        most = f"{most_pixels / 1e6:g} million" if most_pixels >= 1e6 else str(most_pixels)
        raise InputError(
            f"{path}: too many pixels (got {size[0]}x{size[1]}, expected at most {most}). "
            "If the image is what it should be, raise the limit (--most-pixels of undistort, most_pixels in Python)."
        )


def _size(content: bytes) -> tuple[int, int] | None:
    """Read the size from a header; one of `SURPRISES` if it is cut off or odd."""
    kind, name = kind_of(content), image_format(content)
    if kind:
        return kind.size(content)
    place = {"gif": ("<HH", 6), "sun": (">II", 4)}.get(name or "")
    if place:
        return _pair(content, *place)
    if name == "avif":
        return _size_in_boxes(content[:_BOX_BYTES])
    return _size_in_text(name, content[:_TEXT_BYTES])


def _size_in_text(kind: str | None, start: bytes) -> tuple[int, int] | None:
    """Find the size in a header made of text."""
    if kind in {"netpbm", "pfm"}:
        plain = re.sub(rb"#[^\n]*", b"", start)
        found = re.match(rb"P.\s+(\d+)\s+(\d+)\s", plain)
        return (int(found[1]), int(found[2])) if found else None
    if kind == "pam":
        width, height = (re.search(rb"\n" + name + rb"\s+(\d+)", start) for name in (b"WIDTH", b"HEIGHT"))
        return (int(width[1]), int(height[1])) if width and height else None
    if kind == "hdr":
        found = re.search(rb"\n[-+]Y (\d+) [-+]X (\d+)\n", start)
        return (int(found[2]), int(found[1])) if found else None
    return None


def _size_in_boxes(start: bytes) -> tuple[int, int] | None:
    """Find the largest size that the boxes of an AVIF file state (ISO/IEC 23008-12, 6.5.3)."""
    sizes = [_pair(start, ">II", found.end() + 4) for found in re.finditer(rb"ispe", start)]
    return max(sizes, key=lambda size: size[0] * size[1]) if sizes else None


def _pair(content: bytes, layout: str, offset: int) -> tuple[int, int]:
    """Read two whole numbers."""
    first, second = struct.unpack_from(layout, content, offset)
    return first, second
