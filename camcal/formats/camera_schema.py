"""The way from a camera file to intrinsics, with what its layout alone cannot tell checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from camcal.formats.camera_layout import (
    LARGEST_SIDE_PX,
    LENSES,
    CameraFile,
    CameraInfo,
    ImageSigmaEntry,
    Knowledge,
    Matrix,
    ShapeEntry,
    UncertaintyEntry,
)
from camcal.formats.validation import validate
from camcal.formats.versions import CAMERA_FORMAT_VERSION
from camcal.formats.yaml_io import Document, KeyPath, describe
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.records import BoardShape, ImageSigma, Intrinsics, Uncertainty
from camcal.verdict import Finding, Verdict

FISHEYES = ("equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "omnidirectional", "mei")
# Correlations are written to the last bit; a person may round them.
_SYMMETRY_TOLERANCE = 1e-6


def intrinsics_of(document: Document) -> Intrinsics:
    """Build what a camera file's document holds, camcal's own or ROS's camera_info.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: key`.
    """
    if "camcal" not in document.data:
        info = validate(document, CameraInfo)
        return Intrinsics(_camera(document, info), info.camera_name)
    check_format_version(document, ("camcal",), CAMERA_FORMAT_VERSION)
    file = validate(document, CameraFile)
    return _known(document, file.camcal, _camera(document, file), file.camera_name)


def knowledge_of(document: Document, camera: Camera, name: str) -> Intrinsics:
    """Build what the `camcal` mapping of a document says of a camera.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: key`.
    """
    check_format_version(document, ("camcal",), CAMERA_FORMAT_VERSION)
    return _known(document, validate(document, Knowledge, ("camcal",)), camera, name)


def _known(document: Document, known: Knowledge, camera: Camera, name: str) -> Intrinsics:
    """Check what a model alone cannot, and build the intrinsics."""
    free = tuple(known.free)
    if free != tuple(name for name in camera.intrinsic_names if name in free):
        expected = ", ".join(camera.intrinsic_names)
        got = ", ".join(free)
        problem = f"not names of intrinsics in their order (got {got}, expected some of {expected})"
        raise document.error(("camcal", "free"), problem)
    _check_free(document, known)
    return Intrinsics(
        camera=camera,
        name=name,
        board=known.board,
        free=free,
        covariance=_covariance(document, ("camcal",), known.free, list(known.standard_deviations.values()), known.correlations),
        rms_px=known.rms_px,
        views=known.views,
        corners=known.corners,
        shape=_shape(document, known.board_shape),
        uncertainty=_uncertainty(known.uncertainty),
        cross_validation=known.cross_validation,
        verdict=_verdict(document, known),
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
        if not 1 <= side <= LARGEST_SIDE_PX:
            raise document.error((key,), f"not an image size (got {side}, expected 1 to {LARGEST_SIDE_PX})")
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
    if name not in LENSES:
        advice = "It is a fisheye model, whose numbers mean something else here." if name.lower() in FISHEYES else ""
        problem = f"unsupported lens model (got {describe(name)}, expected {' or '.join(LENSES)}). {advice}"
        raise document.error(("distortion_model",), problem.rstrip())
    matrix = info.distortion_coefficients
    count = len(matrix.data)
    if count not in LENSES[name]:
        expected = " or ".join(str(n) for n in LENSES[name] if n)
        other = next((lens for lens, counts in LENSES.items() if count in counts), None)
        advice = "" if other is None else f". Are they those of {other}? Then name it so."
        problem = f"wrong number of coefficients for {name} (got {count}, expected {expected}){advice}"
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


def _covariance(
    document: Document, path: KeyPath, names: Sequence[str], sigmas: Sequence[float], correlations: Sequence[Sequence[float]]
) -> FloatArray:
    """Rebuild a covariance: sigma_i sigma_j rho_ij."""
    for name, value in zip(names, sigmas, strict=True):
        if value < 0:
            problem = f"{name} is out of range (got {value}, expected at least 0)"
            raise document.error((*path, "standard_deviations"), problem)
    count = len(names)
    where: KeyPath = (*path, "correlations")
    if len(correlations) != count or any(len(row) != count for row in correlations):
        raise document.error(where, f"wrong shape (expected {count}x{count}, a row and a column for each parameter)")
    rho = np.array(correlations).reshape(count, count)
    # Infinity less itself is no number; that it is too large shows below.
    with np.errstate(invalid="ignore"):
        off = np.abs(rho - rho.T) > _SYMMETRY_TOLERANCE
    if off.any() or (np.abs(rho) > 1 + _SYMMETRY_TOLERANCE).any() or (np.abs(np.diag(rho) - 1) > _SYMMETRY_TOLERANCE).any():
        raise document.error(where, "not correlations (expected a symmetric matrix within [-1, 1] and 1 on its diagonal)")
    covariance: FloatArray = np.outer(sigmas, sigmas) * rho
    return covariance


def _check_free(document: Document, known: Knowledge) -> None:
    """Refuse standard deviations of other parameters than the free ones."""
    if list(known.standard_deviations) != known.free:
        problem = f"not the free intrinsics (got {', '.join(known.standard_deviations)}, expected {', '.join(known.free)})"
        raise document.error(("camcal", "standard_deviations"), problem)


def _shape(document: Document, entry: ShapeEntry | None) -> BoardShape:
    """Read the board's shape; nothing is known of it where there is none."""
    if entry is None:
        return BoardShape()
    path: KeyPath = ("camcal", "board_shape")
    for key, values in (("values", entry.values), ("standard_deviations", entry.standard_deviations)):
        if len(values) != len(entry.names):
            raise document.error((*path, key), f"wrong number of values (got {len(values)}, expected {len(entry.names)})")
    covariance = _covariance(document, path, entry.names, entry.standard_deviations, entry.correlations)
    return BoardShape(tuple(entry.names), np.array(entry.values), covariance)


def _uncertainty(entry: UncertaintyEntry | None) -> Uncertainty | None:
    """Read the uncertainty of the projection; None where there is none."""
    if entry is None:
        return None

    def over_image(values: ImageSigmaEntry) -> ImageSigma:
        top, right, bottom, left = values.edges_px
        first, second, third, fourth = values.corners_px
        tenth, half, whole = values.shares
        return ImageSigma(values.centre_px, (top, right, bottom, left), (first, second, third, fourth), (tenth, half, whole))

    return Uncertainty(entry.range_m, over_image(entry.at_range), over_image(entry.at_infinity))


def _verdict(document: Document, known: Knowledge) -> Verdict | None:
    """Read the verdict; its word must be the one that its findings make."""
    if known.verdict is None:
        return None
    verdict = Verdict(tuple(Finding(f.code, f.level, f.weight, f.text, f.advice) for f in known.findings))
    if verdict.word != known.verdict:
        problem = f"contradicts its findings (got '{known.verdict}', expected '{verdict.word}')"
        raise document.error(("camcal", "verdict"), problem)
    return verdict
