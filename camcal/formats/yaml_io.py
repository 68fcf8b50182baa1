"""YAML in: plain data that remembers its lines, from files that nobody vouches for.

Reading follows YAML's event stream rather than its composer, because that bounds nesting, aliases and size while the
file is still being read: no file, however hostile, takes long or much memory. Scalars resolve by YAML 1.2's core schema, so
that `1e-5` is a number and `on`, `12:30` and dates are text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

import yaml

from camcal.errors import InputError
from camcal.formats.text import read_text, shown

KeyPath: TypeAlias = tuple[str | int, ...]
"""Where a value stands: keys of mappings and indices of lists, from the root."""

_LONGEST_FILE_BYTES = 16_000_000
_MOST_NODES = 500_000
_DEEPEST_NESTING = 40

_INTEGER = re.compile(r"[-+]?[0-9]{1,30}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_WORDS: dict[str, Any] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN", ".Nan"), math.nan),
    **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
}
_TAG = "tag:yaml.org,2002:"
_TEXT_TAGS = ("!", _TAG + "str")
_VALUE_TAGS = (_TAG + "int", _TAG + "float", _TAG + "bool", _TAG + "null")
# OpenCV tags its matrices; beneath the tag they are ordinary mappings.
_COLLECTION_TAGS = (_TAG + "map", _TAG + "seq", _TAG + "opencv-matrix")
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True, slots=True)
class Document:
    """A YAML file as plain data that remembers its lines.

    Attributes
    ----------
    name : str
        The file as the user named it.
    data : dict
        Its content: dicts with text keys, lists, str, int, float, bool and None.
    lines : dict
        Line, counted from 1, of every key path.
    """

    name: str
    data: dict[str, Any]
    lines: Mapping[KeyPath, int]

    def line(self, path: KeyPath) -> int:
        """Line of a key path, or of the nearest thing around it that is in the file."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)

    def error(self, path: KeyPath, problem: str) -> InputError:
        """Build the error `file:line: key: problem`; for the root there is no key."""
        key = f"{format_path(path)}: " if path else ""
        return InputError(f"{self.name}:{self.line(path)}: {key}{problem}")


def format_path(path: KeyPath) -> str:
    """Write a key path for a person.

    Examples
    --------
    >>> format_path(("camera_matrix", "data", 3))
    'camera_matrix.data[3]'
    """
    parts = [f"[{step}]" if isinstance(step, int) else f".{step if _is_plain(step) else shown(step)}" for step in path]
    return "".join(parts).removeprefix(".")


def load_yaml(path: str | Path) -> Document:
    """Read a YAML file that holds one mapping.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Document

    Raises
    ------
    InputError
        If the file is missing, unreadable, too big, not text, empty, not valid YAML, not one document or not a mapping; if
        it has unknown tags, duplicate keys, keys that are not text, or nesting or aliases beyond what any such file needs.
    """
    return parse_yaml(str(path), read_text(path, _LONGEST_FILE_BYTES))


def parse_yaml(name: str, text: str) -> Document:
    """Read YAML text that holds one mapping.

    Parameters
    ----------
    name : str
        The file as the user named it.
    text : str

    Raises
    ------
    InputError
        As `load_yaml` does for the content of a file.
    """
    if len(text) > _LONGEST_FILE_BYTES:
        raise InputError(f"{name}: too big (got {len(text)} characters, expected at most {_LONGEST_FILE_BYTES})")
    # OpenCV 4 writes a directive that is no YAML, and does without the `---` that one asks for.
    text = re.sub(r"\A%YAML:1\.\d+", "#", text)
    unprintable = yaml.reader.Reader.NON_PRINTABLE.search(text)
    if unprintable:
        line = text.count("\n", 0, unprintable.start()) + 1
        raise InputError(f"{name}:{line}: not a text file (it has the character {shown(unprintable.group())})")
    composer = _Composer(name, yaml.parse(text, Loader=_LOADER))
    try:
        data = composer.document()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        raise InputError(f"{name}:{line}: not valid YAML ({error.problem or error.context}). Correct this line.") from None
    except yaml.YAMLError as error:
        raise InputError(f"{name}:1: not valid YAML ({' '.join(str(error).split())})") from None
    return Document(name, data, composer.lines)


