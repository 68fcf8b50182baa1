"""Metadata that travels between image formats: whole blocks, whose bytes are never touched."""

from __future__ import annotations

from dataclasses import dataclass

INCH_M = 0.0254
CENTIMETRE_M = 0.01


@dataclass(frozen=True, slots=True)
class Metadata:
    """What an image file says beside its pixels.

    Attributes
    ----------
    exif : bytes or None
        An EXIF block: a TIFF without pixels.
    xmp : bytes or None
        An XMP packet.
    icc : bytes or None
        A colour profile.
    comments : tuple of str
        Free texts.
    dots_per_metre : tuple of float or None
        Pixels per metre of print, along x and y.
    others : tuple of str
        Names of what only the file's own format has a place for.
    """

    exif: bytes | None = None
    xmp: bytes | None = None
    icc: bytes | None = None
    comments: tuple[str, ...] = ()
    dots_per_metre: tuple[float, float] | None = None
    others: tuple[str, ...] = ()

    def names(self) -> list[str]:
        """Name what there is that has a place in many formats, but for the resolution."""
        blocks = {"EXIF": self.exif, "XMP": self.xmp, "colour profile": self.icc, "comments": self.comments}
        return [name for name, block in blocks.items() if block]


def nothing_to_say(_content: bytes) -> None:
    """Find nothing: for formats of which nothing can be told without decoding, or which hold nothing that would be lost."""


def as_they_are(_content: bytes) -> list[str]:
    """Change nothing: for formats whose pixels are decoded to what they are."""
    return []
