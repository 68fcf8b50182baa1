"""camera.yaml: one file that ROS (camera_info), cv2.FileStorage and PyYAML all load, and how well the camera is known."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import camcal
from camcal.formats.camera_quick import read_quickly
from camcal.formats.output import write_atomically
from camcal.formats.text import file_in
from camcal.formats.versions import CAMERA_FORMAT_VERSION
from camcal.formats.yaml_plain import plain_yaml
from camcal.geometry.arrays import FloatArray
from camcal.observations import ImageSigma, Intrinsics, Uncertainty

CAMERA_FILE_NAME = "camera.yaml"

_RATIONAL_NAMES = ("k4", "k5", "k6")
_HEADING = """\
Pixels have whole-number centres: the centre of the top-left pixel is (0, 0). Coefficients stand in OpenCV's order.
uncertainty: 1 standard deviation of where a point is seen, px, at the middle of the image, of its edges (top, right, bottom,
left) and at its corners (clockwise from the top left); shares of the image where it is below 0.1, 0.5 and 1 px."""


def save_intrinsics(path: str | Path, intrinsics: Intrinsics) -> None:
    """Write a camera file.

    Parameters
    ----------
    path : str or Path
    intrinsics : Intrinsics

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_atomically(path, camera_yaml(intrinsics))


def load_intrinsics(path: str | Path) -> Intrinsics:
    """Read a camera file, camcal's own or ROS's camera_info.

    Parameters
    ----------
    path : str or Path
        A file, or a folder that holds `camera.yaml`.

    Returns
    -------
    Intrinsics
        The covariance is rebuilt from the standard deviations and correlations; without camcal's own mapping all that only it
        knows is empty.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: key: problem`.
    """
    file = file_in(path, CAMERA_FILE_NAME)
    known = read_quickly(file)
    if known is not None:
        return known
    # pydantic takes its time to import: only for files of other tools, and to say what is wrong with one.
    from camcal.formats.camera_schema import read_intrinsics

    return read_intrinsics(file)


def camera_yaml(intrinsics: Intrinsics) -> str:
    """Return the content of a camera file; the same intrinsics give the same bytes."""
    camera = intrinsics.camera
    rational = bool(camera.dist[5:].any()) or any(name in intrinsics.free for name in _RATIONAL_NAMES)
    content = {
        "image_width": camera.size[0],
        "image_height": camera.size[1],
        "camera_name": intrinsics.name,
        "distortion_model": "rational_polynomial" if rational else "plumb_bob",
        "camera_matrix": _matrix(camera.K),
        "distortion_coefficients": _matrix(camera.dist[None, : 8 if rational else 5]),
        "rectification_matrix": _matrix(np.eye(3)),
        "projection_matrix": _matrix(np.column_stack([camera.K, np.zeros(3)])),
        "camcal": {
            "format_version": CAMERA_FORMAT_VERSION,
            "version": camcal.__version__,
            "board": intrinsics.board,
            "free": list(intrinsics.free),
            "standard_deviations": intrinsics.sigma,
            "correlations": _correlations(intrinsics.covariance).tolist(),
            "rms_px": float(intrinsics.rms_px),
            "views": int(intrinsics.views),
            "corners": int(intrinsics.corners),
            "valid_radius_px": camera.valid_radius_px,
            **_judgement(intrinsics),
        },
    }
    plain = plain_yaml(content, _HEADING)
    if plain is not None:
        return plain
    from camcal.formats.yaml_dump import dump_yaml

    return dump_yaml(content, _HEADING)


def _judgement(intrinsics: Intrinsics) -> dict[str, Any]:
    """Lay out how far the camera can be trusted; what nobody worked out is left out."""
    content: dict[str, Any] = {}
    shape = intrinsics.shape
    if shape.names:
        content["board_shape"] = {
            "names": list(shape.names),
            "values": shape.values.tolist(),
            "standard_deviations": shape.sigma.tolist(),
            "correlations": _correlations(shape.covariance).tolist(),
        }
    if intrinsics.uncertainty is not None:
        content["uncertainty"] = uncertainty_values(intrinsics.uncertainty)
        content["cross_validation"] = float(intrinsics.cross_validation)
    if intrinsics.verdict is not None:
        content["verdict"] = intrinsics.verdict.word
        content["findings"] = [asdict(finding) for finding in intrinsics.verdict.findings]
    return content


def uncertainty_values(uncertainty: Uncertainty) -> dict[str, Any]:
    """Lay out an uncertainty as plain values: numbers, lists and mappings."""

    def over_image(sigma: ImageSigma) -> dict[str, Any]:
        return {
            "centre_px": sigma.centre_px,
            "edges_px": list(sigma.edges_px),
            "corners_px": list(sigma.corners_px),
            "shares": list(sigma.shares),
        }

    return {
        "range_m": uncertainty.range_m,
        "at_range": over_image(uncertainty.at_range),
        "at_infinity": over_image(uncertainty.at_infinity),
    }


def _matrix(values: FloatArray) -> dict[str, Any]:
    """Lay a matrix out as all three loaders expect it."""
    rows, columns = values.shape
    return {"rows": rows, "cols": columns, "dt": "d", "data": values.ravel().tolist()}


def _correlations(covariance: FloatArray) -> FloatArray:
    """Correlations of shape (F, F); a parameter without spread is correlated with nothing."""
    sigma = np.sqrt(np.diag(covariance))
    scale = np.outer(sigma, sigma)
    correlations: FloatArray = np.where(scale == 0, 0.0, covariance / np.where(scale == 0, 1.0, scale))
    np.fill_diagonal(correlations, 1.0)
    return correlations
