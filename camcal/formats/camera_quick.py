"""camcal's own camera files read at once, without YAML's generality and pydantic, which take longer than most images.

What is not laid out just as camcal writes it, or is not right beyond doubt, is left to the reader that says what is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from camcal.formats.versions import CAMERA_FORMAT_VERSION
from camcal.formats.yaml_plain import float_text
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.records import BoardShape, ImageSigma, Intrinsics, Uncertainty
from camcal.verdict import Finding, Verdict

_LONGEST_FILE_BYTES = 200_000
_LONGEST_TEXT = 1000
_LARGEST_SIDE_PX = 1_000_000
_TOP = "%YAML 1.2\n---\n"
_STEP = 2
_WORDS = {".nan": math.nan, ".inf": math.inf, "-.inf": -math.inf}

_CAMERA_KEYS = {
    *("image_width", "image_height", "camera_name", "distortion_model", "camera_matrix", "distortion_coefficients"),
    *("rectification_matrix", "projection_matrix", "camcal"),
}
_KNOWN_KEYS = {
    *("format_version", "version", "board", "free", "standard_deviations", "correlations", "rms_px", "views", "corners"),
    "valid_radius_px",
}
_UNCERTAINTY_KEYS, _VERDICT_KEYS = {"uncertainty", "cross_validation"}, {"verdict", "findings"}
_SHAPE_NAMES = ("bow_x", "bow_y", "stretch")
_COEFFICIENTS = {"plumb_bob": (4, 5), "rational_polynomial": (8,)}


class _DoubtError(Exception):
    """Something is not as camcal writes it."""


def read_quickly(path: Path) -> Intrinsics | None:
    """Read a camera file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Intrinsics or None
        None if the file is for the other reader: another tool's, edited, or in whatever way wrong.
    """
    try:
        if not path.is_file() or path.stat().st_size > _LONGEST_FILE_BYTES:
            return None
        return _intrinsics(_document(path.read_bytes().decode("utf-8")))
    except (OSError, _DoubtError, LookupError, ValueError):
        return None


def _document(text: str) -> dict[str, Any]:
    """Parse the few forms that camcal writes: nested mappings by indentation, with one value a line."""
    if not text.startswith(_TOP) or not text.endswith("\n"):
        raise _DoubtError
    lines = text[len(_TOP) : -1].split("\n")
    while lines and lines[0].startswith("# ") and lines[0].isprintable():
        lines.pop(0)
    lines.reverse()
    mapping = _mapping(lines, 0)
    if lines:
        raise _DoubtError
    return mapping


def _mapping(lines: list[str], indent: int, *, listed: bool = False) -> dict[str, Any]:
    """Take the lines of one mapping off the end; as an item of a list it begins with a dash."""
    found: dict[str, Any] = {}
    while lines:
        depth, dashed, key, value = _entry(lines[-1])
        begins = listed and not found
        if depth < indent or (dashed and not begins):
            break
        if depth > indent or dashed != begins or key in found:
            raise _DoubtError
        lines.pop()
        found[key] = _nested(lines, indent + _STEP) if value is None else _value(value)
    if not found:
        raise _DoubtError
    return found


def _entry(line: str) -> tuple[int, bool, str, str | None]:
    """Take a line apart: where its key begins, whether a dash is before it, the key, and its value if that is on the line."""
    body = line.lstrip(" ")
    dashed = body.startswith("- ")
    body = body.removeprefix("- ")
    key, colon, value = body.partition(":")
    if not colon or not key.isidentifier() or not key.isascii() or (value and not value.startswith(" ")) or value == " ":
        raise _DoubtError
    return len(line) - len(body), dashed, key, value[1:] or None


def _nested(lines: list[str], indent: int) -> Any:
    """Take a mapping or a list of mappings off the end of the lines."""
    if not lines or not lines[-1].startswith(" " * indent + "- "):
        return _mapping(lines, indent)
    items = []
    while lines and lines[-1].startswith(" " * indent + "- "):
        items.append(_mapping(lines, indent + _STEP, listed=True))
    return items


def _value(text: str) -> Any:
    """Read a value that stands on one line."""
    if text.startswith("["):
        return _list(text)
    return {} if text == "{}" else _scalar(text)


def _list(text: str) -> list[Any]:
    """Read a list of scalars, or of lists of them."""
    if not text.endswith("]"):
        raise _DoubtError
    inner = text[1:-1]
    if inner.startswith("["):
        if not inner.endswith("]"):
            raise _DoubtError
        return [_items(row) for row in inner[1:-1].split("], [")]
    return _items(inner)


def _items(text: str) -> list[Any]:
    return [_scalar(item) for item in text.split(", ")] if text else []


def _scalar(text: str) -> str | float | int:
    """Read plain text in quotes, or a number."""
    if text.startswith('"'):
        inner = text[1:-1]
        if len(text) < 2 or not text.endswith('"') or '"' in inner or "\\" in inner or not inner.isprintable():
            raise _DoubtError
        return inner
    if text in _WORDS:
        return _WORDS[text]
    number = float(text) if "." in text else int(text)
    if (float_text(number) if isinstance(number, float) else str(number)) != text:
        raise _DoubtError
    return number


def _intrinsics(data: Mapping[str, Any]) -> Intrinsics:
    """Build what a document of camcal's own layout holds."""
    known = data["camcal"]
    optional = {"board_shape"} | _UNCERTAINTY_KEYS | _VERDICT_KEYS
    _expect(set(data) == _CAMERA_KEYS and isinstance(known, dict) and _KNOWN_KEYS <= set(known) <= _KNOWN_KEYS | optional)
    for pair in (_UNCERTAINTY_KEYS, _VERDICT_KEYS):
        _expect(pair <= set(known) or not pair & set(known))
    _expect(_whole(known["format_version"]) == CAMERA_FORMAT_VERSION)
    _text(known["version"])
    _number(known["valid_radius_px"])
    camera = _camera(data)
    sigmas = known["standard_deviations"]
    free = tuple(_text(name) for name in _items_of(known["free"]))
    _expect(isinstance(sigmas, dict) and tuple(sigmas) == free)
    _expect(free == tuple(name for name in camera.intrinsic_names if name in free))
    return Intrinsics(
        camera,
        name=_text(data["camera_name"]),
        board=_text(known["board"]),
        free=free,
        covariance=_covariance(list(sigmas.values()), known["correlations"]),
        rms_px=_number(known["rms_px"]),
        views=_whole(known["views"]),
        corners=_whole(known["corners"]),
        shape=_shape(known["board_shape"]) if "board_shape" in known else BoardShape(),
        uncertainty=_uncertainty(known["uncertainty"]) if "uncertainty" in known else None,
        cross_validation=_number(known.get("cross_validation", math.nan)),
        verdict=_verdict(known) if "verdict" in known else None,
    )


