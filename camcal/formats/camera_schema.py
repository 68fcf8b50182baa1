"""What a camera file must look like, and the way from it to intrinsics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ConfigDict

from camcal.formats.validation import AnyNumber, Count, Name, Number, Schema, Text, Whole, validate
from camcal.formats.versions import CAMERA_FORMAT_VERSION
from camcal.formats.yaml_io import Document, KeyPath, describe, load_yaml
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.observations import Intrinsics

# Number of coefficients each lens model may have, in OpenCV's order.
_LENSES = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8,)}
_FISHEYES = ("equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "omnidirectional", "mei")
_LARGEST_SIDE_PX = 1_000_000
# Correlations are written to the last bit; a person may round them.
_SYMMETRY_TOLERANCE = 1e-6


class Matrix(Schema):
    """A matrix as OpenCV and ROS write it."""

    rows: Whole
    cols: Whole
    dt: str = "d"
    data: list[Number]


class Knowledge(Schema):
    """The `camcal` mapping: what only camcal writes."""

    format_version: Whole
    version: Text
    board: Text
    free: list[Name]
    standard_deviations: dict[str, AnyNumber]
    correlations: list[list[AnyNumber]]
    rms_px: AnyNumber
    views: Count
    corners: Count
    valid_radius_px: AnyNumber
    trusted: bool
    problems: list[Text]


class CameraInfo(Schema):
    """ROS's camera_info; what else other programs keep in such a file is theirs."""

    model_config = ConfigDict(extra="ignore")

    image_width: Whole
    image_height: Whole
    camera_name: Text = "camera"
    distortion_model: str
    camera_matrix: Matrix
    distortion_coefficients: Matrix
    rectification_matrix: Matrix | None = None
    projection_matrix: Matrix | None = None


class CameraFile(CameraInfo):
    """camcal's own camera file: nothing in it is unknown."""

    model_config = ConfigDict(extra="forbid")

    rectification_matrix: Matrix
    projection_matrix: Matrix
    camcal: Knowledge


def read_intrinsics(path: str | Path) -> Intrinsics:
    """Read a camera file.

    Raises
    ------
    InputError
        If it cannot be used.
    """
    document = load_yaml(path)
    if "camcal" not in document.data:
        info = validate(document, CameraInfo)
        return Intrinsics(_camera(document, info), info.camera_name)
    check_format_version(document, ("camcal",), CAMERA_FORMAT_VERSION)
    file = validate(document, CameraFile)
    camera = _camera(document, file)
    known = file.camcal
    free = tuple(known.free)
    if free != tuple(name for name in camera.intrinsic_names if name in free):
        expected = ", ".join(camera.intrinsic_names)
        got = ", ".join(free)
        problem = f"not names of intrinsics in their order (got {got}, expected some of {expected})"
        raise document.error(("camcal", "free"), problem)
    if known.trusted == bool(known.problems):
        raise document.error(("camcal", "trusted"), "contradicts problems (expected true if and only if there are none)")
    return Intrinsics(
        camera=camera,
        name=file.camera_name,
        board=known.board,
        free=free,
        covariance=_covariance(document, known),
        rms_px=known.rms_px,
        views=known.views,
        corners=known.corners,
        problems=tuple(known.problems),
    )


def check_format_version(document: Document, path: KeyPath, version: int) -> None:
    """Refuse a file of another format version before anything else in it is judged.

    Raises
    ------
    InputError
        If `format_version` in the mapping at `path` is another one; a missing one is left to the schema.
    """
    part: Any = document.data
    for step in path:
        part = part[step]
    got = part.get("format_version", version) if isinstance(part, dict) else version
    if got != version or isinstance(got, bool):
        advice = "Update camcal." if isinstance(got, int) and got > version else "Write the file again with this camcal."
        problem = f"another version of the format (got {describe(got)}, expected {version}). {advice}"
        raise document.error((*path, "format_version"), problem)


