"""MAT files in (MATLAB's level 5, which `save` writes up to -v7): numbers and structs as plain values.

After "MAT-File Format", The MathWorks. A reader of our own, because the usual one crashes the interpreter on torn files.
"""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from camcal.errors import InputError

_MOST_BYTES = 64_000_000
_HEADER_BYTES = 128
_DEEPEST_NESTING = 20
_MATRIX, _COMPRESSED = 14, 15
_STRUCT = 2
_NUMBERS = range(6, 16)
# Data types by their number, as numpy writes them.
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}


def parse_mat(name: str, content: bytes) -> dict[str, Any]:
    """Read the variables of a MAT file.

    Parameters
    ----------
    name : str
        The file as the user named it.
    content : bytes

    Returns
    -------
    dict
        By their names: numbers as nested lists, row by row; single structs as dicts; None for all else, such as objects.

    Raises
    ------
    InputError
        If the file is torn, or unpacks to more than any such file needs.
    """
    try:
        reader = _Reader(content, ">" if content[126:128] == b"MI" else "<", _HEADER_BYTES)
        variables: dict[str, Any] = {}
        while reader.place < len(content):
            kind, data = reader.element()
            if kind == _COMPRESSED:
                kind, data = _Reader(_unpacked(data), reader.order).element()
            if kind == _MATRIX:
                label, value = _matrix(_Reader(data, reader.order), 0)
                variables[label] = value
    except (struct.error, zlib.error, ValueError, KeyError, OverflowError):
        raise InputError(f"{name}: not a whole MAT file ({len(content)} bytes). Copy or save it again.") from None
    return variables


@dataclass(slots=True)
class _Reader:
    """Elements one after the other, each with its tag before it."""

    data: bytes
    order: str
    place: int = 0

    def element(self) -> tuple[int, bytes]:
        """Return the type and the data of the next element."""
        kind, count = struct.unpack_from(f"{self.order}2I", self.data, self.place)
        if kind >> 16:
            # A short one has its data within the tag.
            kind, count = kind & 0xFFFF, kind >> 16
            start, self.place = self.place + 4, self.place + 8
        else:
            start = self.place + 8
            # All but packed ones begin at multiples of 8 bytes.
            self.place = start + (count if kind == _COMPRESSED else -(-count // 8) * 8)
        data = self.data[start : start + count]
        if len(data) != count:
            raise ValueError("torn")
        return kind, data

    def numbers(self) -> np.ndarray[Any, np.dtype[Any]]:
        """Return the next element as a row of numbers."""
        kind, data = self.element()
        return np.frombuffer(data, np.dtype(_TYPES[kind]).newbyteorder("<" if self.order == "<" else ">"))

    def text(self) -> str:
        """Return the next element as text."""
        return self.element()[1].decode("latin-1")


def _matrix(reader: _Reader, depth: int) -> tuple[str, Any]:
    """Read the name and the value of one array."""
    if depth > _DEEPEST_NESTING:
        raise ValueError("nested too deeply")
    if not reader.data:
        return "", []
    kind = int(reader.numbers()[0]) & 0xFF
    if kind != _STRUCT and kind not in _NUMBERS:
        return "", None
    shape = tuple(int(side) for side in reader.numbers())
    label = reader.text()
    if kind in _NUMBERS:
        return label, reader.numbers().astype(np.float64).reshape(shape, order="F").tolist()
    if math.prod(shape) != 1:
        return label, None
    width = int(reader.numbers()[0])
    names = reader.text()
    if width <= 0:
        raise ValueError("torn")
    keys = [names[start : start + width].partition("\0")[0] for start in range(0, len(names), width)]
    return label, {key: _matrix(_Reader(reader.element()[1], reader.order), depth + 1)[1] for key in keys}


def _unpacked(data: bytes) -> bytes:
    """Unpack a compressed element."""
    unpacking = zlib.decompressobj()
    content = unpacking.decompress(data, _MOST_BYTES)
    if unpacking.unconsumed_tail:
        raise ValueError("too big")
    return content
