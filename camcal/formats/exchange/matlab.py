"""MATLAB: a call of cameraIntrinsics, its properties in JSON, or a struct in a MAT file; the first pixel is (1, 1)."""

from __future__ import annotations

import json
import re
from typing import Any

from camcal.errors import InputError
from camcal.formats.exchange.loaded import Loaded
from camcal.formats.exchange.mat_in import parse_mat
from camcal.formats.exchange.profile import Exchanged, Lineless, Outgoing, Pinhole, Profile, checked, faulty, fisheye_problem
from camcal.formats.exchange.values import numbers
from camcal.formats.yaml_io import Document, describe, resolve

PROFILE = Profile("matlab", "MATLAB's cameraIntrinsics", (("k1", "k2", "p1", "p2", "k3"),), (".m", ".json"), skew=True)

_MAT_5 = b"MATLAB 5.0 MAT-file"
_MAT_73 = b"MATLAB 7.3 MAT-file"
_POSITIONAL = ("FocalLength", "PrincipalPoint", "ImageSize")
_MATRICES = ("K", "IntrinsicMatrix")
_CALL = re.compile(r"\b(cameraIntrinsics|cameraParameters)\s*\(")
# A value in brackets, or a single number.
_VALUE = r"(\[[^\]]*\]|[-+.0-9][-+.0-9eE]*)"
# A variable of such a value, and where a word may stand for one: not in quotes, and not the name of an argument.
_ASSIGNED = re.compile(rf"^[ \t]*([A-Za-z]\w*)[ \t]*=\s*{_VALUE}\s*(?:;|$)", re.MULTILINE)
_BARE_WORD = re.compile(r"(?<![\w'\".])[A-Za-z]\w*(?![\w'\"])(?!\s*=)")
# Arguments that are left when the numbers are taken out: by place, or under a name that matters here.
_UNKNOWN = re.compile(
    r"\A(?:[\s,]|\[[^\]]*\])*([A-Za-z]\w*\b(?!\s*=))|"
    r"\b(FocalLength|PrincipalPoint|ImageSize|RadialDistortion|TangentialDistortion|Skew|K|IntrinsicMatrix)\b"
)
_NAMED = re.compile(rf"(?:['\"](\w+)['\"]\s*,|\b([A-Za-z]\w*)\s*=)\s*{_VALUE}")


def matches(loaded: Loaded) -> bool:
    """Tell whether a file is a script, a MAT file, or has the properties of a camera."""
    if loaded.syntax == "binary":
        return loaded.content.startswith((_MAT_5, _MAT_73))
    return loaded.syntax == "script" or (loaded.syntax == "json" and bool(_structs_in(loaded.data, "")))


def read(loaded: Loaded) -> list[Exchanged]:
    """Read the camera, or those of a MAT file with several structs."""
    if loaded.syntax == "script":
        return [_camera(_script(loaded), "camera")]
    if loaded.syntax == "binary":
        return _mat_cameras(loaded)
    structs = _structs_in(loaded.data, "")
    if not structs:
        raise loaded.document.error((), f"no camera (expected keys such as {', '.join(_POSITIONAL)}, or K)")
    names = structs if len(structs) > 1 else ("camera",)
    found = zip(names, structs.values(), strict=True)
    return [_camera(Document(loaded.name, struct, loaded.document.lines), name) for name, struct in found]


def write(outgoing: Outgoing) -> str:
    """Write a script that makes `intrinsics`, or its properties in JSON."""
    fx, fy, cx, cy, skew = outgoing.pinhole
    width, height = outgoing.known.camera.size
    radial, tangential = outgoing.coefficients("k1", "k2", "k3"), outgoing.coefficients("p1", "p2")
    if outgoing.suffix == ".json":
        content = {"FocalLength": [fx, fy], "PrincipalPoint": [cx + 1, cy + 1], "ImageSize": [height, width]}
        content |= {"RadialDistortion": radial, "TangentialDistortion": tangential}
        return json.dumps(content | {"Skew": skew}, indent=2) + "\n"

    def vector(values: list[float] | list[int]) -> str:
        return f"[{' '.join(map(repr, values))}]"

    return (
        f"{outgoing.comments('%')}"
        "% In MATLAB the centre of the top-left pixel is (1, 1).\n"
        f"intrinsics = cameraIntrinsics({vector([fx, fy])}, {vector([cx + 1, cy + 1])}, {vector([height, width])}, ...\n"
        f"    'RadialDistortion', {vector(radial)}, ...\n"
        f"    'TangentialDistortion', {vector(tangential)}, ...\n"
        f"    'Skew', {skew!r});\n"
    )


def _structs_in(data: dict[str, Any], name: str) -> dict[str, dict[str, Any]]:
    """Find the properties of cameras by name, also further down: of one, or of the two in stereoParameters."""
    if _is_camera(data):
        return {name: data}
    found: dict[str, dict[str, Any]] = {}
    for key, value in data.items():
        if isinstance(value, dict):
            found |= _structs_in(value, f"{name}.{key}" if name else key)
    return found


