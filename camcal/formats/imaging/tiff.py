"""TIFF files: what their tags say of the pixels, and metadata copied from file to file.

Source of the layout: TIFF 6.0; for what the tags are called, the Library of Congress's list of tags.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Literal

from camcal.formats.imaging.blocks import CENTIMETRE_M, INCH_M, Metadata, nothing_to_say
from camcal.formats.imaging.tiff_tags import (
    EXIF_POINTER,
    HISTORY,
    RATIONAL,
    SHORT,
    UNDEFINED,
    Directory,
    Tag,
    directory_bytes,
    read_directories,
    text_tag,
    tiff_block,
    without,
)

_SUBFILE_KIND, _WIDTH, _HEIGHT, _BITS, _COMPRESSION, _PHOTOMETRIC = 254, 256, 257, 258, 259, 262
_DESCRIPTION, _ORIENTATION, _CHANNELS, _PLANES, _PREVIEWS, _EXTRA, _SAMPLE_FORMAT = 270, 274, 277, 284, 330, 338, 339
_X_DOTS, _Y_DOTS, _DOTS_UNIT, _PER_CENTIMETRE = 282, 283, 296, 3
_XMP, _IPTC, _PHOTOSHOP, _PROFILE = 700, 33723, 34377, 34675
# Tags that say how pixels are stored; those of the new file hold.
_STORAGE = frozenset(
    {
        *(_SUBFILE_KIND, 255, _WIDTH, _HEIGHT, _BITS, _COMPRESSION, _PHOTOMETRIC, 263, 264, 265, 266, 273, _CHANNELS, 278, 279),
        *(280, 281, _PLANES, 288, 289, 290, 291, 292, 293, 297, 317, 320, 321, 322, 323, 324, 325, _PREVIEWS, 332, _EXTRA),
        *(_SAMPLE_FORMAT, 340, 341, 347, 512, 513, 514, 515, 517, 518, 519, 520, 521, 529, 530, 531, 532),
    }
)
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB, _PALETTE, _YCC = 0, 1, 2, 3, 6
_UNSPECIFIED, _UNASSOCIATED = 0, 2
_UNCOMPRESSED, _LZW, _DEFLATE, _OLD_DEFLATE = 1, 5, 8, 32946
# Bits and formats of samples that images here may have: unsigned ones, and float32.
_SAMPLES = frozenset({(8, 1), (16, 1), (32, 3)})


@dataclass(frozen=True, slots=True)
class TiffLayout:
    """How the pixels of a TIFF's first image are stored.

    Attributes
    ----------
    size : tuple of int
        (width, height) in pixels.
    bits, sample_format : int
        Bits per sample, and TIFF's number of what they are (1 unsigned, 2 signed, 3 float).
    channels : int
    photometric : int
        TIFF's number of what the channels are.
    extra : int or None
        TIFF's number of what the channel beyond grey or colour is; None if there is none.
    is_planar : bool
        Whether the channels are stored apart.
    compression : int
    images : int
        Images in the file, reduced ones not counted.
    """

    size: tuple[int, int]
    bits: int
    sample_format: int
    channels: int
    photometric: int
    extra: int | None
    is_planar: bool
    compression: int
    images: int


def tiff_layout(content: bytes) -> TiffLayout | None:
    """Read how the pixels of the first image are stored; None if there is none."""
    directories = read_directories(content)
    if not directories:
        return None
    first = directories[0]
    return TiffLayout(
        size=(first.number(_WIDTH, 0), first.number(_HEIGHT, 0)),
        bits=first.number(_BITS, 1),
        sample_format=first.number(_SAMPLE_FORMAT, 1),
        channels=first.number(_CHANNELS, 1),
        photometric=first.number(_PHOTOMETRIC, _BLACK_IS_ZERO),
        extra=first.number(_EXTRA, 0) if _EXTRA in first.tags else None,
        is_planar=first.number(_PLANES, 1) == 2,
        compression=first.number(_COMPRESSION, _UNCOMPRESSED),
        images=sum(not directory.number(_SUBFILE_KIND, 0) & 1 for directory in directories[1:]) + 1,
    )


def size(content: bytes) -> tuple[int, int] | None:
    """Read (width, height) in pixels; None if there is no image."""
    layout = tiff_layout(content)
    return layout.size if layout else None


defect = nothing_to_say


def obstacle(content: bytes) -> str | None:
    """Say why the pixels of a TIFF cannot be changed without losing some of it, or of what they mean."""
    layout = tiff_layout(content)
    if layout is None:
        return "no image in it"
    if layout.images > 1:
        return f"{layout.images} images in one file"
    if layout.photometric in {_PALETTE, _YCC}:
        return None
    channels = {_WHITE_IS_ZERO: {1}, _BLACK_IS_ZERO: {1}, _RGB: {3, 4}}.get(layout.photometric)
    if channels is None:
        return f"neither grey nor RGB (photometric interpretation {layout.photometric})"
    return None if layout.bits == layout.channels == 1 else _odd_samples(layout, channels)


def _odd_samples(layout: TiffLayout, channels: set[int]) -> str | None:
    """Say what is odd about samples in as many channels as there may be."""
    if layout.channels not in channels:
        return f"{layout.channels} channels"
    if (layout.bits, layout.sample_format) not in _SAMPLES:
        kind = {1: "unsigned", 2: "signed", 3: "float"}.get(layout.sample_format, "unknown")
        return f"pixels of {layout.bits} bits, {kind}"
    apart = layout.is_planar and layout.channels > 1 and layout.bits > 8
    return f"channels of {layout.bits} bits stored apart" if apart else None


def expansions(content: bytes) -> list[str]:
    """Say what becomes of pixels when they are decoded to 8 or 16 bits or floats in one, three or four channels."""
    layout = tiff_layout(content)
    if layout is None:
        return []
    if layout.photometric == _PALETTE:
        return ["palette image: written with full colours, because colours in between are not in the palette"]
    if layout.photometric == _YCC:
        return ["luminance and chrominance: written as red, green and blue"]
    return ["1-bit image: written with 8 bits"] if layout.bits == 1 else []


def unturned_tiff(content: bytes, *, as_stored: bool = False) -> bytes:
    """Return a TIFF whose tags keep OpenCV from moving pixels, and from changing their values; anything else as it is.

    OpenCV turns the pixels as the orientation tag says, even when it is told not to. It multiplies 8-bit colours by an alpha
    channel that is declared as unassociated, and inverts 8-bit values that are declared as growing darker; with `as_stored`
    it does neither.
    """
    directories = read_directories(content)
    if not directories:
        return content
    first = directories[0]
    neutral = {_ORIENTATION: 1}
    if as_stored:
        neutral[_EXTRA] = 0
        if first.number(_BITS, 1) >= 8 and first.number(_PHOTOMETRIC, _BLACK_IS_ZERO) == _WHITE_IS_ZERO:
            neutral[_PHOTOMETRIC] = _BLACK_IS_ZERO
    order: Literal["little", "big"] = "little" if content.startswith(b"II") else "big"
    changes = {code: value for code, value in neutral.items() if first.number(code, value) != value}
    if not changes:
        return content
    changed = bytearray(content)
    for code, value in changes.items():
        place = first.tags[code].place
        changed[place : place + 2] = value.to_bytes(2, order)
    return bytes(changed)


def has_alpha(content: bytes) -> bool:
    """Whether a fourth channel is an alpha by which colours are to be weighed.

    In a TIFF that does not say so, they are multiplied by it already, or it is another channel altogether.
    """
    layout = tiff_layout(content)
    return layout is not None and layout.extra == _UNASSOCIATED


def lossless_compression(content: bytes) -> int:
    """Choose a compression that loses nothing: a TIFF's own, or LZW if that is another."""
    layout = tiff_layout(content)
    own = layout.compression if layout else _LZW
    return {_OLD_DEFLATE: _DEFLATE}.get(own, own if own in {_UNCOMPRESSED, _LZW, _DEFLATE} else _LZW)


