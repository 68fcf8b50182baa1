"""cv2.FileStorage's YAML, XML and JSON, under the names that OpenCV's samples, its tools and people's scripts use."""

from __future__ import annotations

import json
import re
from typing import Any
from xml.sax.saxutils import escape

from camcal.formats.camera_schema import FISHEYES
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
    one_line,
    xml_comment,
)
from camcal.formats.exchange.values import numbers, whole
from camcal.formats.exchange.window import cautions_of
from camcal.formats.exchange.xml_in import Element
from camcal.formats.yaml_io import Document, KeyPath, describe, resolve
from camcal.formats.yaml_plain import float_text

PROFILE = Profile("opencv", "OpenCV's FileStorage", (COEFFICIENTS[:5], COEFFICIENTS), (".yaml", ".yml", ".xml", ".json"))

_K_NAMES = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "intrinsic_matrix", "mtx", "K", "k")
_DIST_NAMES = (
    *("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs", "dist_coeff", "dist_coefs"),
    *("distCoeff", "distortion_coeffs", "distortionCoefficients", "distortion", "dist", "D", "d"),
)
# Keys that may mean a distortion, and those of them that do not.
_LIKE_DIST = re.compile(r"dist(?!ance)|coef", re.IGNORECASE)
_NOT_DIST = re.compile(r"model|std|error|dev", re.IGNORECASE)
_SIDES = (("image_width", "image_height"), ("image_Width", "image_Height"), ("width", "height"), ("w", "h"))
_SIZES = ("cameraResolution", "image_size", "imageSize", "size", "resolution")
# What stereo samples write for the left and the right camera.
_PAIRS = (
    *(("M1", "D1"), ("M2", "D2"), ("K1", "D1"), ("K2", "D2")),
    *(("cameraMatrix1", "distCoeffs1"), ("cameraMatrix2", "distCoeffs2")),
)
_COUNTS = (4, 5, 8, 12, 14)
_LENS_MODELS = ("", "plumb_bob", "rational_polynomial", "opencv", "pinhole")


def matches(loaded: Loaded) -> bool:
    """Tell whether a file has a camera matrix under a common name."""
    if loaded.root is not None:
        return loaded.root.tag == "opencv_storage"
    return any(name in loaded.data for name in (*_K_NAMES, *(pair[0] for pair in _PAIRS)))


def read(loaded: Loaded) -> list[Exchanged]:
    """Read the camera, or the two of a stereo calibration."""
    document = loaded.document if loaded.root is None else _document(loaded.name, loaded.root)
    data = document.data
    single = next((name for name in _K_NAMES if name in data), None)
    if single is not None:
        name = str(data.get("camera_name") or "camera")
        return [_camera(document, name, single, _dist_key(document))]
    pairs = [pair for pair in _PAIRS if pair[0] in data]
    if not pairs:
        raise document.error((), f"no camera matrix (expected a key such as {', '.join(_K_NAMES[:2])} or K)")
    return [_camera(document, K_key, K_key, dist_key if dist_key in data else None) for K_key, dist_key in pairs]


def write(outgoing: Outgoing) -> str:
    """Write the names of OpenCV's calibration sample."""
    width, height = outgoing.known.camera.size
    dist = outgoing.coefficients(*outgoing.lens)
    matrices = {
        "camera_matrix": (3, 3, outgoing.known.camera.K.ravel().tolist()),
        "distortion_coefficients": (1, len(dist), dist),
    }
    writer = {".xml": _xml, ".json": _json}.get(outgoing.suffix, _yaml)
    return writer(outgoing, {"image_width": width, "image_height": height}, matrices)


_Matrices = dict[str, tuple[int, int, list[float]]]


def _yaml(outgoing: Outgoing, sides: dict[str, int], matrices: _Matrices) -> str:
    """Write OpenCV's YAML."""
    lines = ["%YAML 1.2", "---", *outgoing.comments("#").splitlines()]
    lines.append(f"camera_name: {json.dumps(one_line(outgoing.known.name), ensure_ascii=False)}")
    lines += [f"{name}: {side}" for name, side in sides.items()]
    for name, (rows, columns, values) in matrices.items():
        data = ", ".join(map(float_text, values))
        lines += [f"{name}: !!opencv-matrix", f"   rows: {rows}", f"   cols: {columns}", "   dt: d", f"   data: [ {data} ]"]
    return "\n".join([*lines, ""])


