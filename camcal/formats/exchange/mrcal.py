"""mrcal's .cameramodel: a Python dict with a lens model of OpenCV's."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict

from camcal.formats.exchange.loaded import Loaded
from camcal.formats.exchange.profile import (
    COEFFICIENTS,
    Exchanged,
    Outgoing,
    Pinhole,
    Profile,
    checked,
    faulty,
    fisheye_problem,
)
from camcal.formats.validation import Number, Schema, Whole, list_of, validate
from camcal.formats.yaml_io import describe

PROFILE = Profile("mrcal", "mrcal's cameramodel", ((), COEFFICIENTS[:4], COEFFICIENTS[:5], COEFFICIENTS), (".cameramodel",))

_COUNTS = {
    "LENSMODEL_PINHOLE": 0,
    "LENSMODEL_OPENCV4": 4,
    "LENSMODEL_OPENCV5": 5,
    "LENSMODEL_OPENCV8": 8,
    "LENSMODEL_OPENCV12": 12,
}
_NAMES = {count: name for name, count in _COUNTS.items()}


class _Model(Schema):
    """A camera model; poses, uncertainty and valid region stay mrcal's."""

    model_config = ConfigDict(extra="ignore")

    lensmodel: str
    intrinsics: list[Number]
    imagersize: Annotated[list[Whole], list_of(2)]


def matches(loaded: Loaded) -> bool:
    """Tell whether a file is a camera model."""
    return loaded.syntax in ("python", "json") and "imagersize" in loaded.data and "intrinsics" in loaded.data


def read(loaded: Loaded) -> list[Exchanged]:
    """Read a camera model."""
    document = loaded.document
    model = validate(document, _Model)
    if model.lensmodel not in _COUNTS:
        problem = fisheye_problem(model.lensmodel, f"one of {', '.join(_COUNTS)}")
        problem += " Or let mrcal-convert-lensmodel make it LENSMODEL_OPENCV8."
        return [faulty(document, ("lensmodel",), "camera", problem)]
    values = model.intrinsics
    expected = 4 + _COUNTS[model.lensmodel]
    if len(values) != expected:
        problem = f"wrong number of values for {model.lensmodel} (got {len(values)}, expected {expected})"
        raise document.error(("intrinsics",), problem)
    if any(values[12:]):
        problem = f"thin-prism coefficients (got {describe(values[12])} ..., expected 0): camcal's lens has none"
        return [faulty(document, ("intrinsics",), "camera", problem)]
    size = model.imagersize[0], model.imagersize[1]
    return [checked(document, ("intrinsics",), Exchanged("camera", Pinhole(*values[:4]), tuple(values[4:12]), size))]


def write(outgoing: Outgoing) -> str:
    """Write a camera model at the origin."""
    fx, fy, cx, cy, _ = outgoing.pinhole
    values = ", ".join(map(repr, [fx, fy, cx, cy, *outgoing.coefficients(*outgoing.lens)]))
    width, height = outgoing.known.camera.size
    nowhere = "[ 0., 0., 0., 0., 0., 0. ]"
    return (
        f"{outgoing.comments('#')}{{\n"
        f"    'lensmodel':  '{_NAMES[len(outgoing.lens)]}',\n\n"
        "    # fx, fy, cx, cy, then the lens's coefficients in OpenCV's order\n"
        f"    'intrinsics': [ {values} ],\n\n"
        "    # The pose, under its name before mrcal 2.5 and since\n"
        f"    'extrinsics': {nowhere},\n"
        f"    'rt_cam_ref': {nowhere},\n\n"
        f"    'imagersize': [ {width}, {height} ],\n"
        "}\n"
    )
