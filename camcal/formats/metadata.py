"""Metadata carried from a source image to what was made of it: byte for byte within a format, as whole blocks between formats.

The orientation tag goes along, and pixels are never turned: both the camera and its lens belong to the sensor's pixels.
"""

from __future__ import annotations

from camcal.formats.imaging.blocks import Metadata
from camcal.formats.imaging.header import image_size
from camcal.formats.imaging.kinds import damage_refused, kind_of

# What metadata look like in files of other formats, which are not taken apart here.
_SIGNS = (b"Exif", b"x:xmpmeta", b"ICC_PROFILE", b"acsp", b"XMP Data")
# How an AVIF says that players turn or mirror it: by boxes of nine bytes near its beginning.
_TURNS = (b"\0\0\0\x09irot", b"\0\0\0\x09imir")
_HEAD_BYTES = 1 << 16


def carry_metadata(source: bytes, encoded: bytes, note: str, path: object = "image") -> tuple[bytes, tuple[str, ...]]:
    """Give an encoded image the metadata of its source, and a note of what was done to it.

    The note is a comment in JPEG and PNG, and a line of EXIF's image history (a tag of TIFF/EP) in TIFF; in WebP too if there
    is no EXIF yet, or else XMP's history if there is no XMP yet.

    Parameters
    ----------
    source : bytes
        A whole image file.
    encoded : bytes
        A whole image file without metadata.
    note : str
        One line.
    path : object
        What to call the source.

    Returns
    -------
    encoded : bytes
    warnings : tuple of str
        What was not carried over, one clause each.

    Raises
    ------
    InputError
        If the source is damaged.
    """
    with damage_refused(path):
        return _carried(source, encoded, note)


def _carried(source: bytes, encoded: bytes, note: str) -> tuple[bytes, tuple[str, ...]]:
    """Do it, come what may of a damaged source."""
    old, new = kind_of(source), kind_of(encoded)
    if old and old is new:
        content, left_behind = old.with_metadata_of(source, encoded, note)
    else:
        described = old.metadata(source) if old else Metadata(others=_unread(source))
        content, left_behind = new.with_metadata(encoded, described, note) if new else (encoded, _lost(described))
        left_behind = [*described.others, *left_behind]
    warnings = [f"not carried over: {', '.join(left_behind)}"] if left_behind else []
    if old and image_size(source) != image_size(encoded) and old.metadata(source).exif:
        warnings.append("EXIF still states the size of the source")
    return content, tuple(warnings)


def _lost(described: Metadata) -> list[str]:
    """Names of all that a format without metadata loses."""
    return [*described.names(), *(["resolution"] if described.dots_per_metre else [])]


def _unread(source: bytes) -> tuple[str, ...]:
    """What a file of another format seems to have that is not read here."""
    found = ["metadata"] if any(sign in source for sign in _SIGNS) else []
    if any(turn in source[:_HEAD_BYTES] for turn in _TURNS):
        found.append("its orientation")
    return tuple(found)
