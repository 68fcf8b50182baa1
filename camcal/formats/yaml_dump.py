"""YAML out: one dialect that PyYAML, cv2.FileStorage and ROS all load as it stands."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

import yaml

_TEXT_TAG = "tag:yaml.org,2002:str"
_LIST_TAG = "tag:yaml.org,2002:seq"


class _Key(str):
    """A mapping's key, written without quotes."""

    __slots__ = ()


class _Dumper(yaml.SafeDumper):
    """PyYAML's emitter, held to what cv2.FileStorage parses: quoted text, lists indented under their key, no aliases."""

    def increase_indent(self, flow: bool = False, indentless: bool = False) -> None:  # noqa: ARG002 - PyYAML's signature
        super().increase_indent(flow, False)

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True

    def represent_text(self, text: str) -> yaml.ScalarNode:
        # In double quotes PyYAML writes characters beyond the basic plane as escapes that FileStorage does not know.
        astral = any(character > "\uffff" for character in text) and len(text.splitlines()) == 1
        return self.represent_scalar(_TEXT_TAG, text, style="'" if astral else '"')

    def represent_key(self, key: _Key) -> yaml.ScalarNode:
        return self.represent_scalar(_TEXT_TAG, str(key))

    def represent_items(self, items: list[Any]) -> yaml.SequenceNode:
        return self.represent_sequence(_LIST_TAG, items, flow_style=not any(isinstance(item, dict) for item in items))


_Dumper.add_representer(str, _Dumper.represent_text)
_Dumper.add_representer(_Key, _Dumper.represent_key)
_Dumper.add_representer(list, _Dumper.represent_items)


def dump_yaml(mapping: Mapping[str, Any], heading: str = "") -> str:
    """Write a mapping as YAML that PyYAML, cv2.FileStorage and ROS load as it stands.

    Parameters
    ----------
    mapping : mapping
        Keys are identifiers; values are mappings, lists or tuples, str, int, float, bool and None. Lists without mappings
        in them stay on one line.
    heading : str
        Comment lines for people, below the header.

    Returns
    -------
    str
        Every float reads back bit for bit.
    """
    text: str = yaml.dump(
        _prepared(mapping),
        Dumper=_Dumper,
        version=(1, 2),
        explicit_start=True,
        default_flow_style=False,
        sort_keys=False,
        allow_unicode=True,
        width=math.inf,
    )
    comment = "".join(f"# {line}\n" for line in heading.splitlines())
    return text.replace("---\n", f"---\n{comment}", 1)


def _prepared(value: Any) -> Any:
    """Copy a value with its keys checked and marked, and its tuples as lists."""
    if isinstance(value, Mapping):
        if not all(isinstance(key, str) and re.fullmatch(r"[A-Za-z_]\w*", key, re.ASCII) for key in value):
            raise ValueError(f"keys must be identifiers (got {list(value)})")
        return {_Key(key): _prepared(item) for key, item in value.items()}
    return [_prepared(item) for item in value] if isinstance(value, (list, tuple)) else value
