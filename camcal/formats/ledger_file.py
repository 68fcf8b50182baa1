"""The ledger of a folder of undistorted files: one line for each that is finished, so that a later run can go on from there.

A line is appended once a result has its name. A run that was killed leaves at most a result without a line, which is made
again, or a torn line, which counts as none. What is written beside the results and made from no file, such as a mask, has a
line without an input.
"""

from __future__ import annotations

import csv
import errno
import io
import os
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from camcal.errors import InputError

LEDGER_NAME = "undistorted.csv"

_Entry: TypeAlias = tuple[str, "Stamp", "Stamp", str]
"""What a result was made from, that file as it was, the result as it is, and the settings."""

_NO_SOURCE = ""

_LONGEST_LINE = 20_000
_HEADER = ("input", "input_size", "input_mtime_ns", "output", "output_size", "output_mtime_ns", "settings")


@dataclass(frozen=True, slots=True)
class Stamp:
    """What tells a version of a file from others.

    Attributes
    ----------
    size : int
        Bytes.
    mtime_ns : int
        When it was written, nanoseconds.
    """

    size: int
    mtime_ns: int

    @classmethod
    def of(cls, path: str | Path) -> Stamp | None:
        """Look at a file; None if there is none, or it is not to be seen."""
        try:
            status = os.stat(path)  # noqa: PTH116 - of a str, too
        except OSError:
            return None
        return cls(status.st_size, status.st_mtime_ns)


class Ledger:
    """The ledger of one output folder; for any number of threads.

    Parameters
    ----------
    folder : Path
        It need not exist before `begin`.

    Raises
    ------
    InputError
        If there is a ledger that cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._path = folder / LEDGER_NAME
        self._lock = threading.Lock()
        self._entries = read_ledger(folder)
        self._is_torn = False

    @contextmanager
    def held(self) -> Iterator[None]:
        """Keep other runs out of the folder while the block runs, where the system has locks; a killed process gives it back.

        Two of them would remove each other's unfinished files, and only one camera can stand beside the results.

        Raises
        ------
        InputError
            If another run is at work there, or the ledger cannot be written.
        """
        try:
            file = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        except OSError as error:
            raise self._unwritable(error) from error
        try:
            if not _locked(file):
                raise InputError(
                    f"{self._folder}: another run is writing into this folder. Wait for it to end, or choose another folder."
                )
            yield
        finally:
            os.close(file)

    def begin(self) -> None:
        """Make the ledger ready for lines; its presence says that a run has begun.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        stamp = Stamp.of(self._path)
        if stamp is not None and stamp.size:
            self._is_torn = not _ends_with_line(self._path)
        else:
            self._append(_HEADER)

    def add(self, source: Path, name: str, read: Stamp, settings: str) -> None:
        """Note that a result is finished.

        Parameters
        ----------
        source : Path
        name : str
            Of the result, below the folder.
        read : Stamp
            Of the source, taken before it was read.
        settings : str
            What the result depends on beside the source.

        Raises
        ------
        InputError
            If the ledger cannot be written.
        """
        self._add(os.path.abspath(source), name, read, settings)  # noqa: PTH100

    def add_companion(self, name: str, settings: str) -> None:
        """Note that a file beside the results, which is made from none, is written with some settings.

        Raises
        ------
        InputError
            If the ledger cannot be written.
        """
        self._add(_NO_SOURCE, name, Stamp(0, 0), settings)

    def companion_settings(self, name: str) -> str | None:
        """Return the settings that a file beside the results was written with; None if it is not there untouched."""
        source, _, written, settings = self._entries.get(name, (None, None, None, None))
        return settings if source == _NO_SOURCE and written == Stamp.of(self._folder / name) else None

    def withdraw(self) -> bool:
        """Remove the ledger if nothing was ever noted in it; tell whether that was so."""
        with suppress(OSError):
            if self._path.read_bytes() in {b"", _line(_HEADER).encode()}:
                self._path.unlink()
                return True
        return False

    def is_done(self, source: Path, name: str, settings: str) -> bool:
        """Tell whether a result is there, untouched, made from this very source with these settings."""
        expected = (os.path.abspath(source), Stamp.of(source), Stamp.of(self._folder / name), settings)  # noqa: PTH100
        return self._entries.get(name) == expected

    def left_over(self, names: set[str], settings: set[str]) -> list[str]:
        """Names of results that are still there, were made with other settings, and are not among those given."""
        return sorted(
            name
            for name, (source, _, written, made_with) in self._entries.items()
            if source != _NO_SOURCE
            and name not in names
            and made_with not in settings
            and written == Stamp.of(self._folder / name)
        )

    def _add(self, source: str, name: str, read: Stamp, settings: str) -> None:
        written = Stamp.of(self._folder / name)
        if written is not None:
            self._append((source, read.size, read.mtime_ns, name, written.size, written.mtime_ns, settings))

    def _append(self, cells: tuple[object, ...]) -> None:
        with self._lock:
            # What was torn stays on a line of its own.
            content = (("\n" if self._is_torn else "") + _line(cells)).encode("utf-8", "surrogateescape")
            self._is_torn = True
            try:
                file = os.open(self._path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
                try:
                    if os.write(file, content) < len(content):
                        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
                finally:
                    os.close(file)
                self._is_torn = False
            except OSError as error:
                raise self._unwritable(error) from error

    def _unwritable(self, error: OSError) -> InputError:
        return InputError(f"{self._path}: cannot be written ({(error.strerror or str(error)).lower()}). Choose another place.")


def _line(cells: tuple[object, ...]) -> str:
    """Write cells as a line."""
    line = io.StringIO(newline="")
    csv.writer(line, lineterminator="\n").writerow(cells)
    return line.getvalue()


def _locked(file: int) -> bool:
    """Lock an open file until it is closed; false if another process has done so. Some systems and shares have no locks."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        return error.errno != errno.EACCES
    return True


def read_ledger(folder: Path) -> dict[str, _Entry]:
    """Read what is finished in a folder, by the names of the results; nothing if there is no ledger.

    Raises
    ------
    InputError
        If there is one that cannot be read.
    """
    path = folder / LEDGER_NAME
    try:
        content = path.read_bytes() if os.path.exists(path) else b""  # noqa: PTH110 - false where nobody may look
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({(error.strerror or str(error)).lower()}). Remove it.") from None
    return dict(_entries(content.decode("utf-8", "surrogateescape").split("\n")))


def _entries(lines: Iterable[str]) -> Iterator[tuple[str, _Entry]]:
    """Read what can be read; a name with line breaks in it goes over several lines."""
    begun = ""
    for line in lines:
        named = _parsed(line)
        if named is None and begun:
            line = f"{begun}\n{line}"  # noqa: PLW2901
            named = _parsed(line)
        if named is not None:
            yield named
        begun = line if named is None and len(line) < _LONGEST_LINE else ""


def _parsed(line: str) -> tuple[str, _Entry] | None:
    """Read one line; None if it is torn or none of ours."""
    try:
        [cells] = csv.reader([line], strict=True)
        source, size, mtime, name, new_size, new_mtime, settings = cells
        return name, (source, Stamp(int(size), int(mtime)), Stamp(int(new_size), int(new_mtime)), settings)
    except (csv.Error, ValueError):
        return None


def _ends_with_line(path: Path) -> bool:
    """Tell whether a file ends with a whole line."""
    with path.open("rb") as file:
        file.seek(0, os.SEEK_END)
        if file.tell() == 0:
            return True
        file.seek(-1, os.SEEK_END)
        return file.read(1) == b"\n"