def _camera(document: Document, info: CameraInfo) -> Camera:
    """Check what a model alone cannot, and build the camera."""
    for key, side in (("image_width", info.image_width), ("image_height", info.image_height)):
        if not 1 <= side <= _LARGEST_SIDE_PX:
            raise document.error((key,), f"not an image size (got {side}, expected 1 to {_LARGEST_SIDE_PX})")
    K = _values(document, "camera_matrix", info.camera_matrix, (3, 3))
    if info.rectification_matrix is not None:
        _values(document, "rectification_matrix", info.rectification_matrix, (3, 3))
    if info.projection_matrix is not None:
        _values(document, "projection_matrix", info.projection_matrix, (3, 4))
    dist = _coefficients(document, info)
    try:
        return Camera((info.image_width, info.image_height), K, dist)
    except ValueError as error:
        raise document.error(("camera_matrix", "data"), str(error).partition(": ")[2]) from None


def _coefficients(document: Document, info: CameraInfo) -> FloatArray:
    """Distortion coefficients, shape (C,)."""
    name = info.distortion_model
    if name not in _LENSES:
        advice = "It is a fisheye model, whose numbers mean something else here." if name.lower() in _FISHEYES else ""
        problem = f"unsupported lens model (got {describe(name)}, expected {' or '.join(_LENSES)}). {advice}"
        raise document.error(("distortion_model",), problem.rstrip())
    matrix = info.distortion_coefficients
    count = len(matrix.data)
    if count not in _LENSES[name]:
        expected = " or ".join(str(n) for n in _LENSES[name] if n)
        problem = f"wrong number of coefficients for {name} (got {count}, expected {expected})"
        raise document.error(("distortion_coefficients", "data"), problem)
    # One row or one column: OpenCV writes either.
    shape = (count, 1) if matrix.cols == 1 and count else (1, count)
    return _values(document, "distortion_coefficients", matrix, shape).ravel() if count else np.zeros(0)


def _values(document: Document, key: str, matrix: Matrix, shape: tuple[int, int]) -> FloatArray:
    """Values of a matrix that must have a given shape."""
    for name, got, expected in (("rows", matrix.rows, shape[0]), ("cols", matrix.cols, shape[1])):
        if got != expected:
            raise document.error((key, name), f"wrong shape (got {matrix.rows}x{matrix.cols}, expected {shape[0]}x{shape[1]})")
    if len(matrix.data) != shape[0] * shape[1]:
        problem = f"wrong number of values (got {len(matrix.data)}, expected rows x cols = {shape[0] * shape[1]})"
        raise document.error((key, "data"), problem)
    return np.array(matrix.data).reshape(shape)


def _covariance(document: Document, known: Knowledge) -> FloatArray:
    """Rebuild the covariance: sigma_i sigma_j rho_ij."""
    if list(known.standard_deviations) != known.free:
        problem = f"not the free intrinsics (got {', '.join(known.standard_deviations)}, expected {', '.join(known.free)})"
        raise document.error(("camcal", "standard_deviations"), problem)
    for name, value in known.standard_deviations.items():
        if value < 0:
            raise document.error(("camcal", "standard_deviations", name), f"out of range (got {value}, expected at least 0)")
    count = len(known.free)
    path: KeyPath = ("camcal", "correlations")
    if len(known.correlations) != count or any(len(row) != count for row in known.correlations):
        raise document.error(path, f"wrong shape (expected {count}x{count}, a row and a column for each free intrinsic)")
    rho = np.array(known.correlations).reshape(count, count)
    off = np.abs(rho - rho.T) > _SYMMETRY_TOLERANCE
    if off.any() or (np.abs(rho) > 1 + _SYMMETRY_TOLERANCE).any() or (np.abs(np.diag(rho) - 1) > _SYMMETRY_TOLERANCE).any():
        raise document.error(path, "not correlations (expected a symmetric matrix within [-1, 1] and 1 on its diagonal)")
    sigma = np.array([known.standard_deviations[name] for name in known.free])
    covariance: FloatArray = np.outer(sigma, sigma) * rho
    return covariance
