"""TIFF's tags, which EXIF shares: read from any kind of TIFF, written as a classic one of little-endian byte order.

Source of the layout: TIFF 6.0, section 2; the BigTIFF design; Exif 2.32, section 4.6.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Literal

from camcal.formats.imaging.kinds import TIFF_SIGNATURES

EXIF_POINTER, GPS_POINTER, INTEROPERABILITY_POINTER = 34665, 34853, 40965
HISTORY = 37395
"""Code of the image history, a tag of TIFF/EP that EXIF has a place for."""

_POINTERS = frozenset({EXIF_POINTER, GPS_POINTER, INTEROPERABILITY_POINTER})
ASCII, SHORT, LONG, RATIONAL, UNDEFINED = 2, 3, 4, 5, 7
# Bytes of one value of each type, and how many of them change places with the byte order.
_TYPE_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}
_WORD_BYTES = _TYPE_BYTES | {5: 4, 10: 4}
_WIDE = {16: LONG, 17: 9, 18: 13}
_MOST_DIRECTORIES = 10_000
_MOST_TAGS = 10_000
_DEEPEST = 4


@dataclass(frozen=True, slots=True)
class Tag:
    """One tag.

    Attributes
    ----------
    code : int
    type : int
        TIFF's number of the type.
    value : bytes
        All values, little-endian.
    place : int
        Where the value stands in the file it was read from; 0 if it was made.
    """

    code: int
    type: int
    value: bytes
    place: int = 0

    @property
    def numbers(self) -> tuple[int, ...]:
        """The values as whole numbers, of whatever width."""
        size = _WORD_BYTES[self.type]
        return tuple(int.from_bytes(self.value[i : i + size], "little") for i in range(0, len(self.value), size))


@dataclass(frozen=True, slots=True)
class Directory:
    """A directory of tags: one image, or EXIF's part of its description.

    Attributes
    ----------
    tags : dict of int to Tag
        By their codes; without pointers to other directories.
    parts : dict of int to Directory
        EXIF, GPS and interoperability directories, by the codes of their pointers.
    """

    tags: dict[int, Tag] = field(default_factory=dict)
    parts: dict[int, Directory] = field(default_factory=dict)

    def number(self, code: int, default: int) -> int:
        """First value of a tag, or the default if there is none."""
        tag = self.tags.get(code)
        return tag.numbers[0] if tag and tag.numbers else default


def text_tag(code: int, text: str) -> Tag:
    """Make a tag of text."""
    return Tag(code, ASCII, text.encode() + b"\0")


def read_directories(content: bytes) -> list[Directory]:
    """Read the directories of a TIFF or EXIF block, one per image.

    What is cut off or refers to bytes outside is left out, and a chain that bites its tail ends there.
    """
    if not content.startswith(TIFF_SIGNATURES):
        return []
    reader = _Reader(content)
    found: list[Directory] = []
    seen = set()
    position = reader.first
    while position and position not in seen and len(found) < _MOST_DIRECTORIES:
        seen.add(position)
        try:
            directory, position = reader.directory(position)
        except struct.error:
            break
        found.append(directory)
    return found


def tiff_block(directory: Directory) -> bytes:
    """Write a directory as a TIFF without pixels: an EXIF block."""
    return b"II*\0" + (8).to_bytes(4, "little") + directory_bytes(directory, 8)


def exif_of(note: str) -> bytes:
    """Make an EXIF block that says nothing but a line of image history."""
    return tiff_block(Directory(parts={EXIF_POINTER: Directory({HISTORY: text_tag(HISTORY, note)})}))


def directory_bytes(directory: Directory, start: int) -> bytes:
    """Write a directory, its values and its parts behind it, to stand at byte `start` of a file (even)."""
    codes = sorted({*directory.tags, *directory.parts})
    entries = []
    behind = bytearray()
    values_start = start + 2 + 12 * len(codes) + 4
    for code in codes:
        place = values_start + len(behind)
        part = directory.parts.get(code)
        if part is not None:
            entries.append(struct.pack("<HHII", code, LONG, 1, place))
            behind += directory_bytes(part, place)
            continue
        tag = directory.tags[code]
        head = struct.pack("<HHI", code, tag.type, len(tag.value) // _TYPE_BYTES[tag.type])
        if len(tag.value) <= 4:
            entries.append(head + tag.value.ljust(4, b"\0"))
        else:
            entries.append(head + place.to_bytes(4, "little"))
            behind += tag.value + b"\0" * (len(tag.value) % 2)
    return len(codes).to_bytes(2, "little") + b"".join(entries) + b"\0\0\0\0" + bytes(behind)


class _Reader:
    """Reads directories of one file, whatever its byte order and width."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.order: Literal["<", ">"] = "<" if content.startswith(b"II") else ">"
        self.big = content[2:4] in {b"+\0", b"\0+"}
        # Format characters of a count of entries, of a count of values, and of a position.
        self.short, self.word = ("Q", "Q") if self.big else ("H", "I")
        self.first = self._number(self.word, 8 if self.big else 4) if len(content) >= (16 if self.big else 8) else 0

    def directory(self, position: int, depth: int = 0) -> tuple[Directory, int]:
        """Read a directory and the position of the next one; struct.error if it is cut off."""
        count = min(self._number(self.short, position), _MOST_TAGS)
        entry_bytes = 20 if self.big else 12
        start = position + struct.calcsize(self.order + self.short)
        result = Directory()
        for entry in range(start, start + count * entry_bytes, entry_bytes):
            tag = self._tag(entry)
            if tag is None:
                continue
            if tag.code in _POINTERS:
                if depth < _DEEPEST and tag.numbers:
                    self._add_part(result, tag, depth)
            else:
                result.tags.setdefault(tag.code, tag)
        return result, self._number(self.word, start + count * entry_bytes)

    def _add_part(self, result: Directory, tag: Tag, depth: int) -> None:
        """Read the directory that a pointer leads to, if it is there."""
        try:
            result.parts[tag.code] = self.directory(tag.numbers[0], depth + 1)[0]
        except struct.error:
            return

    def _tag(self, entry: int) -> Tag | None:
        """Read a tag; None if its type is not known or its value is not there."""
        code, kind = struct.unpack_from(self.order + "HH", self.content, entry)
        count = self._number(self.word, entry + 4)
        size = count * _TYPE_BYTES.get(kind, 0)
        room = 8 if self.big else 4
        place = entry + 4 + room
        if size > room:
            place = self._number(self.word, place)
        if kind not in _TYPE_BYTES or place + size > len(self.content):
            return None
        value = self.content[place : place + size]
        if self.order == ">" and _WORD_BYTES[kind] > 1:
            value = b"".join(word[::-1] for word in _words(value, _WORD_BYTES[kind]))
        if kind in _WIDE:
            return _narrowed(Tag(code, kind, value, place))
        return Tag(code, kind, value, place)

    def _number(self, kind: str, position: int) -> int:
        """Read one unsigned number; struct.error if it is not there, however far beyond the end that is."""
        if position > len(self.content):
            raise struct.error("beyond the end of the file")
        return int(struct.unpack_from(self.order + kind, self.content, position)[0])


def _narrowed(tag: Tag) -> Tag | None:
    """Write BigTIFF's 8-byte numbers as the 4-byte ones of a classic TIFF; None if they do not fit."""
    words = list(_words(tag.value, 8))
    if any(word[4:] not in {b"\0\0\0\0", b"\xff\xff\xff\xff"} for word in words):
        return None
    return Tag(tag.code, _WIDE[tag.type], b"".join(word[:4] for word in words), tag.place)


def _words(value: bytes, size: int) -> Iterator[bytes]:
    """Cut into words of a size."""
    return (value[start : start + size] for start in range(0, len(value), size))


def without(directory: Directory, codes: Iterable[int]) -> Directory:
    """Return a directory without some tags."""
    left_out = frozenset(codes)
    return Directory({code: tag for code, tag in directory.tags.items() if code not in left_out}, directory.parts)
