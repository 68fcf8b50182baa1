"""The formats that are taken apart here, each in a module of its own, imported when a file of that format turns up."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING, Protocol, cast

from camcal.errors import InputError

if TYPE_CHECKING:
    from camcal.formats.imaging.blocks import Metadata

    class Kind(Protocol):
        """What a module knows of files of its format."""

        @staticmethod
        def size(content: bytes) -> tuple[int, int] | None:
            """Read (width, height) in pixels; None or one of `SURPRISES` if the header is cut off."""

        @staticmethod
        def defect(content: bytes) -> str | None:
            """Say what is wrong with a file as a whole, if anything can be told without decoding it."""

        @staticmethod
        def obstacle(content: bytes) -> str | None:
            """Say why pixels cannot be changed without losing some of them, or of what they mean."""

        @staticmethod
        def expansions(content: bytes) -> list[str]:
            """Say what becomes of pixels when they are decoded to 8 or 16 bits or floats in one, three or four channels."""

        @staticmethod
        def metadata(content: bytes) -> Metadata:
            """Collect what other formats can hold too."""

        @staticmethod
        def with_metadata_of(source: bytes, encoded: bytes, note: str) -> tuple[bytes, list[str]]:
            """Give an encoded image all that another of this format has beside its pixels; also say what stays behind."""

        @staticmethod
        def with_metadata(encoded: bytes, metadata: Metadata, note: str) -> tuple[bytes, list[str]]:
            """Give an encoded image metadata of another format; also say what stays behind."""


SURPRISES = (struct.error, LookupError, ValueError, ArithmeticError)
"""What reading a header may raise that is cut off or damaged."""

_MODULES = frozenset({"bmp", "jpeg", "jpeg 2000", "png", "tiff", "webp"})

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
JPEG_SIGNATURE = b"\xff\xd8\xff"
TIFF_SIGNATURES = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")

_SIGNATURES: tuple[tuple[bytes, str], ...] = (
    (PNG_SIGNATURE, "png"),
    (JPEG_SIGNATURE, "jpeg"),
    *((signature, "tiff") for signature in TIFF_SIGNATURES),
    *((signature, "netpbm") for signature in (b"P1", b"P2", b"P3", b"P4", b"P5", b"P6")),
    (b"P7", "pam"),
    *((signature, "pfm") for signature in (b"PF", b"Pf")),
    (b"BM", "bmp"),
    (b"GIF8", "gif"),
    (b"#?", "hdr"),
    (b"\x59\xa6\x6a\x95", "sun"),
    (b"\xff\x4f\xff\x51", "jpeg 2000"),
)


def image_format(content: bytes) -> str | None:
    """Name the format whose signature a file begins with, one that OpenCV reads; None if it is none of them."""
    for signature, name in _SIGNATURES:
        if content.startswith(signature):
            return name
    if content[8:12] == b"WEBP":
        return "webp"
    return {b"ftyp": "avif", b"jP  ": "jpeg 2000"}.get(content[4:8])


def kind_of(content: bytes) -> Kind | None:
    """Return the module that takes apart files like this one; None if there is none."""
    name = image_format(content)
    return _module(name) if name in _MODULES else None


@contextmanager
def damage_refused(path: object) -> Iterator[None]:
    """Make a refusal of the file out of whatever its damaged parts do to those who read them: it must not end a run over many.

    Raises
    ------
    InputError
        Instead of any of `SURPRISES`.
    """
    try:
        yield
    except SURPRISES:
        raise InputError(
            f"{path}: damaged image (its parts contradict each other, or it ends too early). Copy it again."
        ) from None


@lru_cache
def _module(name: str) -> Kind:
    """Import a module once."""
    return cast("Kind", import_module(f"camcal.formats.imaging.{name.replace(' ', '')}"))