def _is_camera(data: dict[str, Any]) -> bool:
    """Whether these are the properties of a camera, fisheyes included."""
    return bool({"FocalLength", "MappingCoefficients"} & data.keys()) or (
        "RadialDistortion" in data and any(name in data for name in _MATRICES)
    )


def _script(loaded: Loaded) -> Document:
    """Take the arguments of the first call apart."""
    # What follows three dots is a comment too, and the line goes on.
    text = re.sub(r"%[^\n]*|\.\.\.[^\n]*", " ", loaded.text)
    call = _CALL.search(text)
    if call is None:
        raise InputError(f"{loaded.name}:1: no call of cameraIntrinsics or cameraParameters")
    line = text.count("\n", 0, call.start()) + 1
    arguments = text[call.end() :]
    end = arguments.find(")")
    arguments = arguments[: end if end >= 0 else None]
    variables = dict(_ASSIGNED.findall(text[: call.start()]))
    arguments = _BARE_WORD.sub(lambda word: variables.get(word[0], word[0]), arguments)
    named = list(_NAMED.finditer(arguments))
    rest = _NAMED.sub("", arguments)
    plain = re.findall(r"\[[^\]]*\]", rest)
    values = dict(zip(_POSITIONAL, plain, strict=False)) if call[1] == "cameraIntrinsics" else {}
    values |= {match[1] or match[2]: match[3] for match in named}
    data = {name: [resolve(word) for word in re.split(r"[\s,;\[\]]+", value) if word] for name, value in values.items()}
    document = Document(loaded.name, data, {(): line} | {(name,): line for name in data})
    unknown = _UNKNOWN.search(rest)
    if unknown:
        problem = "not numbers, nor a variable that is given some above (expected such as [800 810]). Write them out."
        raise document.error((unknown[1] or unknown[2],), problem)
    return document


def _mat_cameras(loaded: Loaded) -> list[Exchanged]:
    """Read the structs of a MAT file, as toStruct makes them."""
    if loaded.content.startswith(_MAT_73):
        raise InputError(f"{loaded.name}: a MAT file of version 7.3 (expected version 7). Save it with: save(..., '-v7')")
    variables = parse_mat(loaded.name, loaded.content)
    structs = {name: value for name, value in variables.items() if isinstance(value, dict)}
    found: dict[str, dict[str, Any]] = {}
    for name, struct in structs.items():
        inner = _structs_in(struct, name)
        found |= inner if len(inner) > 1 else dict.fromkeys([name] * len(inner), *inner.values())
    if not found:
        raise InputError(
            f"{loaded.name}: no camera struct (got {', '.join(filter(None, variables)) or 'only objects'}). "
            "Objects cannot be read: save toStruct(cameraParams) instead."
        )
    return [_camera(Lineless(loaded.name, struct, {}), name) for name, struct in found.items()]


def _camera(document: Document, name: str) -> Exchanged:
    """Read the properties of one camera; a fisheye is faulty."""
    data = document.data
    if "MappingCoefficients" in data:
        return faulty(document, ("MappingCoefficients",), name, fisheye_problem("fisheyeIntrinsics", "cameraIntrinsics"))
    pinhole = _pinhole(document)
    k1, k2, k3 = [*numbers(document, ("RadialDistortion",), (2, 3)), 0.0][:3] if "RadialDistortion" in data else (0.0,) * 3
    p1, p2 = numbers(document, ("TangentialDistortion",), (2,)) if "TangentialDistortion" in data else (0.0, 0.0)
    size = None
    if data.get("ImageSize") not in (None, []):
        height, width = numbers(document, ("ImageSize",), (2,))
        if width != int(width) or height != int(height):
            raise document.error(("ImageSize",), f"not an image size (got {height:g} x {width:g}, expected whole numbers)")
        size = int(width), int(height)
    return checked(document, (), Exchanged(name, pinhole, (k1, k2, p1, p2, k3), size))


def _pinhole(document: Document) -> Pinhole:
    """Read focal lengths, principal point and skew, from their own properties or a matrix."""
    data = document.data
    if "FocalLength" in data and "PrincipalPoint" in data:
        fx, fy = numbers(document, ("FocalLength",), (2,))
        cx, cy = numbers(document, ("PrincipalPoint",), (2,))
        skew = numbers(document, ("Skew",), (1,))[0] if "Skew" in data else 0.0
        return Pinhole(fx, fy, cx - 1, cy - 1, skew)
    key = next((name for name in _MATRICES if name in data), None)
    if key is None:
        raise document.error((), f"no focal length (expected FocalLength and PrincipalPoint, or {' or '.join(_MATRICES)})")
    values = numbers(document, (key,), (9,))
    fx, skew, cx, zero, fy, cy, *last = values
    if key == "IntrinsicMatrix":
        # Up to R2022a the matrix stands transposed.
        fx, zero, _, skew, fy, _, cx, cy, _ = values
        last = [values[2], values[5], values[8]]
    if zero != 0 or last != [0, 0, 1]:
        raise document.error((key,), f"not an intrinsic matrix (got {describe(values)}, expected fx, skew, fy, cx, cy, 1)")
    return Pinhole(fx, fy, cx - 1, cy - 1, skew)
