"""WebP files: their chunks, and metadata copied from file to file byte for byte.

Source of the layout: RFC 9649.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from camcal.formats.imaging.blocks import Metadata, as_they_are, nothing_to_say
from camcal.formats.imaging.tiff_tags import exif_of
from camcal.formats.imaging.xmp import xmp_of

_CODING = frozenset({b"VP8X", b"VP8 ", b"VP8L", b"ALPH", b"ANIM", b"ANMF"})
_PROFILE_FLAG, _ALPHA_FLAG, _EXIF_FLAG, _XMP_FLAG, _ANIMATION_FLAG = 0x20, 0x10, 0x08, 0x04, 0x02
_FLAGS = {b"ICCP": _PROFILE_FLAG, b"EXIF": _EXIF_FLAG, b"XMP ": _XMP_FLAG}
_EXIF_PREFIX = b"Exif\0\0"


@dataclass(frozen=True, slots=True)
class Chunk:
    """A chunk: its type and content."""

    kind: bytes
    body: bytes

    def to_bytes(self) -> bytes:
        """Write it as it stands in a file, padded to whole pairs of bytes."""
        return self.kind + len(self.body).to_bytes(4, "little") + self.body + b"\0" * (len(self.body) % 2)


def size(content: bytes) -> tuple[int, int] | None:
    """Read (width, height) in pixels; None if there is no picture."""
    for chunk in _split(content):
        body = chunk.body
        if chunk.kind == b"VP8X":
            return 1 + int.from_bytes(body[4:7], "little"), 1 + int.from_bytes(body[7:10], "little")
        if chunk.kind == b"VP8L":
            packed = int.from_bytes(body[1:5], "little")
            return 1 + (packed & 0x3FFF), 1 + (packed >> 14 & 0x3FFF)
        if chunk.kind == b"VP8 ":
            return int.from_bytes(body[6:8], "little") & 0x3FFF, int.from_bytes(body[8:10], "little") & 0x3FFF
    return None


def webp_is_lossy(content: bytes) -> bool:
    """Whether the colours were compressed with losses."""
    return any(chunk.kind == b"VP8 " for chunk in _split(content))


def obstacle(content: bytes) -> str | None:
    """Say why the pixels of a WebP cannot be changed without losing some of it."""
    if any(chunk.kind == b"ANIM" for chunk in _split(content)):
        return "animated image, of which only the first frame would be left"
    return None


defect = nothing_to_say
expansions = as_they_are


def with_metadata_of(source: bytes, encoded: bytes, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded WebP every chunk beside the pixels that another has, byte for byte, and a note if there is room for it.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What was not copied: nothing but the note.
    """
    return _with_note(_put_in(encoded, [chunk for chunk in _split(source) if chunk.kind not in _CODING]), [], note)


def metadata(content: bytes) -> Metadata:
    """Collect what other formats can hold too."""
    found = {chunk.kind: chunk.body for chunk in _split(content) if chunk.kind not in _CODING}
    exif = found.pop(b"EXIF", b"").removeprefix(_EXIF_PREFIX)
    xmp, icc = found.pop(b"XMP ", b""), found.pop(b"ICCP", b"")
    others = tuple(f"chunk {kind.decode('latin-1').strip()}" for kind in sorted(found))
    return Metadata(exif=exif or None, xmp=xmp or None, icc=icc or None, others=others)


def with_metadata(encoded: bytes, described: Metadata, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded WebP the metadata of a file of another format, and a note if there is room for it.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What does not fit into a WebP.
    """
    blocks = {b"ICCP": described.icc, b"EXIF": described.exif, b"XMP ": described.xmp}
    chunks = [Chunk(kind, block) for kind, block in blocks.items() if block]
    lost = {"comments": described.comments, "resolution": described.dots_per_metre and not described.exif}
    return _with_note(_put_in(encoded, chunks), [name for name, block in lost.items() if block], note)


def _with_note(encoded: bytes, left_behind: list[str], note: str) -> tuple[bytes, list[str]]:
    """Add a note: WebP has no comments, so as EXIF or else as XMP, but for those that are there, which stay as they are."""
    there = metadata(encoded)
    if there.exif and there.xmp:
        return encoded, [*left_behind, "a note of the correction (the file has EXIF and XMP of its own)"]
    chunk = Chunk(b"XMP ", xmp_of(note)) if there.exif else Chunk(b"EXIF", exif_of(note))
    return _put_in(encoded, [chunk]), left_behind


def _split(content: bytes) -> Iterator[Chunk]:
    """All chunks; none if it is no WebP."""
    position = 12 if content[8:12] == b"WEBP" else len(content)
    while position + 8 <= len(content):
        end = position + 8 + int.from_bytes(content[position + 4 : position + 8], "little")
        yield Chunk(content[position : position + 4], content[position + 8 : end])
        position = end + end % 2


def _put_in(encoded: bytes, chunks: Sequence[Chunk]) -> bytes:
    """Add chunks to an encoded WebP, each where it must stand: the colour profile before the pixels, all else behind."""
    chunks = [*(chunk for chunk in _split(encoded) if chunk.kind not in _CODING), *chunks]
    if not chunks:
        return encoded
    pixels = [chunk for chunk in _split(encoded) if chunk.kind in {b"VP8 ", b"VP8L", b"ALPH"}]
    width, height = size(encoded) or (0, 0)
    flags = 0
    for chunk in chunks:
        flags |= _FLAGS.get(chunk.kind, 0)
    if any(chunk.kind == b"ALPH" or (chunk.kind == b"VP8L" and chunk.body[4] >> 4 & 1) for chunk in pixels):
        flags |= _ALPHA_FLAG
    header = bytes((flags, 0, 0, 0)) + (width - 1).to_bytes(3, "little") + (height - 1).to_bytes(3, "little")
    profile = [chunk for chunk in chunks if chunk.kind == b"ICCP"]
    # The specification wants EXIF before XMP, and what it does not know at the very end.
    order = {b"EXIF": 0, b"XMP ": 1}
    behind = sorted((chunk for chunk in chunks if chunk.kind != b"ICCP"), key=lambda chunk: order.get(chunk.kind, 2))
    body = b"".join(chunk.to_bytes() for chunk in (Chunk(b"VP8X", header), *profile, *pixels, *behind))
    return b"RIFF" + (4 + len(body)).to_bytes(4, "little") + b"WEBP" + body