def _camera(data: Mapping[str, Any]) -> Camera:
    """Build the camera."""
    size = _whole(data["image_width"]), _whole(data["image_height"])
    _expect(min(size) >= 1 and max(size) <= _LARGEST_SIDE_PX)
    _matrix(data["rectification_matrix"], 3, 3)
    _matrix(data["projection_matrix"], 3, 4)
    dist = data["distortion_coefficients"]
    count = len(_items_of(dist["data"]))
    _expect(count in _COEFFICIENTS[_text(data["distortion_model"])])
    return Camera(size, _matrix(data["camera_matrix"], 3, 3), _matrix(dist, 1, count).ravel())


def _matrix(entry: Mapping[str, Any], rows: int, columns: int) -> FloatArray:
    """Read a matrix that must have a given shape."""
    _expect(set(entry) == {"rows", "cols", "dt", "data"} and _text(entry["dt"]) == "d")
    _expect((_whole(entry["rows"]), _whole(entry["cols"])) == (rows, columns))
    return np.array(_finite(entry["data"])).reshape(rows, columns)


def _covariance(sigmas: Sequence[Any], correlations: Any) -> FloatArray:
    """Build a covariance from standard deviations and correlations."""
    count = len(sigmas)
    sigma = _finite(sigmas)
    rho = np.array([_finite(row) for row in _items_of(correlations)]).reshape(count, count)
    _expect(
        min(sigma, default=0) >= 0 and bool((rho == rho.T).all() and (np.abs(rho) <= 1).all() and (np.diag(rho) == 1).all())
    )
    covariance: FloatArray = np.outer(sigma, sigma) * rho
    return covariance


def _shape(entry: Mapping[str, Any]) -> BoardShape:
    """Read the board's shape."""
    _expect(set(entry) == {"names", "values", "standard_deviations", "correlations"})
    names, values, sigmas = (_items_of(entry[key]) for key in ("names", "values", "standard_deviations"))
    _expect(all(name in _SHAPE_NAMES for name in names) and len(names) == len(values) == len(sigmas))
    return BoardShape(tuple(names), np.array(_finite(values)), _covariance(sigmas, entry["correlations"]))


def _uncertainty(entry: Mapping[str, Any]) -> Uncertainty:
    """Read the uncertainty of the projection."""
    _expect(set(entry) == {"range_m", "at_range", "at_infinity"})
    at_range, at_infinity = (_image_sigma(entry[key]) for key in ("at_range", "at_infinity"))
    return Uncertainty(_finite([entry["range_m"]])[0], at_range, at_infinity)


def _image_sigma(entry: Mapping[str, Any]) -> ImageSigma:
    """Read standard deviations over the image."""
    _expect(set(entry) == {"centre_px", "edges_px", "corners_px", "shares"})
    top, right, bottom, left = map(_number, _items_of(entry["edges_px"]))
    first, second, third, fourth = map(_number, _items_of(entry["corners_px"]))
    tenth, half, whole = _finite(entry["shares"])
    return ImageSigma(
        _number(entry["centre_px"]), (top, right, bottom, left), (first, second, third, fourth), (tenth, half, whole)
    )


def _verdict(known: Mapping[str, Any]) -> Verdict:
    """Read the verdict; its word must be the one that its findings make."""
    findings = []
    for entry in _items_of(known["findings"]):
        _expect(isinstance(entry, dict) and set(entry) == {"code", "level", "weight", "text", "advice"})
        code, level, text, advice = (_text(entry[key]) for key in ("code", "level", "text", "advice"))
        _expect(code != "")
        findings.append(Finding(code, level, _finite([entry["weight"]])[0], text, advice))
    verdict = Verdict(tuple(findings))
    _expect(verdict.word == known["verdict"])
    return verdict


def _expect(condition: bool) -> None:
    if not condition:
        raise _DoubtError


def _text(value: Any) -> str:
    _expect(isinstance(value, str) and len(value) <= _LONGEST_TEXT)
    return str(value)


def _whole(value: Any) -> int:
    _expect(isinstance(value, int) and value >= 0)
    return int(value)


def _number(value: Any) -> float:
    _expect(isinstance(value, (int, float)))
    return float(value)


def _finite(values: Any) -> list[float]:
    numbers = [_number(value) for value in _items_of(values)]
    _expect(all(map(math.isfinite, numbers)))
    return numbers


def _items_of(values: Any) -> list[Any]:
    _expect(isinstance(values, list))
    return list(values)