def with_metadata_of(source: bytes, encoded: bytes, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded TIFF every tag beside the pixels that another has, and a line in its EXIF image history.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What was not copied.
    """
    directories = read_directories(source) or [Directory()]
    described = without(directories[0], _STORAGE)
    kept = dict(described.tags)
    for code in (_PHOTOMETRIC, _EXTRA):
        tag = directories[0].tags.get(code)
        if tag is not None and _same_channels(source, encoded):
            kept[code] = tag
    left_behind = ["reduced images"] if len(directories) > 1 or _PREVIEWS in directories[0].tags else []
    return _put_in(encoded, Directory(kept, described.parts), _UNSPECIFIED, note), left_behind


def metadata(content: bytes) -> Metadata:
    """Collect what other formats can hold too; the EXIF block is made of the tags that do not describe the pixels' storage."""
    directories = read_directories(content)
    first = without(directories[0], _STORAGE) if directories else Directory()
    blocks = {code: first.tags.pop(code).value for code in (_XMP, _PROFILE, _IPTC, _PHOTOSHOP) if code in first.tags}
    others = [name for code, name in ((_IPTC, "IPTC"), (_PHOTOSHOP, "Photoshop's settings")) if code in blocks]
    return Metadata(
        exif=tiff_block(first) if first.tags or first.parts else None,
        xmp=blocks.get(_XMP),
        icc=blocks.get(_PROFILE),
        dots_per_metre=_dots_per_metre(first),
        others=tuple(others),
    )


def with_metadata(encoded: bytes, given: Metadata, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded TIFF the metadata of a file of another format, and a line in its EXIF image history.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What does not fit into a TIFF.
    """
    exif = read_directories(given.exif or b"")
    left_behind = ["unreadable EXIF"] if given.exif and not exif else []
    described = without(exif[0], _STORAGE) if exif else Directory()
    for code, block in ((_XMP, given.xmp), (_PROFILE, given.icc)):
        if block:
            described.tags[code] = Tag(code, UNDEFINED if code == _PROFILE else 1, block)
    if given.dots_per_metre and _X_DOTS not in described.tags:
        described.tags[_DOTS_UNIT] = Tag(_DOTS_UNIT, SHORT, _PER_CENTIMETRE.to_bytes(2, "little"))
        for code, dots in zip((_X_DOTS, _Y_DOTS), given.dots_per_metre, strict=True):
            described.tags[code] = Tag(code, RATIONAL, struct.pack("<II", round(dots), 100))
    if given.comments and _DESCRIPTION not in described.tags:
        described.tags[_DESCRIPTION] = text_tag(_DESCRIPTION, "\n".join(given.comments))
    elif given.comments:
        left_behind.append("comments")
    return _put_in(encoded, described, _UNASSOCIATED, note), left_behind


def _same_channels(source: bytes, encoded: bytes) -> bool:
    """Whether the channels of a TIFF are stored in another as they were."""
    before, after = tiff_layout(source), tiff_layout(encoded)
    kept = {_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB}
    return bool(
        before and after and before.photometric in kept and (before.channels, before.bits) == (after.channels, after.bits)
    )


def _dots_per_metre(directory: Directory) -> tuple[float, float] | None:
    """Resolution that the tags state."""
    unit_m = {2: INCH_M, _PER_CENTIMETRE: CENTIMETRE_M}.get(directory.number(_DOTS_UNIT, 2))
    values = [directory.tags[code].numbers for code in (_X_DOTS, _Y_DOTS) if code in directory.tags]
    if unit_m is None or len(values) < 2 or any(len(value) < 2 or not value[1] for value in values):
        return None
    return values[0][0] / values[0][1] / unit_m, values[1][0] / values[1][1] / unit_m


def _put_in(encoded: bytes, described: Directory, extra: int, note: str) -> bytes:
    """Put a description into the only directory of an encoded TIFF, in which the pixels stay where they are.

    `extra` is what to call a fourth channel that the description does not.
    """
    own = read_directories(encoded)[0]
    tags = own.tags | described.tags
    if own.number(_CHANNELS, 1) == 4 and _EXTRA not in tags:
        tags[_EXTRA] = Tag(_EXTRA, SHORT, extra.to_bytes(2, "little"))
    exif = described.parts.get(EXIF_POINTER, Directory())
    past = exif.tags[HISTORY].value.rstrip(b"\0").decode("utf-8", "replace") + "\n" if HISTORY in exif.tags else ""
    noted = Directory(exif.tags | {HISTORY: text_tag(HISTORY, past + note)}, exif.parts)
    start = len(encoded) + len(encoded) % 2
    directory = directory_bytes(Directory(tags, described.parts | {EXIF_POINTER: noted}), start)
    return b"".join([encoded[:4], start.to_bytes(4, "little"), encoded[8:], b"\0" * (start - len(encoded)), directory])