def _xml(outgoing: Outgoing, sides: dict[str, int], matrices: _Matrices) -> str:
    """Write OpenCV's XML."""
    lines = ['<?xml version="1.0"?>', "<opencv_storage>", xml_comment(outgoing.heading)]
    # OpenCV wants every mark of its own written out within quotes.
    name = escape(one_line(outgoing.known.name), {"'": "&apos;", '"': "&quot;"})
    lines.append(f'<camera_name>"{name}"</camera_name>')
    lines += [f"<{name}>{side}</{name}>" for name, side in sides.items()]
    for name, (rows, columns, values) in matrices.items():
        data = " ".join(map(float_text, values))
        lines += [f'<{name} type_id="opencv-matrix">', f"  <rows>{rows}</rows>", f"  <cols>{columns}</cols>"]
        lines += ["  <dt>d</dt>", f"  <data>{data}</data></{name}>"]
    return "\n".join([*lines, "</opencv_storage>", ""])


def _json(outgoing: Outgoing, sides: dict[str, int], matrices: _Matrices) -> str:
    """Write OpenCV's JSON."""
    content: dict[str, Any] = {"camera_name": one_line(outgoing.known.name), **sides}
    for name, (rows, columns, values) in matrices.items():
        content[name] = {"type_id": "opencv-matrix", "rows": rows, "cols": columns, "dt": "d", "data": values}
    return json.dumps(content, indent=4, ensure_ascii=False) + "\n"


def _camera(document: Document, name: str, K_key: str, dist_key: str | None) -> Exchanged:
    """Read one camera; one with another lens model is faulty."""
    data = document.data
    model = data.get("distortion_model", "")
    if data.get("fisheye_model") in (1, True, "1"):
        return faulty(document, ("fisheye_model",), name, fisheye_problem("fisheye", "plumb_bob or rational_polynomial"))
    # Old files of ROS call it camera_model, under which others keep the name of a product.
    for key in ("distortion_model", "camera_model"):
        if str(data.get(key, "")).lower() in FISHEYES:
            return faulty(document, (key,), name, fisheye_problem(data[key], "plumb_bob or rational_polynomial"))
    if model not in _LENS_MODELS:
        return faulty(document, ("distortion_model",), name, fisheye_problem(model, "plumb_bob or rational_polynomial"))
    K = numbers(document, (K_key,), (9,))
    dist = [] if dist_key is None else numbers(document, (dist_key,), (0, *_COUNTS))
    if any(dist[8:]):
        extra = "thin-prism" if any(dist[8:12]) else "tilt"
        return faulty(document, (str(dist_key),), name, f"{extra} coefficients (expected 0): camcal's lens has none")
    fx, skew, cx, zero, fy, cy, *last = K
    if not any(K):
        raise document.error((K_key,), "all zeros (expected fx, fy, cx, cy): this camera has not been calibrated")
    if zero != 0 or last != [0, 0, 1]:
        problem = f"not an intrinsic matrix (got {describe(K)}, expected [fx, s, cx, 0, fy, cy, 0, 0, 1])"
        raise document.error((K_key,), problem)
    size = _size(document)
    # ROS's messages have these names.
    camera = Exchanged(name, Pinhole(fx, fy, cx, cy, skew), tuple(dist[:8]), size, cautions=cautions_of(document, size))
    return checked(document, (K_key,), camera)


def _dist_key(document: Document) -> str | None:
    """Find the distortion coefficients; None if the camera has none."""
    known = next((name for name in _DIST_NAMES if name in document.data), None)
    if known is None:
        like = [name for name in document.data if _LIKE_DIST.search(name) and not _NOT_DIST.search(name)]
        if like:
            # Who passes over coefficients under another name has another camera.
            raise document.error((like[0],), f"unknown name (expected {', '.join(_DIST_NAMES[:3])} or D). Rename it.")
    return known


def _size(document: Document) -> tuple[int, int] | None:
    """Read the image size; None if there is none."""
    data = document.data
    for width, height in _SIDES:
        if width in data and height in data:
            return whole(document, (width,)), whole(document, (height,))
    for name in _SIZES:
        if isinstance(data.get(name), list) and len(data[name]) == 2:
            return whole(document, (name, 0)), whole(document, (name, 1))
    return None


def _document(name: str, root: Element) -> Document:
    """Turn OpenCV's XML into the mapping that its YAML would be."""
    lines: dict[KeyPath, int] = {(): root.line}
    data: dict[str, Any] = {}
    for element in root.children:
        lines[element.tag,] = element.line
        if element.child("data") is not None:
            data[element.tag] = {child.tag: child.text for child in element.children}
            data[element.tag]["data"] = [resolve(word) for word in element.child_text("data").split()]
        elif not element.children:
            words = element.text.split()
            quoted = element.text.startswith('"')
            data[element.tag] = [resolve(word) for word in words] if len(words) > 1 and not quoted else resolve(element.text)
            if quoted:
                data[element.tag] = element.text.removeprefix('"').removesuffix('"')
    return Document(name, data, lines)
