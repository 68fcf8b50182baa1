"""Files and folders written: whole or not at all, and never over somebody's work unasked."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from camcal.errors import InputError

_FIRST_BYTES = 4096
"""How much of a file tells what it is."""


def write_atomically(path: str | Path, content: bytes | str) -> None:
    """Write a file under a temporary name in its own folder, then rename it.

    Whatever interrupts the writing, Ctrl-C included, the file is either complete, as it was before, or absent, and the
    temporary one is gone.

    Parameters
    ----------
    path : str or Path
    content : bytes or str
        Text is written as UTF-8 with its line ends as they are.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    target = Path(path)
    data = content.encode() if isinstance(content, str) else content
    temporary = target.with_name(f".camcal-{os.urandom(8).hex()}.tmp")
    try:
        try:
            temporary.write_bytes(data)
            temporary.replace(target)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        raise _unwritable(target, error) from None


def remove_file(path: str | Path) -> None:
    """Remove a file, if it is there.

    Raises
    ------
    InputError
        If it cannot be removed, or is a folder.
    """
    file = Path(path)
    try:
        if file.is_dir() and not file.is_symlink():
            raise InputError(f"{file}: a folder stands where a file should be. Choose another folder.")
        file.unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{file}: cannot be removed ({(error.strerror or str(error)).lower()}). Remove it.") from None


def holds(path: str | Path, content: bytes) -> bool:
    """Tell whether a file is there and has this content."""
    try:
        return Path(path).read_bytes() == content
    except OSError:
        return False


def claim_folder(path: str | Path, force: bool = False) -> Path:
    """Make sure that a folder exists, may be written to, and holds nothing that would be lost.

    Parameters
    ----------
    path : str or Path
        Created with its parents if it is not there.
    force : bool
        Accept a folder that has files in it (they stay; those of the same name are replaced one by one).

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    InputError
        If it has content and `force` is not given, a file stands in the way, or it cannot be written.
    """
    folder = Path(path)
    try:
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: a file stands where the output folder should be. Choose another folder.")
        if not force and folder.is_dir() and next(folder.iterdir(), None) is not None:
            raise InputError(f"{folder}: output folder is not empty. Choose another one, or write into it with --force.")
        folder.mkdir(parents=True, exist_ok=True)
        # Only an attempt tells: permissions, read-only media and quotas have nothing else in common.
        probe = folder / f".camcal-{os.urandom(8).hex()}.tmp"
        try:
            probe.touch()
        finally:
            probe.unlink(missing_ok=True)
    except OSError as error:
        raise _unwritable(folder, error) from None
    return folder


def claim_file(path: str | Path, force: bool = False) -> Path:
    """Make sure that a file may be written and nothing is lost by it; its folder is created.

    Raises
    ------
    InputError
        If the file exists and `force` is not given, it is a folder, or its folder cannot be written.
    """
    file = Path(path)
    try:
        if file.is_dir():
            raise InputError(f"{file}: a folder (expected a file to write). Add a file name.")
        if file.exists() and not force:
            raise InputError(f"{file}: output file exists. Choose another name, or replace it with --force.")
    except OSError as error:
        raise _unwritable(file, error) from None
    claim_folder(file.parent, force=True)
    return file


def claim_remade(path: str | Path, is_earlier: Callable[[bytes], bool], kind: str) -> Path:
    """Make sure that a file which is made again and again may be written: an earlier one is replaced, nothing else is.

    Parameters
    ----------
    path : str or Path
    is_earlier : callable
        Tells by its first bytes whether a file is an earlier one.
    kind : str
        What such a file is, for the message.

    Raises
    ------
    InputError
        If another file is there, it is a folder, or its folder cannot be written.
    """
    file = Path(path)
    try:
        if file.exists() and not file.is_dir() and not (file.is_file() and is_earlier(_first_bytes(file))):
            raise InputError(f"{file}: output file exists and is not {kind}. Choose another name, or remove it.")
    except OSError as error:
        raise _unwritable(file, error) from None
    return claim_file(file, force=True)


def _first_bytes(file: Path) -> bytes:
    with file.open("rb") as stream:
        return stream.read(_FIRST_BYTES)


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(f"{path}: cannot be written ({(error.strerror or str(error)).lower()}). Choose another place.")