class _Composer:
    """Builds plain data from YAML's events, counting as it goes."""

    def __init__(self, name: str, events: Iterable[yaml.Event]) -> None:
        self.name = name
        self.events = iter(events)
        self.lines: dict[KeyPath, int] = {}
        self.nodes = 0
        # Value and number of nodes of each anchored value that is complete.
        self.anchors: dict[str, tuple[Any, int]] = {}

    def document(self) -> dict[str, Any]:
        """Return the only document of the stream, a mapping."""
        next(self.events)
        if isinstance(next(self.events), yaml.StreamEndEvent):
            raise InputError(f"{self.name}: empty file (expected YAML). Write it again.")
        root = next(self.events)
        data = self.value(root, ())
        next(self.events)
        # ROS ends what it echoes with `---`, after which nothing follows.
        while not isinstance(following := next(self.events), yaml.StreamEndEvent):
            if not _is_nothing(next(self.events)):
                self.fail(following, (), "a second document (expected one). Keep one and remove the `---` between them.")
            next(self.events)
        if not isinstance(data, dict):
            self.fail(root, (), f"not a mapping (got {describe(data)}, expected `key: value` lines)")
        return data

    def value(self, event: yaml.Event, path: KeyPath) -> Any:
        """Return the value that starts with an event."""
        self.lines.setdefault(path, _line(event))
        before = self.nodes
        self.count(event, path, 1)
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self.anchors:
                self.fail(event, path, f"alias *{event.anchor} (no value before it is complete and has that anchor)")
            value, size = self.anchors[event.anchor]
            self.count(event, path, size)
            return value
        if isinstance(event, yaml.ScalarEvent):
            value = self.scalar(event, path)
        elif isinstance(event, yaml.SequenceStartEvent):
            value = self.sequence(event, path)
        else:
            value = self.mapping(event, path)
        if isinstance(event, yaml.NodeEvent) and event.anchor is not None:
            self.anchors[event.anchor] = (value, self.nodes - before)
        return value

    def scalar(self, event: yaml.ScalarEvent, path: KeyPath) -> Any:
        """Return text, or what plain text stands for."""
        if event.tag in _TEXT_TAGS or (event.tag is None and not event.implicit[0]):
            return event.value
        if event.tag is not None and event.tag not in _VALUE_TAGS:
            self.refuse_tag(event, path)
        return resolve(event.value)

    def sequence(self, event: yaml.SequenceStartEvent, path: KeyPath) -> list[Any]:
        """Return a list."""
        self.check_collection(event, path)
        items: list[Any] = []
        while not isinstance(item := next(self.events), yaml.SequenceEndEvent):
            items.append(self.value(item, (*path, len(items))))
        return items

    def mapping(self, event: yaml.Event, path: KeyPath) -> dict[str, Any]:
        """Return a mapping; its keys are text as written."""
        self.check_collection(event, path)
        entries: dict[str, Any] = {}
        while not isinstance(key := next(self.events), yaml.MappingEndEvent):
            if not isinstance(key, yaml.ScalarEvent):
                self.fail(key, path, "a key that is not plain text (expected `key: value`). A value with { or [ needs quotes.")
            if key.tag is not None and key.tag not in (*_TEXT_TAGS, *_VALUE_TAGS):
                self.refuse_tag(key, path)
            place = (*path, key.value)
            if key.value in entries:
                first = self.lines[place]
                self.fail(key, place, f"duplicate key (it is on line {first} already). Remove one of the two.")
            self.count(key, path, 1)
            self.lines[place] = _line(key)
            entries[key.value] = self.value(next(self.events), place)
        return entries

    def check_collection(self, event: Any, path: KeyPath) -> None:
        """Refuse unknown tags and bottomless nesting."""
        if event.tag is not None and event.tag not in _COLLECTION_TAGS:
            self.refuse_tag(event, path)
        if len(path) > _DEEPEST_NESTING:
            self.fail(event, path[:1], f"nested too deeply (more than {_DEEPEST_NESTING} levels)")

    def count(self, event: yaml.Event, path: KeyPath, nodes: int) -> None:
        """Count values, those behind aliases each time, and refuse a file with absurdly many."""
        self.nodes += nodes
        if self.nodes > _MOST_NODES:
            self.fail(event, path[:1], f"too many values (more than {_MOST_NODES}, aliases written out)")

    def refuse_tag(self, event: Any, path: KeyPath) -> NoReturn:
        """Raise for a tag that asks for more than plain data."""
        tag = event.tag.removeprefix(_TAG)
        name = f"!!{tag}" if tag != event.tag else tag
        self.fail(event, path, f"unsupported tag (got {shown(name)}, expected plain values). Remove the tag.")

    def fail(self, event: yaml.Event, path: KeyPath, problem: str) -> NoReturn:
        """Raise for something at an event."""
        raise Document(self.name, {}, {path: _line(event)}).error(path, problem)


def resolve(text: str) -> Any:
    """Return what a plain scalar stands for by YAML 1.2's core schema (decimal numbers only).

    Examples
    --------
    >>> resolve("1e-5"), resolve("007"), resolve("9x6"), resolve("no"), resolve("null")
    (1e-05, 7, '9x6', 'no', None)
    """
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    return float(text) if _FLOAT.fullmatch(text) else text


def describe(value: Any) -> str:
    """Describe a value in an error message: collections by their kind, as they can be endless."""
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return f"a list of {len(value)}"
    return "nothing" if value is None else shown(value)


def _line(event: yaml.Event) -> int:
    """Line, counted from 1, that an event starts on."""
    return event.start_mark.line + 1 if event.start_mark else 1


def _is_nothing(event: yaml.Event) -> bool:
    """Whether a document that begins with an event is empty."""
    return isinstance(event, yaml.ScalarEvent) and not (event.value or event.style)


def _is_plain(key: str) -> bool:
    """Whether a key can be shown as it stands."""
    return len(key) <= 60 and key.isprintable()
