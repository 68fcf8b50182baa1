"""JPEG 2000 files: their boxes, and metadata copied from file to file byte for byte.

Source of the layout: ITU-T T.800 (ISO/IEC 15444-1), annex I; XMP part 3; exiftool's notes for EXIF.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass

from camcal.formats.imaging.blocks import Metadata, as_they_are, nothing_to_say
from camcal.formats.imaging.xmp import xmp_of

_CODE_STREAM = b"\xff\x4f\xff\x51"
_HEAD_BYTES = 1 << 20
_XMP = bytes.fromhex("be7acfcb97a942e89c71999491e3afac")
_EXIF = b"JpgTiffExif->JP2"
_ICC = b"\2\0\0"
_ICC_METHODS = (b"\2", b"\3")
# What the pixels are decoded by; those of the new file hold.
_CODING = frozenset({b"jP  ", b"ftyp", b"jp2h", b"jp2c"})


@dataclass(frozen=True, slots=True)
class Box:
    """A box: its type and content."""

    kind: bytes
    body: bytes

    def to_bytes(self) -> bytes:
        """Write it as it stands in a file."""
        return (8 + len(self.body)).to_bytes(4) + self.kind + self.body


def size(content: bytes) -> tuple[int, int] | None:
    """Read (width, height) in pixels."""
    if content.startswith(_CODE_STREAM):
        right, bottom, left, top = struct.unpack_from(">IIII", content, 8)
        return right - left, bottom - top
    found = re.search(rb"ihdr", content[:_HEAD_BYTES])
    if found is None:
        return None
    height, width = struct.unpack_from(">II", content, found.end())
    return width, height


defect = nothing_to_say
obstacle = nothing_to_say
expansions = as_they_are


def with_metadata_of(source: bytes, encoded: bytes, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded JPEG 2000 every box beside the pixels that another has, its resolution and profile, and a note.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What was not copied.
    """
    header = [box for box in _header(source) if box.kind == b"res " or _is_profile(box)]
    left_behind = []
    if _channels(source) != _channels(encoded) and any(map(_is_profile, header)):
        header = [box for box in header if not _is_profile(box)]
        left_behind.append("colour profile")
    return _with_note(encoded, header, [box for box in _split(source) if box.kind not in _CODING], left_behind, note)


def metadata(content: bytes) -> Metadata:
    """Collect what other formats can hold too."""
    header, beside = list(_header(content)), [box for box in _split(content) if box.kind not in _CODING]
    exif, xmp = _of_identity(beside, _EXIF), _of_identity(beside, _XMP)
    others = sorted({f"box {box.kind.decode('latin-1').strip()}" for box in beside if not _is_known(box)})
    if any(box.kind == b"res " for box in header):
        others.append("resolution")
    return Metadata(
        exif=exif.removeprefix(b"Exif\0\0") or None,
        xmp=xmp or None,
        icc=next((box.body[len(_ICC) :] for box in header if _is_profile(box)), None),
        others=tuple(others),
    )


def with_metadata(encoded: bytes, described: Metadata, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded JPEG 2000 the metadata of a file of another format, and a note.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What does not fit into a JPEG 2000, as its first part defines it: comments, resolution, profiles with tables.
    """
    lost = {"comments": described.comments, "resolution": described.dots_per_metre and not described.exif}
    left_behind = [name for name, block in lost.items() if block]
    header, beside = [], []
    if described.icc and b"A2B0" not in described.icc:
        header.append(Box(b"colr", _ICC + described.icc))
    elif described.icc:
        left_behind.append("colour profile")
    for identity, block in ((_EXIF, described.exif), (_XMP, described.xmp)):
        if block:
            beside.append(Box(b"uuid", identity + block))
    return _with_note(encoded, header, beside, left_behind, note)


def _with_note(
    encoded: bytes, header: list[Box], beside: list[Box], left_behind: list[str], note: str
) -> tuple[bytes, list[str]]:
    """Add boxes to the header and behind it, and a note as XMP, unless there is some already, which stays as it is."""
    if _of_identity(beside, _XMP):
        left_behind = [*left_behind, "a note of the correction (the file has its own XMP)"]
    else:
        beside = [*beside, Box(b"uuid", _XMP + xmp_of(note))]
    own = [box for box in _header(encoded) if box.kind != b"colr" or not any(map(_is_profile, header))]
    # The box that tells how pixels are stored comes first.
    whole = Box(b"jp2h", b"".join(box.to_bytes() for box in (*own, *header)))
    parts = []
    for box in _split(encoded):
        parts += [whole, *beside] if box.kind == b"jp2h" else [box]
    return b"".join(box.to_bytes() for box in parts), left_behind


def _split(content: bytes) -> Iterator[Box]:
    """Boxes one after the other, up to where the file is cut off; none if it is a bare stream of codes."""
    position = len(content) if content.startswith(_CODE_STREAM) else 0
    while position + 8 <= len(content):
        length, head = int.from_bytes(content[position : position + 4]), 8
        if length == 1:
            length, head = int.from_bytes(content[position + 8 : position + 16]), 16
        end = position + length if length else len(content)
        if end < position + head:
            return
        yield Box(content[position + 4 : position + 8], content[position + head : end])
        position = end


def _header(content: bytes) -> Iterator[Box]:
    """Boxes that tell how the pixels are stored."""
    return _split(next((box.body for box in _split(content) if box.kind == b"jp2h"), b""))


def _channels(content: bytes) -> bytes:
    """Number of channels, as it is stored; nothing if it is not known."""
    return next((box.body[8:10] for box in _header(content) if box.kind == b"ihdr"), b"")


def _is_profile(box: Box) -> bool:
    """Whether a box is a colour profile, not the number of a colour space."""
    return box.kind == b"colr" and box.body[:1] in _ICC_METHODS


def _is_known(box: Box) -> bool:
    """Whether a box holds what other formats have a place for."""
    return box.kind == b"uuid" and box.body.startswith((_XMP, _EXIF))


def _of_identity(boxes: list[Box], identity: bytes) -> bytes:
    """Content of the first box of an identity; nothing if there is none."""
    found = (box.body[len(identity) :] for box in boxes if box.kind == b"uuid" and box.body.startswith(identity))
    return next(found, b"")
