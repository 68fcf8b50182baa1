"""nerfstudio's transforms.json: intrinsics for all frames, or for each; the outer corner of the top-left pixel is (0, 0)."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from pydantic import ConfigDict

from camcal.formats.exchange.loaded import Loaded
from camcal.formats.exchange.profile import (
    Exchanged,
    ForeignLens,
    Outgoing,
    Pinhole,
    Profile,
    checked,
    faulty,
    fisheye_problem,
)
from camcal.formats.validation import Number, Positive, Schema, Whole, validate
from camcal.formats.yaml_io import Document, KeyPath, describe
from camcal.geometry.arrays import FloatArray

PROFILE = Profile("nerfstudio", "nerfstudio's transforms.json", (("k1", "k2", "p1", "p2", "k3"),), (".json",))

_MODELS = ("OPENCV", "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL")
_HALF = 0.5
_KEYS = ("camera_model", "is_fisheye", "fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2")


class _Entry(Schema):
    """The keys of one camera; the rest of a file is nerfstudio's own."""

    model_config = ConfigDict(extra="ignore")

    camera_model: str = "OPENCV"
    is_fisheye: bool = False
    """instant-ngp's way to say it."""
    fl_x: Positive
    fl_y: Positive | None = None
    cx: Number
    cy: Number
    w: Whole
    h: Whole
    k1: Number = 0.0
    k2: Number = 0.0
    k3: Number = 0.0
    k4: Number = 0.0
    p1: Number = 0.0
    p2: Number = 0.0


def matches(loaded: Loaded) -> bool:
    """Tell whether a file is a transforms.json."""
    data = loaded.data
    return loaded.syntax == "json" and ("fl_x" in data or isinstance(data.get("frames"), list))


def read(loaded: Loaded) -> list[Exchanged]:
    """Read the cameras: one if all frames share it, else one for each that differs, called by its first frame."""
    document = loaded.document
    frames = document.data.get("frames", [])
    if not isinstance(frames, list) or not any(isinstance(frame, dict) and "fl_x" in frame for frame in frames):
        return [_camera(document, (), "camera", document.data)]
    shared = {key: document.data[key] for key in _KEYS if key in document.data}
    cameras: dict[str, Exchanged] = {}
    for index, frame in enumerate(frames):
        if not isinstance(frame, dict):
            raise document.error(("frames", index), f"wrong type (got {describe(frame)}, expected a mapping)")
        entry = shared | {key: frame[key] for key in _KEYS if key in frame}
        kind = json.dumps(entry, sort_keys=True)
        if kind not in cameras:
            name = str(frame.get("file_path", f"frame {index}"))
            cameras[kind] = _camera(document, ("frames", index), name, entry)
    return list(cameras.values())


def write(outgoing: Outgoing) -> str:
    """Write a transforms.json without frames, to which they are added."""
    fx, fy, cx, cy, _ = outgoing.pinhole
    width, height = outgoing.known.camera.size
    content: dict[str, Any] = {"camera_model": "OPENCV", "w": width, "h": height, "fl_x": fx, "fl_y": fy}
    content |= {"cx": cx + _HALF, "cy": cy + _HALF}
    dist = outgoing.dist
    content |= {"k1": dist["k1"], "k2": dist["k2"], "k3": dist["k3"], "k4": 0.0, "p1": dist["p1"], "p2": dist["p2"]}
    return json.dumps(content | {"frames": []}, indent=2) + "\n"


def _camera(document: Document, path: KeyPath, name: str, values: dict[str, Any]) -> Exchanged:
    """Read one camera; one with another model is faulty."""
    part = document if not path else Document(document.name, _placed(path, values), document.lines)
    entry = validate(part, _Entry, path)
    where = document if "camera_model" in document.data else part
    if entry.camera_model not in _MODELS:
        return faulty(where, ("camera_model",), name, fisheye_problem(entry.camera_model, " or ".join(_MODELS)))
    if entry.is_fisheye:
        return faulty(where, (*path, "is_fisheye"), name, fisheye_problem(True, "false"))
    pinhole = Pinhole(entry.fl_x, entry.fl_y or entry.fl_x, entry.cx - _HALF, entry.cy - _HALF)
    size = entry.w, entry.h
    camera = checked(part, path, Exchanged(name, pinhole, (entry.k1, entry.k2, entry.p1, entry.p2, entry.k3), size))
    if entry.k4 == 0:
        return camera
    if entry.p1 or entry.p2:
        return faulty(
            part, (*path, "k4"), name, "r⁸ term with tangential ones (got k4 != 0, expected 0): camcal's lens has none"
        )
    return Exchanged(name, pinhole, (), size, _eighth_power(entry))


def _eighth_power(entry: _Entry) -> ForeignLens:
    """Return the radial lens whose k4 is the coefficient of r⁸."""

    def distort(radius: FloatArray) -> FloatArray:
        s = radius * radius
        distorted: FloatArray = radius * np.polyval([entry.k4, entry.k3, entry.k2, entry.k1, 1.0], s)
        return distorted

    return ForeignLens("nerfstudio's r⁸ term", distort)


def _placed(path: KeyPath, values: dict[str, Any]) -> dict[str, Any]:
    """Nest values at a key path `("frames", index)` of an otherwise empty document."""
    key, index = path
    return {str(key): {index: values}}
