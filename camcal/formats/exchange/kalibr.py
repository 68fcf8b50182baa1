"""Kalibr's camchain.yaml: several pinhole cameras with radial and tangential distortion (radtan: k1, k2, p1, p2)."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict

from camcal.formats.exchange.loaded import Loaded
from camcal.formats.exchange.profile import Exchanged, Outgoing, Pinhole, Profile, checked, faulty, fisheye_problem
from camcal.formats.validation import Number, Schema, Whole, list_of, validate
from camcal.formats.yaml_io import Document, describe
from camcal.formats.yaml_plain import float_text

PROFILE = Profile("kalibr", "Kalibr's camchain", (("k1", "k2", "p1", "p2"),), (".yaml", ".yml"))

_COEFFICIENTS = {"radtan": 4, "none": 0}


class _Model(Schema):
    """Which kind of camera an entry is."""

    model_config = ConfigDict(extra="ignore")

    camera_model: str
    distortion_model: str = "none"


class _Entry(_Model):
    """One pinhole camera; what else Kalibr keeps with it (topics, poses) is its own."""

    intrinsics: Annotated[list[Number], list_of(4)]
    distortion_coeffs: tuple[Number, ...] = ()
    resolution: Annotated[list[Whole], list_of(2)]


def matches(loaded: Loaded) -> bool:
    """Tell whether a file is a camchain: entries that say which camera model they are."""
    return loaded.syntax == "yaml" and any(_is_entry(entry) for entry in loaded.data.values())


def read(loaded: Loaded) -> list[Exchanged]:
    """Read every camera of a camchain."""
    document = loaded.document
    names = [name for name, entry in document.data.items() if _is_entry(entry)]
    if not names:
        raise document.error((), "no camera (expected entries such as cam0 with camera_model, intrinsics, resolution)")
    return [_camera(document, name) for name in names]


def write(outgoing: Outgoing) -> str:
    """Write a camchain of one camera."""
    fx, fy, cx, cy, _ = outgoing.pinhole
    width, height = outgoing.known.camera.size

    def floats(values: list[float]) -> str:
        return f"[{', '.join(map(float_text, values))}]"

    return (
        f"{outgoing.comments('#')}cam0:\n"
        "  cam_overlaps: []\n"
        "  camera_model: pinhole\n"
        f"  distortion_coeffs: {floats(outgoing.coefficients('k1', 'k2', 'p1', 'p2'))}\n"
        "  distortion_model: radtan\n"
        f"  intrinsics: {floats([fx, fy, cx, cy])}\n"
        f"  resolution: [{width}, {height}]\n"
        "  rostopic: /cam0/image_raw\n"
    )


def _is_entry(entry: Any) -> bool:
    return isinstance(entry, dict) and "camera_model" in entry


def _camera(document: Document, name: str) -> Exchanged:
    """Read one camera; one with another model is faulty."""
    model = validate(document, _Model, (name,))
    if model.camera_model != "pinhole":
        return faulty(document, (name, "camera_model"), name, fisheye_problem(model.camera_model, "pinhole"))
    if model.distortion_model not in _COEFFICIENTS:
        return faulty(document, (name, "distortion_model"), name, fisheye_problem(model.distortion_model, "radtan or none"))
    entry = validate(document, _Entry, (name,))
    expected = _COEFFICIENTS[model.distortion_model]
    if len(entry.distortion_coeffs) != expected:
        got = describe(entry.distortion_coeffs)
        problem = f"wrong number of coefficients for {model.distortion_model} (got {got}, expected {expected})"
        raise document.error((name, "distortion_coeffs"), problem)
    size = entry.resolution[0], entry.resolution[1]
    return checked(document, (name,), Exchanged(name, Pinhole(*entry.intrinsics), entry.distortion_coeffs, size))
