"""PNG files: their chunks, what the header says, and metadata copied from file to file byte for byte.

Source of the layout: Portable Network Graphics specification, third edition.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from camcal.formats.imaging.blocks import Metadata
from camcal.formats.imaging.kinds import PNG_SIGNATURE

if TYPE_CHECKING:
    from camcal.observations import Image

_LONGEST_PROFILE = 64_000_000
_LONGEST_TEXT = 8_000_000
# Chunks without which no pixel can be decoded, and those that only hold for the pixels as they were coded.
_CODING = frozenset({b"IHDR", b"PLTE", b"IDAT", b"IEND", b"tRNS"})
# Chunks that tell how pixel values are to be read: they stay true, though an editor that does not know them must drop them.
_COLOURS = frozenset({b"gAMA", b"cHRM", b"sRGB", b"iCCP", b"cICP", b"mDCV", b"mDCv", b"cLLI", b"cLLi", b"tIME"})
# These have one entry per channel as it is coded.
_PER_CHANNEL = frozenset({b"sBIT", b"bKGD"})
_XMP_KEYWORD = b"XML:com.adobe.xmp"
_PER_METRE = b"\1"
_LARGEST = 2**31 - 1
_HEAD = struct.Struct(">I4s")
_GREY, _COLOUR, _PALETTE, _GREY_ALPHA = 0, 2, 3, 4


@dataclass(frozen=True, slots=True)
class Chunk:
    """A chunk beside the pixels: its type, and all of it as it stands in a file (length, type, content, checksum)."""

    kind: bytes
    raw: bytes

    @property
    def body(self) -> bytes:
        """Its content."""
        return self.raw[8:-4]


@dataclass(frozen=True, slots=True)
class PngHeader:
    """How the pixels of a PNG are coded.

    Attributes
    ----------
    size : tuple of int
        (width, height) in pixels.
    bits : int
        Bits per channel, or per index into the palette.
    colour : int
        Colour type: 0 grey, 2 colours, 3 palette, 4 grey with alpha, 6 colours with alpha.
    """

    size: tuple[int, int]
    bits: int
    colour: int


def png_header(content: bytes) -> PngHeader:
    """Read how the pixels are coded.

    Raises
    ------
    ValueError
        If the first chunk is not the header.
    """
    if len(content) < 33 or content[12:16] != b"IHDR":
        raise ValueError("no header")
    size = int.from_bytes(content[16:20]), int.from_bytes(content[20:24])
    return PngHeader(size, content[24], content[25])


def size(content: bytes) -> tuple[int, int]:
    """Read (width, height) in pixels."""
    return png_header(content).size


def defect(content: bytes) -> str | None:
    """Follow the chunks and their checksums to the end."""
    view = memoryview(content)
    for kind, start, end in _places(content):
        if zlib.crc32(view[start + 4 : end - 4]) != int.from_bytes(view[end - 4 : end]):
            return f"damaged image (the checksum of its chunk at byte {start} does not match)"
        if kind == b"IEND":
            return None
    return f"truncated image (it ends after {len(content)} bytes)"


def obstacle(content: bytes) -> str | None:
    """Say why the pixels of a PNG cannot be changed without losing some of it."""
    if any(kind == b"acTL" for kind, *_ in _places(content)):
        return "animated image, of which only the first frame would be left"
    return None


def expansions(content: bytes) -> list[str]:
    """Say what becomes of pixels when they are decoded to 8 or 16 bits in one, three or four channels."""
    header = png_header(content)
    if header.colour == _PALETTE:
        return ["palette image: written with full colours, because colours in between are not in the palette"]
    found = []
    if header.colour == _GREY_ALPHA:
        found.append("grey with alpha: written as colour with alpha, the same value in each colour")
    if header.bits < 8:
        found.append(f"{header.bits}-bit image: written with 8 bits")
    if header.colour in {_GREY, _COLOUR} and any(kind == b"tRNS" for kind, *_ in _places(content)):
        grey = "colour with " if header.colour == _GREY else ""
        found.append(f"one pixel value of it is transparent: written as {grey}an alpha channel")
    return found


def with_transparent_grey(content: bytes, image: Image) -> Image:
    """Give the decoded pixels of a PNG an alpha channel if one of its grey values is transparent, as OpenCV does with colours.

    Parameters
    ----------
    content : bytes
    image : ndarray of shape (height, width)
        uint8 or uint16; or anything else, which is returned as it is.

    Returns
    -------
    ndarray of shape (height, width, 4)
        BGRA: the same value in each colour.
    """
    header = png_header(content)
    if header.colour != _GREY or image.ndim != 2:
        return image
    value = next((int.from_bytes(content[end - 6 : end - 4]) for kind, _, end in _places(content) if kind == b"tRNS"), None)
    if value is None:
        return image
    full = np.iinfo(image.dtype).max
    if header.bits < 8:
        value = value * full // ((1 << header.bits) - 1)
    return np.dstack([image, image, image, np.where(image == value, 0, full).astype(image.dtype)])


def with_metadata_of(source: bytes, encoded: bytes, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded PNG every chunk beside the pixels that another has, byte for byte, and a comment.

    What is not copied: palettes, transparent values, and chunks of unknown meaning that their makers mark as unsafe to
    copy when pixels change.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What was not copied.
    """
    same_channels = png_header(source).colour == png_header(encoded).colour
    kept: list[Chunk] = []
    left_behind = []
    for chunk in _beside(source):
        safe = chunk.kind[3:4].islower() or chunk.kind in _COLOURS
        if safe or (chunk.kind in _PER_CHANNEL and same_channels):
            kept.append(chunk)
        elif chunk.kind not in _PER_CHANNEL | {b"hIST", b"iDOT"}:
            left_behind.append(f"chunk {chunk.kind.decode('latin-1')}")
    return _put_in(encoded, [*kept, *_comments(note)]), [*left_behind, *_behind(source)]


