"""JSON Schemas of camcal's YAML files, so that editors complete and check them: generated from the models that read them."""

from __future__ import annotations

import ast
import inspect
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from textwrap import dedent
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from camcal.errors import InputError
from camcal.formats.board_schema import AprilGridFile, CheckerboardFile, KalibrAprilGrid, KalibrCheckerboard
from camcal.formats.camera_layout import CameraFile, CameraInfo
from camcal.formats.scenario_file import ScenarioFile
from camcal.formats.text import shown
from camcal.formats.validation import models_within
from camcal.formats.views_schema import ViewsFile
from camcal.nearest import did_you_mean

DIALECT = "https://json-schema.org/draft/2020-12/schema"


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of file.

    Attributes
    ----------
    title : str
        What it is, for people.
    models : tuple of model
        What it may look like.
    root : dict
        Which of them holds when, as JSON Schema.
    """

    title: str
    models: tuple[type[BaseModel], ...]
    root: dict[str, Any]


def _ref(model: type[BaseModel]) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{model.__name__}"}


def _by_type(models: dict[str, dict[str, type[BaseModel]]]) -> dict[str, Any]:
    """The model that a key names, by the key and its values; one of the keys must be there."""
    rules = [
        {"if": {"required": [key], "properties": {key: {"const": value}}}, "then": _ref(model)}
        for key, choices in models.items()
        for value, model in choices.items()
    ]
    properties = {key: {"enum": list(choices)} for key, choices in models.items()}
    return {"type": "object", "properties": properties, "anyOf": [{"required": [key]} for key in models], "allOf": rules}


_BOARDS: dict[str, dict[str, type[BaseModel]]] = {
    "type": {"checkerboard": CheckerboardFile, "aprilgrid": AprilGridFile},
    "target_type": {"checkerboard": KalibrCheckerboard, "aprilgrid": KalibrAprilGrid},
}

KINDS: dict[str, Kind] = {
    "board": Kind(
        "camcal's board.yaml, or Kalibr's target.yaml",
        (CheckerboardFile, AprilGridFile, KalibrCheckerboard, KalibrAprilGrid),
        _by_type(_BOARDS),
    ),
    "camera": Kind(
        "camcal's camera.yaml, or a camera_info of ROS",
        (CameraFile, CameraInfo),
        {"type": "object", "if": {"required": ["camcal"]}, "then": _ref(CameraFile), "else": _ref(CameraInfo)},
    ),
    "synth": Kind("A scene for camcal synth", (ScenarioFile,), {"type": "object", **_ref(ScenarioFile)}),
    "views": Kind("camcal's views.yaml", (ViewsFile,), {"type": "object", **_ref(ViewsFile)}),
}
"""Every kind of file by the name that `camcal schema` knows it by."""


def json_schema(kind: str) -> dict[str, Any]:
    """Return the JSON Schema of a kind of file, draft 2020-12.

    Parameters
    ----------
    kind : str
        One of `KINDS`.

    Raises
    ------
    InputError
        If there is no such kind; names the nearest.

    Examples
    --------
    >>> json_schema("board")["$id"]
    'urn:camcal:schema:board'
    """
    if kind not in KINDS:
        problem = f"schema: unknown kind of file (got {shown(kind)}, expected one of {', '.join(KINDS)})."
        raise InputError(problem + did_you_mean(kind, KINDS))
    chosen = KINDS[kind]
    inputs = [(model, "validation") for model in chosen.models]
    _, made = models_json_schema(inputs, schema_generator=_Untitled, ref_template="#/$defs/{model}")  # type: ignore[arg-type]
    parts = made["$defs"]
    for model in _every_model(chosen.models):
        part = parts[model.__name__]
        for name, text in field_docs(model).items():
            part["properties"][name]["description"] = text
    return {"$schema": DIALECT, "$id": f"urn:camcal:schema:{kind}", "title": chosen.title, **chosen.root, "$defs": parts}


def schema_text(kind: str) -> str:
    """Return the JSON Schema of a kind of file as the content of a .json file."""
    return json.dumps(json_schema(kind), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


@lru_cache(maxsize=64)
def field_docs(model: type[BaseModel]) -> dict[str, str]:
    """Return what the source says of each field of a model: the text on the line after it, its parents' included.

    Parameters
    ----------
    model : model
        From a module whose source is there.
    """
    docs: dict[str, str] = {}
    for owner in reversed(model.__mro__):
        if issubclass(owner, BaseModel) and owner is not BaseModel:
            docs |= _docs_in(owner)
    return {name: text for name, text in docs.items() if name in model.model_fields}


def _docs_in(model: type[BaseModel]) -> dict[str, str]:
    """Texts after the fields of one class."""
    (definition,) = ast.parse(dedent(inspect.getsource(model))).body
    body: Sequence[ast.stmt] = definition.body if isinstance(definition, ast.ClassDef) else ()
    return {
        field.target.id: text.value.value
        for field, text in pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }


def _every_model(models: Sequence[type[BaseModel]]) -> Iterator[type[BaseModel]]:
    """The models and all that their fields are made of, each once."""
    waiting, seen = list(models), set[type[BaseModel]]()
    while waiting:
        model = waiting.pop()
        if model not in seen:
            seen.add(model)
            yield model
            waiting += [part for field in model.model_fields.values() for part in models_within(field.annotation)]


class _Untitled(GenerateJsonSchema):
    """Without titles made up from the names of the keys, and without a default that JSON has no number for."""

    def field_title_should_be_set(self, schema: Any) -> bool:  # noqa: ARG002
        return False

    def default_schema(self, schema: Any) -> dict[str, Any]:
        made = super().default_schema(schema)
        return {key: value for key, value in made.items() if value == value}  # noqa: PLR0124 - NaN alone is not itself
