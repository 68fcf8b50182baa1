"""camcal's own JSON: a camera with plain names, and all that is known of it."""

from __future__ import annotations

import json
import math
from typing import Any, Literal

from pydantic import Field

from camcal.formats.camera_schema import knowledge_of
from camcal.formats.exchange.loaded import Loaded
from camcal.formats.exchange.profile import COEFFICIENTS, Exchanged, Outgoing, Pinhole, Profile, checked
from camcal.formats.validation import Number, Positive, Schema, Text, Whole, validate
from camcal.formats.yaml_io import Document

PROFILE = Profile("json", "camcal's JSON", (COEFFICIENTS,), (".json",), skew=True)

_FORMAT = "camcal camera"
_VERSION = 1
# Parts of a camera.yaml that our JSON lays out otherwise.
_OF_YAML = ("CameraFile", "CameraInfo", "Matrix")


class Distortion(Schema):
    """Coefficients of the lens: x (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶) + tangential(p1, p2)."""

    k1: Number = 0.0
    k2: Number = 0.0
    p1: Number = 0.0
    p2: Number = 0.0
    k3: Number = 0.0
    k4: Number = 0.0
    k5: Number = 0.0
    k6: Number = 0.0


class CameraJson(Schema):
    """A camera; pixels have whole-number centres, the centre of the top-left pixel is (0, 0)."""

    format: Literal["camcal camera"]
    format_version: Literal[1]
    camera_name: Text = "camera"
    image_width: Whole = Field(ge=1, le=1_000_000)
    image_height: Whole = Field(ge=1, le=1_000_000)
    fx: Positive
    fy: Positive
    cx: Number
    cy: Number
    skew: Number = 0.0
    distortion: Distortion = Distortion()
    camcal: dict[str, Any] | None = Field(
        default=None,
        description="What else is known: the `camcal` mapping of a camera.yaml; null for a number that is not finite.",
    )


def camera_json_schema() -> dict[str, Any]:
    """Return the JSON Schema of the format, what else is known included."""
    # Only who asks for a schema waits for what makes them.
    from camcal.formats.json_schema import json_schema

    schema = CameraJson.model_json_schema()
    parts = json_schema("camera")["$defs"]
    schema["$defs"] |= {name: _with_null(part) for name, part in parts.items() if name not in _OF_YAML}
    note = schema["properties"]["camcal"]["description"]
    schema["properties"]["camcal"] = {"anyOf": [{"$ref": "#/$defs/Knowledge"}, {"type": "null"}], "description": note}
    return schema


def matches(loaded: Loaded) -> bool:
    """Tell whether a file says that it is one."""
    return loaded.syntax == "json" and loaded.data.get("format") == _FORMAT


def read(loaded: Loaded) -> list[Exchanged]:
    """Read the camera."""
    document = loaded.document
    entry = validate(document, CameraJson)
    pinhole = Pinhole(entry.fx, entry.fy, entry.cx, entry.cy, entry.skew)
    dist = tuple(getattr(entry.distortion, name) for name in COEFFICIENTS)
    size = entry.image_width, entry.image_height
    camera = checked(document, (), Exchanged(entry.camera_name, pinhole, dist, size))
    if entry.camcal is None:
        return [camera]
    numbers = Document(document.name, {"camcal": _with_nan(entry.camcal)}, document.lines)
    known = knowledge_of(numbers, camera.camera(size), entry.camera_name)
    return [Exchanged(camera.name, pinhole, dist, size, known=known)]


def write(outgoing: Outgoing) -> str:
    """Write everything that is known of the camera."""
    from camcal.formats.camera_file import camera_knowledge

    width, height = outgoing.known.camera.size
    content: dict[str, Any] = {"format": _FORMAT, "format_version": _VERSION, "camera_name": outgoing.known.name}
    content |= {"image_width": width, "image_height": height}
    content |= outgoing.pinhole._asdict() | {"distortion": outgoing.dist}
    content["camcal"] = _finite(camera_knowledge(outgoing.known))
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _finite(value: Any) -> Any:
    """Replace what is not finite, which JSON does not have, by null."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return [_finite(item) for item in value] if isinstance(value, (list, tuple)) else value


def _with_nan(value: Any) -> Any:
    """Replace null by NaN."""
    if isinstance(value, dict):
        return {key: _with_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_with_nan(item) for item in value]
    return math.nan if value is None else value


def _with_null(schema: Any) -> Any:
    """Let every number of a schema be null."""
    if isinstance(schema, dict):
        number = schema.get("type") == "number"
        return {key: ["number", "null"] if key == "type" and number else _with_null(item) for key, item in schema.items()}
    return [_with_null(item) for item in schema] if isinstance(schema, list) else schema
