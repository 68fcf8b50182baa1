"""What the bytes of an image file tell before it is decoded."""

from __future__ import annotations

import zlib
from typing import Literal

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_JPEG_SIGNATURE = b"\xff\xd8\xff"
_TIFF_SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_TIFF_ORIENTATION = 274
_NETPBM_SIGNATURES = (b"P1", b"P2", b"P3", b"P4", b"P5", b"P6", b"P7", b"PF", b"Pf")
_OTHER_SIGNATURES = (b"BM", b"GIF8", b"#?", b"\x59\xa6\x6a\x95", b"\xff\x4f\xff\x51")
_SIGNATURES = (_PNG_SIGNATURE, _JPEG_SIGNATURE, *_TIFF_SIGNATURES, *_NETPBM_SIGNATURES, *_OTHER_SIGNATURES)


def has_image_signature(content: bytes) -> bool:
    """Tell whether the first bytes are those of a format that OpenCV reads."""
    return content.startswith(_SIGNATURES) or content[4:8] in {b"ftyp", b"jP  "} or content[8:12] == b"WEBP"


def image_defect(content: bytes) -> str | None:
    """Say what is wrong with a PNG or JPEG as a whole, if anything can be told without decoding it.

    A decoder would find out too, but libpng prints it to the terminal, and nobody decodes every image twice.
    """
    if content.startswith(_PNG_SIGNATURE):
        return _png_defect(content)
    return _jpeg_defect(content) if content.startswith(_JPEG_SIGNATURE) else None


def _png_defect(content: bytes) -> str | None:
    """Follow the chunks and their checksums to the end (PNG specification, third edition, section 5.3)."""
    position = len(_PNG_SIGNATURE)
    while position + 12 <= len(content):
        end = position + 12 + int.from_bytes(content[position : position + 4])
        if end > len(content):
            break
        if zlib.crc32(memoryview(content)[position + 4 : end - 4]) != int.from_bytes(content[end - 4 : end]):
            return f"damaged image (the checksum of its chunk at byte {position} does not match)"
        if content[position + 4 : position + 8] == b"IEND":
            return None
        position = end
    return f"truncated image (it ends after {len(content)} bytes)"


def _jpeg_defect(content: bytes) -> str | None:
    """Follow the segments to the first scan and look for the end mark behind it (ITU-T T.81, annex B).

    The end mark of a thumbnail stands before the scan; phones append all sorts of things behind the end mark.
    """
    position = 2
    while position + 4 <= len(content) and content[position] == 0xFF:
        marker = content[position + 1]
        if marker == 0xDA:
            return None if content.find(b"\xff\xd9", position) >= 0 else f"truncated image (it ends after {len(content)} bytes)"
        # Fill bytes and marks without a segment.
        lone = marker in {0x01, 0xFF} or 0xD0 <= marker <= 0xD8
        position += (1 if marker == 0xFF else 2) if lone else 2 + int.from_bytes(content[position + 2 : position + 4])
    return f"truncated image (it ends after {len(content)} bytes)"


def without_tiff_orientation(content: bytes) -> bytes:
    """Return a TIFF with its orientation tag set to 1, as stored; anything else as it is.

    OpenCV turns the pixels of a TIFF as the tag says, even when it is told to ignore orientations. Source of the layout: TIFF
    6.0, section 2; BigTIFF has wider fields.
    """
    if not content.startswith(_TIFF_SIGNATURES):
        return content
    order: Literal["little", "big"] = "little" if content.startswith(b"II") else "big"
    big = content[2:4] in {b"+\0", b"\0+"}
    pointer, word, count_bytes, entry_bytes, value = (8, 8, 8, 20, 12) if big else (4, 4, 2, 12, 8)
    directory = int.from_bytes(content[pointer : pointer + word], order)
    count = int.from_bytes(content[directory : directory + count_bytes], order)
    first = directory + count_bytes
    for entry in range(first, min(first + count * entry_bytes, len(content) - entry_bytes + 1), entry_bytes):
        if int.from_bytes(content[entry : entry + 2], order) == _TIFF_ORIENTATION:
            place = entry + value
            return content[:place] + (1).to_bytes(2, order) + content[place + 2 :]
    return content
