"""BMP files: what their header says of the pixels, and the resolution, which is all that they hold beside them.

Source of the layout: Windows' BITMAPFILEHEADER, BITMAPINFOHEADER and BITMAPV5HEADER.
"""

from __future__ import annotations

import struct

from camcal.formats.imaging.blocks import Metadata, nothing_to_say

_HEADER, _SIZE, _BITS, _DOTS, _COLOURS = 14, 18, 28, 38, 46
# The oldest header knows neither resolution nor profiles, and its palettes have three bytes per colour.
_OLDEST_BYTES, _USUAL_BYTES, _LATEST_BYTES = 12, 40, 124
_PROFILE_KIND, _PROFILE_PLACE, _EMBEDDED = 70, 126, b"DEBM"
_LARGEST = 2**31 - 1


def size(content: bytes) -> tuple[int, int]:
    """Read (width, height) in pixels; a height below 0 says that the topmost row comes first."""
    layout = "<HH" if _header_bytes(content) == _OLDEST_BYTES else "<ii"
    width, height = struct.unpack_from(layout, content, _SIZE)
    return abs(width), abs(height)


def defect(content: bytes) -> str | None:
    """Tell whether the header is there; of the pixels nothing can be told without decoding."""
    whole = len(content) >= _HEADER + 4 and len(content) >= _HEADER + _header_bytes(content)
    return None if whole else f"truncated image (it ends after {len(content)} bytes)"


obstacle = nothing_to_say


def expansions(content: bytes) -> list[str]:
    """Say what becomes of a palette: greys stay greys."""
    header = _header_bytes(content)
    is_old = header == _OLDEST_BYTES
    (bits,) = struct.unpack_from("<H", content, _BITS - 4 if is_old else _BITS)
    if bits > 8:
        return []
    entry = 3 if is_old else 4
    count = 0 if is_old else struct.unpack_from("<I", content, _COLOURS)[0]
    palette = content[_HEADER + header :][: entry * (count or 1 << bits)]
    if palette[::entry] == palette[1::entry] == palette[2::entry]:
        return [] if bits == 8 else [f"{bits}-bit image: written with 8 bits"]
    return ["palette image: written with full colours, because colours in between are not in the palette"]


def metadata(content: bytes) -> Metadata:
    """Collect what other formats can hold too."""
    header = _header_bytes(content)
    dots = struct.unpack_from("<ii", content, _DOTS) if header >= _USUAL_BYTES else (0, 0)
    return Metadata(icc=_profile(content) if header >= _LATEST_BYTES else None, dots_per_metre=dots if min(dots) > 0 else None)


def with_metadata_of(source: bytes, encoded: bytes, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded BMP the resolution of another; also say what stays behind."""
    return with_metadata(encoded, metadata(source), note)


def with_metadata(encoded: bytes, described: Metadata, _note: str) -> tuple[bytes, list[str]]:
    """Give an encoded BMP the resolution of a file of another format; there is no place for a note.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What does not fit into a BMP.
    """
    if described.dots_per_metre:
        dots = (min(round(dots), _LARGEST) for dots in described.dots_per_metre)
        encoded = encoded[:_DOTS] + struct.pack("<ii", *dots) + encoded[_DOTS + 8 :]
    return encoded, described.names()


def _header_bytes(content: bytes) -> int:
    """Length of the header that says how pixels are stored."""
    return int(struct.unpack_from("<I", content, _HEADER)[0])


def _profile(content: bytes) -> bytes | None:
    """Colour profile, if it is in the file."""
    start, length = struct.unpack_from("<II", content, _PROFILE_PLACE)
    profile = content[_HEADER + start :][:length]
    return profile if content[_PROFILE_KIND : _PROFILE_KIND + 4] == _EMBEDDED and profile else None
