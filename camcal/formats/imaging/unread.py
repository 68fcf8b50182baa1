"""Images of formats that are not read, known by their extensions, and what to make of them first."""

from __future__ import annotations

from pathlib import PurePath

_RAW = ("dng", "cr2", "cr3", "nef", "nrw", "arw", "raf", "orf", "rw2", "pef", "srw", "raw")
_ADVICE = {
    **dict.fromkeys((".heic", ".heif", ".hif"), "Convert to JPEG or TIFF first."),
    **dict.fromkeys((".exr", ".psd", ".jxl", ".fits", ".fit"), "Convert to TIFF first."),
    **{f".{name}": "Develop to TIFF first, without lens correction." for name in _RAW},
}
UNREAD = frozenset(_ADVICE)
"""Their extensions, in lower case."""


def advice_for(path: PurePath) -> str:
    """Say what to do with an image of such a format."""
    return _ADVICE[path.suffix.lower()]
