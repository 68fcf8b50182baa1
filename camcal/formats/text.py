"""Text files read with their faults named, and text shown on one line."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, BinaryIO

from camcal.errors import InputError

STANDARD_INPUT = "standard input"
"""What messages call it."""
_LONGEST_SHOWN = 60


def read_bytes(path: str | Path, most_bytes: int | None = None) -> bytes:
    """Read a file that must not be empty, or a pipe, which can be read only once.

    Parameters
    ----------
    path : str or Path
    most_bytes : int or None
        Refuse a bigger file before it is read.

    Raises
    ------
    InputError
        If the file is missing, a folder, unreadable, empty or too big.
    """
    file = Path(path)
    try:
        if file.is_dir():
            raise InputError(f"{path}: a folder (expected a file). Name a file in it.")
        if not file.exists():
            raise InputError(f"{path}: no such file. Check the path.")
        if file.is_char_device() or file.is_block_device():
            raise InputError(f"{path}: a device (expected a file). Name a file.")
        size = file.stat().st_size
        if most_bytes is not None and size > most_bytes:
            raise InputError(f"{path}: too big (got {size} bytes, expected at most {most_bytes})")
        with file.open("rb") as stream:
            return _all_of(stream, path, most_bytes)
    except OSError as error:
        raise unreadable(path, error) from None


def read_standard_input(most_bytes: int) -> bytes:
    """Read standard input, which must not be empty.

    Raises
    ------
    InputError
        If it is closed, unreadable, empty or too long.
    """
    if sys.stdin is None:
        raise InputError(f"{STANDARD_INPUT}: closed. Pipe a file into it, or name one.")
    try:
        return _all_of(sys.stdin.buffer, STANDARD_INPUT, most_bytes)
    except OSError as error:
        raise unreadable(STANDARD_INPUT, error) from None


def _all_of(stream: BinaryIO, name: str | Path, most_bytes: int | None) -> bytes:
    """Read a stream to its end; a pipe does not tell before how much will come."""
    content = stream.read(-1 if most_bytes is None else most_bytes + 1)
    if most_bytes is not None and len(content) > most_bytes:
        raise InputError(f"{name}: too big (got more than {most_bytes} bytes, expected at most that)")
    if not content:
        raise InputError(f"{name}: empty file (0 bytes). Write or copy it again.")
    return content


def read_text(path: str | Path, most_bytes: int) -> str:
    """Read a UTF-8 text file, with or without a byte order mark.

    Raises
    ------
    InputError
        If it cannot be read, is too big, or is not UTF-8.
    """
    return decoded(path, read_bytes(path, most_bytes))


def decoded(name: str | Path, content: bytes) -> str:
    """Decode a UTF-8 text, with or without a byte order mark.

    Raises
    ------
    InputError
        If it is not UTF-8, or only white space.
    """
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"{name}:{line}: not UTF-8 text (byte {content[error.start]:#04x}). Save it as UTF-8.") from None
    if not text.strip():
        raise InputError(f"{name}: empty file (only white space). Write or copy it again.")
    return text


def file_in(path: str | Path, name: str) -> Path:
    """Return the file of a name within a folder, or the path itself if it is none."""
    try:
        return Path(path) / name if Path(path).is_dir() else Path(path)
    except OSError:
        return Path(path)


def shown(value: Any) -> str:
    """Write a value on one line, shortened: text in quotes, the rest as Python writes it."""
    text = repr(str(value)) if isinstance(value, (str, Path)) else repr(value)
    return text if len(text) <= _LONGEST_SHOWN else f"{text[: _LONGEST_SHOWN - 3]}..."


def unreadable(path: str | Path, error: OSError) -> InputError:
    """Build the error for a path that the system does not let us read."""
    return InputError(f"{path}: cannot be read ({(error.strerror or str(error)).lower()}). Check the path and its permissions.")
