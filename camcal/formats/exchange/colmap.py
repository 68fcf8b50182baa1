"""COLMAP's cameras.txt and cameras.bin: several cameras; the outer corner of the top-left pixel is (0, 0)."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator

from camcal.errors import InputError
from camcal.formats.exchange.loaded import Loaded
from camcal.formats.exchange.profile import (
    COEFFICIENTS,
    Exchanged,
    Lineless,
    Outgoing,
    Pinhole,
    Profile,
    checked,
    faulty,
    fisheye_problem,
)
from camcal.formats.text import shown
from camcal.formats.yaml_io import Document

PROFILE = Profile("colmap", "COLMAP's cameras", ((), COEFFICIENTS[:4], COEFFICIENTS), (".txt", ".bin"))

_HALF = 0.5
# Models by their number in cameras.bin, with the number of parameters.
_MODELS = (
    *(("SIMPLE_PINHOLE", 3), ("PINHOLE", 4), ("SIMPLE_RADIAL", 4), ("RADIAL", 5), ("OPENCV", 8), ("OPENCV_FISHEYE", 8)),
    *(("FULL_OPENCV", 12), ("FOV", 5), ("SIMPLE_RADIAL_FISHEYE", 4), ("RADIAL_FISHEYE", 5), ("THIN_PRISM_FISHEYE", 12)),
    *(("RAD_TAN_THIN_PRISM_FISHEYE", 16), ("SIMPLE_DIVISION", 4), ("DIVISION", 5), ("SIMPLE_FISHEYE", 3), ("FISHEYE", 4)),
    *(("EUCM", 6), ("EQUIRECTANGULAR", 2)),
)
_COUNTS = dict(_MODELS)
_READABLE = ("SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV")
_WRITTEN = {0: "PINHOLE", 4: "OPENCV", 8: "FULL_OPENCV"}
_MOST_CAMERAS = 10_000_000
_HEADER = struct.Struct("<Q")
_RECORD = struct.Struct("<IiQQ")


def matches(loaded: Loaded) -> bool:
    """Tell whether a file is a list of cameras, in text or binary."""
    if loaded.syntax != "binary":
        return loaded.syntax == "lines"
    if len(loaded.content) < _HEADER.size + _RECORD.size:
        return False
    (count,) = _HEADER.unpack_from(loaded.content)
    _, model, width, height = _RECORD.unpack_from(loaded.content, _HEADER.size)
    return bool(1 <= count < _MOST_CAMERAS and 0 <= model < len(_MODELS) and 1 <= width < 1 << 32 and 1 <= height < 1 << 32)


def read(loaded: Loaded) -> list[Exchanged]:
    """Read every camera."""
    if loaded.syntax == "binary":
        return list(_binary_cameras(loaded))
    cameras = list(_text_cameras(loaded))
    if not cameras:
        raise InputError(f"{loaded.name}:1: no camera (expected lines CAMERA_ID MODEL WIDTH HEIGHT PARAMS...)")
    return cameras


def write(outgoing: Outgoing) -> str | bytes:
    """Write a list of one camera, whose id is 1."""
    fx, fy, cx, cy, _ = outgoing.pinhole
    model = _WRITTEN[len(outgoing.lens)]
    width, height = outgoing.known.camera.size
    values = [fx, fy, cx + _HALF, cy + _HALF, *outgoing.coefficients(*outgoing.lens)]
    if outgoing.suffix == ".bin":
        number = [name for name, _ in _MODELS].index(model)
        return _HEADER.pack(1) + _RECORD.pack(1, number, width, height) + struct.pack(f"<{len(values)}d", *values)
    parameters = " ".join(map(repr, values))
    return f"{outgoing.comments('#')}# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n1 {model} {width} {height} {parameters}\n"


def _text_cameras(loaded: Loaded) -> Iterator[Exchanged]:
    """Read the lines of a cameras.txt."""
    for number, line in enumerate(loaded.text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        where = f"{loaded.name}:{number}"
        if len(words) < 4:
            raise InputError(f"{where}: too few values (got {shown(line)}, expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS...)")
        name, model, *numbers = words
        try:
            width, height = (int(word) for word in numbers[:2])
            values = [float(word) for word in numbers[2:]]
        except ValueError:
            raise InputError(f"{where}: not a number (got {shown(line)}, expected CAMERA_ID MODEL WIDTH HEIGHT ...)") from None
        yield _camera(Document(loaded.name, {}, {_path(name): number}), name, model, (width, height), values)


def _binary_cameras(loaded: Loaded) -> Iterator[Exchanged]:
    """Read the records of a cameras.bin."""
    content, place = loaded.content, _HEADER.size
    torn = InputError(f"{loaded.name}: not a whole cameras.bin (got {len(content)} bytes). Copy it again.")
    try:
        (count,) = _HEADER.unpack_from(content)
        for _ in range(count):
            number, model, width, height = _RECORD.unpack_from(content, place)
            place += _RECORD.size
            if not 0 <= model < len(_MODELS):
                raise InputError(f"{loaded.name}: camera {number} has an unknown model (got number {model})")
            name, parameters = _MODELS[model]
            values = struct.unpack_from(f"<{parameters}d", content, place)
            place += 8 * parameters
            yield _camera(Lineless(loaded.name, {}, {}), str(number), name, (width, height), list(values))
    except struct.error:
        raise torn from None
    if place != len(content):
        raise torn


def _path(name: str) -> tuple[str]:
    """Where a camera stands, as a message says it."""
    return (f"camera {name}",)


def _camera(document: Document, name: str, model: str, size: tuple[int, int], values: list[float]) -> Exchanged:
    """Read one camera; one with another model is faulty."""
    if model not in _READABLE:
        return faulty(document, _path(name), name, fisheye_problem(model, f"one of {', '.join(_READABLE)}"))
    if len(values) != _COUNTS[model]:
        problem = f"wrong number of values for {model} (got {len(values)}, expected {_COUNTS[model]})"
        raise document.error(_path(name), problem)
    if not all(map(math.isfinite, values)):
        raise document.error(_path(name), "not finite (expected numbers)")
    one_focal = model in ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL")
    focals, rest = (values[:1] * 2, values[1:]) if one_focal else (values[:2], values[2:])
    pinhole = Pinhole(focals[0], focals[1], rest[0] - _HALF, rest[1] - _HALF)
    return checked(document, _path(name), Exchanged(name, pinhole, tuple(rest[2:]), size))
