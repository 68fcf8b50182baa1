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
from camcal.records import ImageSigma, Intrinsics, Uncertainty

CAMERA_FILE_NAME = "camera.yaml"

_CHOICE = "#"
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
    """Read a camera file: camcal's own, or one of ROS, OpenCV, Kalibr, COLMAP, mrcal, nerfstudio, MATLAB, or our JSON.

    Parameters
    ----------
    path : str or Path
        A file, or a folder that holds `camera.yaml`. `FILE#NAME` is the camera of that name in a file that has several.

    Returns
    -------
    Intrinsics
        The covariance is rebuilt from the standard deviations and correlations; what only camcal knows is empty for the files
        of other tools.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: key: problem`.

    Examples
    --------
    >>> import tempfile, camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     camcal.save_intrinsics(f"{folder}/camera.yaml", camcal.Intrinsics(camera, name="left"))
    ...     known = camcal.load_intrinsics(folder)
    >>> known.name, known.camera
    ('left', Camera(640x480, fx=520, fy=523, cx=322, cy=236))
    """
    file = file_in(path, CAMERA_FILE_NAME)
    known = read_quickly(file)
    if known is not None:
        return known
    # pydantic takes its time to import: only for files of other tools, and to say what is wrong with one.
    from camcal.formats.exchange.reading import read_any

    return read_any(file)


def split_choice(path: str | Path) -> tuple[Path, str | None]:
    """Take `FILE#NAME` apart; a file that has such a name itself stays whole."""
    file, mark, choice = str(path).rpartition(_CHOICE)
    try:
        whole = not mark or not file or Path(path).exists() or not Path(file).is_file()
    except OSError:
        whole = True
    return (Path(path), None) if whole else (Path(file), choice)


def camera_yaml(intrinsics: Intrinsics) -> str:
    """Return the content of a camera file; the same intrinsics give the same bytes."""
    content = camera_info(intrinsics) | {"camcal": camera_knowledge(intrinsics)}
    plain = plain_yaml(content, _HEADING)
    if plain is not None:
        return plain
    from camcal.formats.yaml_dump import dump_yaml

    return dump_yaml(content, _HEADING)


def camera_info(intrinsics: Intrinsics) -> dict[str, Any]:
    """Lay out the camera itself, under ROS's keys."""
    camera = intrinsics.camera
    rational = bool(camera.dist[5:].any()) or any(name in intrinsics.free for name in _RATIONAL_NAMES)
    return {
        "image_width": camera.size[0],
        "image_height": camera.size[1],
        "camera_name": intrinsics.name,
        "distortion_model": "rational_polynomial" if rational else "plumb_bob",
        "camera_matrix": _matrix(camera.K),
        "distortion_coefficients": _matrix(camera.dist[None, : 8 if rational else 5]),
        "rectification_matrix": _matrix(np.eye(3)),
        "projection_matrix": _matrix(np.column_stack([camera.K, np.zeros(3)])),
    }


def camera_knowledge(intrinsics: Intrinsics) -> dict[str, Any]:
    """Lay out what only camcal knows of a camera: plain numbers, text, lists and mappings."""
    return {
        "format_version": CAMERA_FORMAT_VERSION,
        "version": camcal.__version__,
        "board": intrinsics.board,
        "free": list(intrinsics.free),
        "standard_deviations": intrinsics.sigma,
        "correlations": _correlations(intrinsics.covariance).tolist(),
        "rms_px": float(intrinsics.rms_px),
        "views": int(intrinsics.views),
        "corners": int(intrinsics.corners),
        "valid_radius_px": intrinsics.camera.valid_radius_px,
        **_judgement(intrinsics),
    }


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
