"""The images and videos that `undistort` is to work on, and the name that each result gets."""

from __future__ import annotations

import codecs
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import TypeAlias

from camcal.errors import InputError
from camcal.formats.images import EXTENSIONS
from camcal.formats.imaging.unread import UNREAD, advice_for
from camcal.formats.ledger_file import LEDGER_NAME
from camcal.formats.text import unreadable
from camcal.observations import Rejected

WRITTEN_VIDEOS = (".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".ts", ".mts", ".m2ts")
"""Extensions of the videos that are written."""

VIDEOS = frozenset((*WRITTEN_VIDEOS, ".mpg", ".mpeg", ".wmv", ".flv", ".3gp", ".ogv", ".mxf", ".vob"))
"""Extensions, in lower case, of files that count as videos."""

COMPANIONS = ("mask.png", "maps.tiff")
"""Images among what is written beside the results."""

# A path, the folder below which its name is kept, and whether the user named it.
_Found: TypeAlias = tuple[Path, Path, bool]


@dataclass(frozen=True, slots=True)
class Source:
    """A file to work on.

    Attributes
    ----------
    path : Path
    name : str
        Of its result, below the output folder, with forward slashes.
    named : bool
        Whether the user named this very file; else a folder, a pattern or a list held it.
    """

    path: Path
    name: str
    named: bool = False

    @property
    def is_video(self) -> bool:
        """Whether its extension is a video's."""
        return is_video(self.path)


@dataclass(frozen=True, slots=True, eq=False)
class Sources:
    """What `find_sources` found.

    Attributes
    ----------
    files : tuple of Source
        Sorted by name, each file once.
    others : tuple of Path
        Files that are neither images nor videos.
    unreadable : tuple of Rejected
        Folders that could not be looked into, and entries of a list that are not there.
    results : tuple of Path
        Folders of results of earlier runs, not looked into.
    """

    files: tuple[Source, ...]
    others: tuple[Path, ...] = ()
    unreadable: tuple[Rejected, ...] = ()
    results: tuple[Path, ...] = ()


def is_video(path: PurePath) -> bool:
    """Tell whether a file name is a video's."""
    return path.suffix.lower() in VIDEOS


def find_sources(
    inputs: Sequence[str | Path],
    *,
    listed: Iterable[str | Path] = (),
    recursive: bool = False,
    without: Path | None = None,
    extension: str | None = None,
) -> Sources:
    """Find the images and videos that the user asks for.

    Parameters
    ----------
    inputs : sequence of str or Path
        Files, which must be images or videos; folders; and patterns such as `img_*.png`.
    listed : iterable of str or Path
        More of them from a list, where a file that cannot be used is reported in the end.
    recursive : bool
        Whether folders within folders are looked into.
    without : Path, optional
        A folder that is not looked into: where the results go.
    extension : str, optional
        That the results get, of the files of its kind.

    Raises
    ------
    InputError
        If a named file is missing or neither image nor video, or an input yields nothing.
    """
    search = _Search(recursive, None if without is None else os.path.realpath(without))
    for given in inputs:
        search.add(given)
    for given in listed:
        search.add_listed(given)
    found = list(search.found.values())
    if not found and not search.unreadable:
        others = f" (but {search.others[0]})" if search.others else ""
        raise InputError(f"undistort: no images or videos given{others}. Name some, or a folder that holds some.")
    named = _with_names(found, extension)
    return Sources(
        tuple(sorted(named, key=lambda source: source.name)),
        tuple(sorted(set(search.others))),
        tuple(search.unreadable),
        tuple(search.results),
    )


def read_list(content: bytes) -> tuple[str, ...]:
    """Read a list of paths: one per line, or separated by NUL as `find -print0` writes them.

    What editors leave does not count: a byte order mark, and blanks behind a name that no file has with them.
    """
    if b"\0" in content:
        return tuple(os.fsdecode(part) for part in content.split(b"\0") if part)
    lines = map(os.fsdecode, content.removeprefix(codecs.BOM_UTF8).splitlines())
    return tuple(filter(None, (line if os.path.lexists(line) else line.rstrip(" \t") for line in lines)))


class _Search:
    """Gathers files, each once; its place in `found` is its real path, so that links do not count twice."""

    def __init__(self, recursive: bool, without: str | None) -> None:
        self.recursive = recursive
        self.without = without
        self.found: dict[str, _Found] = {}
        self.others: list[Path] = []
        self.unreadable: list[Rejected] = []
        self.results: list[Path] = []

    def add(self, given: str | Path) -> None:
        """Add what one input stands for; it must stand for something."""
        path = Path(given)
        try:
            if path.is_dir():
                self._add_folder(path, must_hold=True)
            elif not path.exists() and any(mark in str(given) for mark in "*?["):
                self._add_pattern(str(given))
            else:
                self._add_named(path)
        except OSError as error:
            raise unreadable(path, error) from None

    def add_listed(self, given: str | Path) -> None:
        """Add an entry of a list, whatever it turns out to be."""
        path = Path(given)
        try:
            if path.is_dir():
                self._add_folder(path, must_hold=False)
            elif not path.exists():
                self.unreadable.append(Rejected(str(path), "no such file. Check the path."))
            elif _is_special(path):
                self.others.append(path)
            else:
                self._add_found(path, path.parent)
        except OSError as error:
            self._reject(path, error)

    def _add_named(self, path: Path) -> None:
        if not path.exists():
            raise InputError(f"{path}: no such file. Check the path.")
        if path.suffix.lower() in UNREAD:
            raise InputError(f"{path}: an image of a format that is not read (got '{path.suffix}'). {advice_for(path)}")
        if path.suffix.lower() not in EXTENSIONS | VIDEOS:
            kinds = "an image or a video such as .png, .jpg, .tif or .mp4"
            raise InputError(f"{path}: neither image nor video (got '{path.suffix}', expected {kinds}).")
        if _is_special(path):
            raise InputError(f"{path}: a device or pipe (expected a file). Name a file.")
        self._keep(path, path.parent, named=True)

    def _add_pattern(self, pattern: str) -> None:
        # Few commands have patterns that the shell has left alone.
        import glob

        matches = [Path(match) for match in glob.iglob(pattern, recursive=True)]  # noqa: PTH207 - may be absolute
        before = len(self.found)
        for match in matches:
            if match.is_file():
                self._add_found(match, match.parent)
        if len(self.found) == before and not any(map(_counts, matches)):
            raise InputError(f"{pattern}: no image or video matches this pattern ({len(matches)} other files do). Check it.")

    def _add_folder(self, folder: Path, *, must_hold: bool) -> None:
        held = 0
        subfolders: list[Path] = []
        for path in self._files_below(folder, subfolders):
            held += self._add_found(path, folder)
        if must_hold and not held and not self.unreadable:
            below = next((sub.name for sub in subfolders if any(map(_counts, _listing(sub)))), None)
            unread = next((path for path in self.others if path.suffix.lower() in UNREAD), None)
            hint, advice = "it holds none", "Name one that does."
            if below and not self.recursive:
                hint, advice = f"but there are some in {below}/", "Look into its folders with --recursive."
            elif unread:
                hint, advice = f"but {unread.name}, of a format that is not read", advice_for(unread)
            raise InputError(f"{folder}: no images or videos in this folder ({hint}). {advice}")

    def _files_below(self, folder: Path, subfolders: list[Path]) -> Iterator[Path]:
        """Files of a folder and, if asked for, of all folders within, links followed once; hidden ones are others'.

        A folder of results within would be undistorted twice.
        """
        seen = {os.path.realpath(folder)}
        waiting = [folder]
        while waiting:
            current = waiting.pop()
            try:
                entries = sorted(os.scandir(current), key=lambda entry: entry.name)
            except OSError as error:
                if current == folder:
                    raise
                self._reject(current, error)
                continue
            written_here = any(entry.name == LEDGER_NAME for entry in entries)
            if written_here and current != folder:
                self.results.append(current)
                continue
            for entry in entries:
                path = current / entry.name
                if entry.is_dir():
                    if entry.name.startswith("."):
                        continue
                    subfolders.append(path)
                    real = os.path.realpath(path)
                    if self.recursive and real not in seen and real != self.without:
                        seen.add(real)
                        waiting.append(path)
                elif (written_here and entry.name in COMPANIONS) or _is_special(path):
                    self.others.append(path)
                else:
                    yield path

    def _add_found(self, path: Path, root: Path) -> bool:
        """Add a file that nobody named; tell whether it is an image or a video."""
        if not _counts(path):
            self.others.append(path)
            return False
        self._keep(path, root, named=False)
        return True

    def _keep(self, path: Path, root: Path, *, named: bool) -> None:
        key = os.path.realpath(path)
        earlier = self.found.get(key)
        if earlier is None:
            self.found[key] = (path, root, named)
        elif named:
            self.found[key] = (*earlier[:2], True)

    def _reject(self, path: Path, error: OSError) -> None:
        self.unreadable.append(Rejected(str(path), f"cannot be read ({(error.strerror or str(error)).lower()})"))


def _counts(path: Path) -> bool:
    """Tell whether a file in a folder is to be worked on; hidden files are other programs' (thumbnails, resource forks)."""
    return path.suffix.lower() in EXTENSIONS | VIDEOS and not path.name.startswith(".")


def _is_special(path: Path) -> bool:
    """Tell whether a path is a device or a pipe, on which reading may wait forever; a link that leads nowhere is not."""
    return path.exists() and not path.is_file()


def _listing(folder: Path) -> list[Path]:
    """Entries of a folder; none if it cannot be read."""
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def _with_names(found: Sequence[_Found], extension: str | None) -> list[Source]:
    """Name the results as their sources; where two would be one, by the paths below the folder common to all."""
    names = [_renamed(path.relative_to(root), extension) for path, root, _ in found]
    if len(set(names)) < len(names):
        absolute = [os.path.abspath(path) for path, _, _ in found]  # noqa: PTH100 - lexical: links stay as the user named them
        common = os.path.commonpath([os.path.dirname(path) for path in absolute])  # noqa: PTH120
        names = [_renamed(PurePath(os.path.relpath(path, common)), extension) for path in absolute]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        first, second, *_ = (path for (path, _, _), name in zip(found, names, strict=True) if name == twice[0])
        raise InputError(f"{second}: its result would replace that of {first} (both {twice[0]}). Rename one of them.")
    return [Source(path, name, named) for (path, _, named), name in zip(found, names, strict=True)]


def _renamed(name: PurePath, extension: str | None) -> str:
    """Return a name with another extension, if that is one for its kind of file."""
    if extension is not None and is_video(name) == (extension.lower() in VIDEOS):
        name = name.with_suffix(extension)
    return name.as_posix()
