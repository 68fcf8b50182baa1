"""A camera file of unknown kind, taken apart as far as its syntax goes."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from camcal.errors import InputError
from camcal.formats.exchange.json_in import parse_json
from camcal.formats.exchange.xml_in import Element, parse_xml
from camcal.formats.text import STANDARD_INPUT, decoded, read_bytes, read_standard_input
from camcal.formats.yaml_io import Document, KeyPath, describe, parse_yaml

MOST_BYTES = 64_000_000
_PROBE_BYTES = 4096

_YAML_SUFFIXES = (".yaml", ".yml", "")

Syntax = Literal["yaml", "json", "xml", "python", "script", "lines", "binary", "text"]
# Python writes keys in single quotes and may have comments; JSON has neither.
_PYTHON = re.compile(r"\{\s*(#[^\n]*\n\s*)*'")
_SCRIPT = re.compile(r"\b(cameraIntrinsics|cameraParameters)\s*\(")
_TABLE_LINE = re.compile(r"\d+\s+[A-Z][A-Z0-9_]+\s+\d+\s+\d+")
_COMMENTS = re.compile(r"(?:\s*[#%][^\n]*(?:\n|\Z))*\s*")


@dataclass(frozen=True, slots=True)
class Loaded:
    """A file by its syntax.

    Attributes
    ----------
    name : str
        As the user named it.
    syntax : str
        yaml, json, xml, python (a dict as Python writes it), script (MATLAB's), lines (a table in text), binary, or
        text if it is none of them.
    content : bytes
    text : str
        Empty for a binary file.
    document : Document
        Content of yaml, json and python files; empty for the others.
    root : Element or None
        Root of an xml file.
    """

    name: str
    syntax: Syntax
    content: bytes
    text: str
    document: Document
    root: Element | None = None

    @property
    def data(self) -> dict[str, Any]:
        """The document's content."""
        return self.document.data


def load_file(path: str | Path) -> Loaded:
    """Read a file and find out its syntax.

    Raises
    ------
    InputError
        If it cannot be read or is not valid for what it seems to be; says `file:line` where there are lines.
    """
    return _taken_apart(str(path), read_bytes(path, MOST_BYTES))


def load_standard_input() -> Loaded:
    """Read what is piped into the program and find out its syntax.

    Raises
    ------
    InputError
        As `load_file` does.
    """
    return _taken_apart(STANDARD_INPUT, read_standard_input(MOST_BYTES))


def _taken_apart(name: str, content: bytes) -> Loaded:
    """Find out the syntax of a file's content."""
    empty = Document(name, {}, {})
    if b"\0" in content[:_PROBE_BYTES]:
        return Loaded(name, "binary", content, "", empty)
    text = decoded(name, content)
    start = _COMMENTS.sub("", text, count=1)
    if start.startswith("<"):
        return Loaded(name, "xml", content, text, empty, parse_xml(name, text.encode()))
    if start.startswith("{") and not re.match(r"\{\s*\w", start):
        if _PYTHON.match(start) or text.lstrip().startswith("#"):
            return Loaded(name, "python", content, text, _parse_python(name, text))
        return Loaded(name, "json", content, text, parse_json(name, text))
    if _TABLE_LINE.match(start) or _SCRIPT.search(text):
        return Loaded(name, "lines" if _TABLE_LINE.match(start) else "script", content, text, empty)
    document = _parse_yaml(name, text)
    return Loaded(name, "text" if document is None else "yaml", content, text, document or empty)


def _parse_yaml(name: str, text: str) -> Document | None:
    """Read YAML; None if the file is none and its name does not say that it is."""
    try:
        return parse_yaml(name, text)
    except InputError:
        # A text that was never meant to be YAML has no line to correct.
        if Path(name).suffix.lower() in _YAML_SUFFIXES:
            raise
    return None


def _parse_python(name: str, text: str) -> Document:
    """Read a dict as Python writes it; nothing in it is run."""
    try:
        data = ast.literal_eval(text.strip())
    except SyntaxError as error:
        raise InputError(f"{name}:{error.lineno or 1}: not a Python dict ({error.msg}). Correct this line.") from None
    except (ValueError, TypeError, MemoryError, RecursionError):
        raise InputError(f"{name}:1: not a dict of plain values (expected only text, numbers and lists of them)") from None
    if not isinstance(data, dict) or not all(isinstance(key, str) for key in data):
        raise InputError(f"{name}:1: not a Python dict with text for keys (got {describe(data)})")
    lines: dict[KeyPath, int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        match = re.match(r"\s*\{?\s*['\"](\w+)['\"]\s*:", line)
        if match:
            lines.setdefault((match[1],), number)
    return Document(name, data, lines)