def metadata(content: bytes) -> Metadata:
    """Collect what other formats can hold too."""
    found: dict[bytes, bytes] = {}
    texts = []
    others = set()
    for chunk in _beside(content):
        if chunk.kind == b"iTXt" and chunk.body.startswith(_XMP_KEYWORD + b"\0"):
            found.setdefault(b"XMP", _international_text(chunk.body))
        elif chunk.kind in {b"tEXt", b"zTXt", b"iTXt"}:
            keyword, text = _text(chunk)
            texts.append(text if keyword == "Comment" else f"{keyword}: {text}")
        elif chunk.kind in {b"eXIf", b"iCCP", b"pHYs"}:
            found.setdefault(chunk.kind, chunk.body)
        elif chunk.kind not in _PER_CHANNEL | {b"tIME", b"hIST", b"sRGB"}:
            others.add(chunk.kind.decode("latin-1"))
    profile, scale = found.get(b"iCCP"), found.get(b"pHYs", b"")
    return Metadata(
        exif=found.get(b"eXIf"),
        xmp=found.get(b"XMP"),
        icc=_inflated(profile.partition(b"\0")[2][1:], _LONGEST_PROFILE) or None if profile else None,
        comments=tuple(texts),
        dots_per_metre=(int.from_bytes(scale[:4]), int.from_bytes(scale[4:8])) if scale[8:] == _PER_METRE else None,
        others=(*(f"chunk {name}" for name in sorted(others)), *_behind(content)),
    )


def with_metadata(encoded: bytes, described: Metadata, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded PNG the metadata of a file of another format, and a comment.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What does not fit into a PNG: nothing.
    """
    chunks = []
    if described.icc:
        chunks.append(_chunk(b"iCCP", b"ICC profile\0\0" + zlib.compress(described.icc)))
    if described.dots_per_metre:
        x, y = (min(round(dots), _LARGEST) for dots in described.dots_per_metre)
        chunks.append(_chunk(b"pHYs", x.to_bytes(4) + y.to_bytes(4) + _PER_METRE))
    if described.exif:
        chunks.append(_chunk(b"eXIf", described.exif))
    if described.xmp:
        chunks.append(_chunk(b"iTXt", _XMP_KEYWORD + b"\0\0\0\0\0" + described.xmp))
    return _put_in(encoded, [*chunks, *_comments(*described.comments, note)]), []


def _comments(*texts: str) -> list[Chunk]:
    """Comment chunks."""
    return [_chunk(b"iTXt", b"Comment\0\0\0\0\0" + text.encode()) for text in texts]


def _chunk(kind: bytes, body: bytes) -> Chunk:
    """Make a chunk."""
    checksum = zlib.crc32(body, zlib.crc32(kind))
    return Chunk(kind, len(body).to_bytes(4) + kind + body + checksum.to_bytes(4))


def _places(content: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Type, start and end of each chunk up to the last, or to where the file is cut off."""
    position, last = len(PNG_SIGNATURE), len(content) - 12
    while position <= last:
        length, kind = _HEAD.unpack_from(content, position)
        end = position + 12 + length
        if end > len(content):
            return
        yield kind, position, end
        if kind == b"IEND":
            return
        position = end


def _beside(content: bytes) -> list[Chunk]:
    """Chunks that are not needed to decode pixels."""
    return [Chunk(kind, content[start:end]) for kind, start, end in _places(content) if kind not in _CODING]


def _behind(content: bytes) -> list[str]:
    """Name what stands behind the last chunk, if it is more than padding."""
    end = max((end for _, _, end in _places(content)), default=len(content))
    return ["what follows the picture in its file"] if content[end:].strip(b"\0") else []


def _put_in(encoded: bytes, chunks: Sequence[Chunk]) -> bytes:
    """Put chunks behind the header of an encoded PNG, where each kind may stand, in place of those of its encoder."""
    view = memoryview(encoded)
    (_, _, body), *others = _places(encoded)
    coding: list[memoryview] = []
    kept = body
    for kind, start, end in others:
        if kind not in _CODING:
            coding.append(view[kept:start])
            kept = end
    return b"".join([view[:body], *(chunk.raw for chunk in chunks), *coding, view[kept:]])


def _text(chunk: Chunk) -> tuple[str, str]:
    """Keyword and text of a chunk of text."""
    keyword, _, rest = chunk.body.partition(b"\0")
    if chunk.kind == b"iTXt":
        return keyword.decode("latin-1"), _international_text(chunk.body).decode("utf-8", "replace")
    plain = rest if chunk.kind == b"tEXt" else _inflated(rest[1:], _LONGEST_TEXT)
    return keyword.decode("latin-1"), plain.decode("latin-1")


def _international_text(body: bytes) -> bytes:
    """UTF-8 text of a chunk of international text: behind keyword, two flags, language and translated keyword."""
    _, _, rest = body.partition(b"\0")
    _, _, named = rest[2:].partition(b"\0")
    _, _, text = named.partition(b"\0")
    return _inflated(text, _LONGEST_TEXT) if rest[:1] == b"\1" else text


def _inflated(packed: bytes, most_bytes: int) -> bytes:
    """Decompress, but not more than expected; nothing if it is damaged."""
    try:
        return zlib.decompressobj().decompress(packed, most_bytes)
    except zlib.error:
        return b""
