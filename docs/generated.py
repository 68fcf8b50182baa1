"""Write the parts of the documentation that are read off the code: the keys of each file, formats, and what is shipped."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from camcal.formats.exchange.table import FORMATS
from camcal.formats.scenario_file import load_scenario
from camcal.resources import config_names, config_path, sample_board_names
from camcal.workflows.schema import schema

Schema = dict[str, Any]

PARTS = {
    "camera": ("CameraFile",),
    "views": ("ViewsFile",),
    "board": ("CheckerboardFile", "AprilGridFile"),
    "synth": ("ScenarioFile",),
}
"""By kind of file, the definitions of its schema that describe a whole one."""

_KINDS = {"object": "mapping", "array": "list", "integer": "whole number", "string": "text", "boolean": "yes or no"}
_LIMITS = {"minimum": "at least", "exclusiveMinimum": "more than", "maximum": "at most", "exclusiveMaximum": "less than"}


_FAR = 1e5
"""A limit beyond this only keeps nonsense out, and is not worth a word."""


def main(folder: Path) -> None:
    """Write every part to a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = {kind: "\n\n".join(key_tables(kind)) for kind in PARTS}
    parts["formats"] = format_table()
    parts["scenarios"] = scenario_table()
    parts["boards"] = ", ".join(f"`{name}`" for name in sample_board_names()) + "."
    for name, text in parts.items():
        (folder / f"{name}.md").write_text(text + "\n", encoding="utf-8")


def table(*rows: tuple[str, ...]) -> str:
    """Lay out rows, the heading first."""
    heading, *others = rows
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |"
        for row in (heading, ("---",) * len(heading), *others)
    )


def format_table() -> str:
    """Table of the formats that cameras are exchanged in."""
    rows = [("`--to`", "what it is", "files", "coefficients", "skew")]
    for name, kind in FORMATS.items():
        profile = kind.profile
        lens = ", ".join(profile.lenses[-1]) + (" (fx = fy)" if profile.one_focal else "")
        rows.append((f"`{name}`", profile.title, ", ".join(profile.suffixes), lens, "yes" if profile.skew else "no"))
    return table(*rows)


def scenario_table() -> str:
    """Table of the scenarios that are shipped."""
    rows = [("name", "image", "board", "views")]
    for name in config_names():
        scenario = load_scenario(config_path(name))
        width, height = scenario.camera.size
        rows.append((f"`{name}`", f"{width} x {height}", f"`{scenario.board.spec}`", str(scenario.views.count)))
    return table(*rows)


def key_tables(kind: str) -> Iterator[str]:
    """Table of all keys of a file, for each form that it may have."""
    definitions = json.loads(schema(kind))["$defs"]
    for name in PARTS[kind]:
        yield table(("key", "value", "meaning"), *keys(definitions[name], definitions))


def keys(part: Schema, definitions: Schema, prefix: str = "") -> Iterator[tuple[str, str, str]]:
    """Path, kind of value and meaning of every key, those of a mapping after it."""
    for name, described in part["properties"].items():
        value = resolved(described, definitions)
        needed = name in part.get("required", ())
        meaning = described.get("description", value.get("description", ""))
        yield f"`{prefix}{name}`", kind_of(value, definitions) + ("" if needed else default_of(described)), meaning
        inner, mark = (resolved(value["items"], definitions), "[].") if isinstance(value.get("items"), dict) else (value, ".")
        if "properties" in inner:
            yield from keys(inner, definitions, f"{prefix}{name}{mark}")


def resolved(described: Schema, definitions: Schema) -> Schema:
    """Follow a reference; of a value that may also be null, the value."""
    choices = [choice for choice in described.get("anyOf", ()) if choice.get("type") != "null"]
    described = choices[0] if len(choices) == 1 else described
    found: Schema = definitions[described["$ref"].rpartition("/")[2]] if "$ref" in described else described
    return found


def kind_of(value: Schema, definitions: Schema) -> str:
    """Say in a few words what a value is."""
    if "const" in value or "enum" in value:
        return " or ".join(f"`{choice}`" for choice in value.get("enum", [value.get("const", "")]))
    kind = _KINDS.get(value.get("type", ""), value.get("type", "value"))
    if kind == "list" and isinstance(value.get("items"), dict):
        item = resolved(value["items"], definitions)
        inner = _KINDS.get(item.get("type", "string" if "enum" in item else ""), "number")
        kind = f"list of {inner}s" if inner != "text" else "list of text"
    return ", ".join(
        [kind, *(f"{words} {value[limit]:g}" for limit, words in _LIMITS.items() if abs(value.get(limit, _FAR)) < _FAR)]
    )


def default_of(described: Schema) -> str:
    """Say what holds for a key that is left out."""
    default = described.get("default")
    if default is None or default in ({}, [], "") or isinstance(default, dict):
        return " (may be absent)"
    return f" (`{default}`)"


if __name__ == "__main__":
    main(Path(__file__).resolve().parent / "_generated")
