"""JSON in: plain data that remembers its lines."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn

from camcal.errors import InputError
from camcal.formats.yaml_io import Document, KeyPath, describe

_COMMENT_LINE = re.compile(r"^\s*//[^\n]*$", re.MULTILINE)


class _Lines(Mapping[KeyPath, int]):
    """Lines of key paths, looked for when one is asked for: only faults need them."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __getitem__(self, path: KeyPath) -> int:
        place = 0
        for step in path:
            if isinstance(step, str):
                # Keys that enclose one another stand in this order; JSON escapes what is not ASCII, or does not.
                found = [self._text.find(f"{json.dumps(step, ensure_ascii=plain)}", place) for plain in (False, True)]
                place = max(found)
                if place < 0:
                    raise KeyError(path)
        return self._text.count("\n", 0, place) + 1

    def __iter__(self) -> Iterator[KeyPath]:
        return iter(())

    def __len__(self) -> int:
        return 0


def parse_json(name: str, text: str) -> Document:
    """Read JSON that holds one object; whole lines of `//` comments, which OpenCV writes, are passed over.

    Parameters
    ----------
    name : str
        The file as the user named it.
    text : str

    Returns
    -------
    Document

    Raises
    ------
    InputError
        If it is not valid JSON, is nested absurdly, has a key twice, or is not an object.
    """
    text = _COMMENT_LINE.sub("", text)
    document = Document(name, {}, _Lines(text))

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = dict(pairs)
        if len(keys) != len(pairs):
            twice = next(key for index, (key, _) in enumerate(pairs) if key in dict(pairs[:index]))
            raise document.error((twice,), "duplicate key. Remove one of the two.")
        return keys

    def no_number(word: str) -> NoReturn:
        line = text.count("\n", 0, text.find(word)) + 1
        raise InputError(f"{name}:{line}: not valid JSON (got {word}, expected a finite number)")

    try:
        data = json.loads(text, object_pairs_hook=unique, parse_constant=no_number)
    except json.JSONDecodeError as error:
        raise InputError(f"{name}:{error.lineno}: not valid JSON ({error.msg}). Correct this line.") from None
    except (RecursionError, ValueError):
        raise InputError(f"{name}:1: not valid JSON (nested too deeply, or a number with too many digits)") from None
    if not isinstance(data, dict):
        raise InputError(f"{name}:1: not an object (got {describe(data)}, expected {{...}})")
    return Document(name, data, document.lines)
