"""The plain part of the YAML that `dump_yaml` writes, written without PyYAML: its import takes longer than a small image."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

_LONGEST_KEY = 64
# Keys that stand for something else unless they are quoted.
_WORDS = {"yes", "no", "on", "off", "true", "false", "null"}


class _NotPlainError(Exception):
    """A value that needs PyYAML."""


def plain_yaml(mapping: Mapping[str, Any], heading: str = "") -> str | None:
    """Write a mapping exactly as `dump_yaml` does.

    Parameters
    ----------
    mapping : mapping
    heading : str
        Comment lines for people.

    Returns
    -------
    str or None
        None if there is more in the mapping than numbers, ASCII text that needs no escapes, and lists and mappings of these.
    """
    if not mapping:
        return None
    try:
        lines = _block(mapping, "")
    except _NotPlainError:
        return None
    comments = [f"# {line}" for line in heading.splitlines()]
    return "\n".join(["%YAML 1.2", "---", *comments, *lines, ""])


def _block(mapping: Mapping[str, Any], indent: str) -> list[str]:
    """Write the lines of a mapping."""
    lines: list[str] = []
    for key, value in mapping.items():
        if not key.isidentifier() or not key.isascii() or len(key) > _LONGEST_KEY or key.lower() in _WORDS:
            raise _NotPlainError
        start = f"{indent}{key}:"
        inner = indent + "  "
        if isinstance(value, Mapping) and value:
            lines += [start, *_block(value, inner)]
        elif isinstance(value, (list, tuple)) and any(isinstance(item, Mapping) for item in value):
            lines.append(start)
            for item in value:
                if not isinstance(item, Mapping) or not item:
                    raise _NotPlainError
                first, *others = _block(item, inner + "  ")
                lines += [f"{inner}- {first.lstrip()}", *others]
        else:
            lines.append(f"{start} {_flow(value)}")
    return lines


def _flow(value: Any) -> str:
    """Write a value on one line."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_flow, value))}]"
    if isinstance(value, Mapping):
        if value:
            raise _NotPlainError
        return "{}"
    return _scalar(value)


def _scalar(value: Any) -> str:
    """Write text, a number, or one of the words for neither."""
    if value is None:
        return "null"
    if type(value) is bool:
        return str(value).lower()
    if type(value) is int:
        return str(value)
    if type(value) is float:
        return float_text(value)
    if type(value) is not str or not value.isascii() or not value.isprintable() or '"' in value or "\\" in value:
        raise _NotPlainError
    return f'"{value}"'


def float_text(value: float) -> str:
    """Write a float as PyYAML does: with a point, which YAML demands of a number with an exponent."""
    if math.isnan(value):
        return ".nan"
    if math.isinf(value):
        return ".inf" if value > 0 else "-.inf"
    text = repr(value)
    return text if "." in text else text.replace("e", ".0e")
