"""Each format loaded by the tool that it is for, which then projects the same points to the same pixels."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from exchange_cameras import CAMERAS, points, saved

from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.exchange.camera_json import camera_json_schema
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.workflows.export import export_camera

# The formula's few dozen roundings, each half of the last bit of a pixel coordinate below 2048, stay far below this.
CLOSE_PX = 1e-6
HELD = {
    "ros": ("pinhole", "radtan", "webcam", "rational"),
    "opencv": ("pinhole", "radtan", "webcam", "rational"),
    "kalibr": ("pinhole", "radtan"),
    "colmap": ("pinhole", "radtan", "webcam", "rational"),
    "mrcal": ("pinhole", "radtan", "webcam", "rational"),
    "nerfstudio": ("pinhole", "radtan", "webcam"),
    "matlab": ("pinhole", "radtan", "webcam", "skewed"),
}


def exported(tmp_path: Path, kind: str, name: str, file: str) -> Path:
    """A camera in a format; it must be the same camera."""
    path = tmp_path / file
    done = export_camera(saved(tmp_path, name), kind, path)
    assert (done.lost, done.max_px, done.rms_px) == ((), 0.0, 0.0)
    return path


def check(camera: Camera, pixels: np.ndarray, close_px: float = CLOSE_PX) -> None:
    """The other tool sees the points where the camera does."""
    assert pixels.shape == (1000, 2)
    assert np.abs(pixels - camera.project(points(camera))).max() < close_px


def by_opencv(camera: Camera, K: np.ndarray, dist: np.ndarray) -> np.ndarray:
    """Where OpenCV sees the points."""
    zero = np.zeros(3)
    return cv2.projectPoints(points(camera), zero, zero, K, dist)[0].reshape(-1, 2)


@pytest.mark.parametrize("name", HELD["opencv"])
@pytest.mark.parametrize("suffix", [".yaml", ".yml", ".xml", ".json"])
def test_opencv(tmp_path, name, suffix):
    """cv2.FileStorage gives the matrices bit for bit, and cv2.projectPoints the same pixels."""
    path = exported(tmp_path, "opencv", name, f"o{suffix}")
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    K, dist = storage.getNode("camera_matrix").mat(), storage.getNode("distortion_coefficients").mat()
    camera = CAMERAS[name]
    assert K.tobytes() == camera.K.tobytes()
    assert dist.ravel().tobytes() == camera.dist[: dist.size].tobytes()
    size = storage.getNode("image_width").real(), storage.getNode("image_height").real()
    assert (size, storage.getNode("camera_name").string()) == (camera.size, name)
    check(camera, by_opencv(camera, K, dist))


@pytest.mark.parametrize("suffix", [".yaml", ".xml", ".json"])
def test_opencv_with_any_name(tmp_path, suffix):
    """A name with quotes, markup, dashes, line ends and what XML forbids harms no file."""
    source = saved(tmp_path, "webcam", name='a "b" <c> & --- \n d\x07 é: #')
    path = tmp_path / f"o{suffix}"
    export_camera(source, "opencv", path)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.getNode("camera_matrix").mat().tobytes() == CAMERAS["webcam"].K.tobytes()
    assert storage.getNode("camera_name").string() == load_intrinsics(path).name == 'a "b" <c> & --- d é: #'
    assert load_intrinsics(path).camera.K.tobytes() == CAMERAS["webcam"].K.tobytes()
    for other in ("ros", "kalibr", "colmap", "mrcal", "matlab"):
        content = str(export_camera(source, other, max_refit_px=10).content)
        assert not re.search(r"[^\n -~é]", content)


@pytest.mark.parametrize("name", HELD["ros"])
def test_ros(tmp_path, name):
    """PyYAML finds the keys of camera_info, in ROS's layout and without ours; OpenCV, which image_geometry asks, agrees."""
    info = yaml.safe_load(exported(tmp_path, "ros", name, "info.yaml").read_text())
    camera = CAMERAS[name]
    assert list(info) == [
        *("image_width", "image_height", "camera_name", "distortion_model", "camera_matrix", "distortion_coefficients"),
        *("rectification_matrix", "projection_matrix"),
    ]
    shapes = {"camera_matrix": (3, 3), "rectification_matrix": (3, 3), "projection_matrix": (3, 4)}
    matrices = {key: np.array(info[key]["data"]).reshape(shape) for key, shape in shapes.items()}
    assert all((info[key]["rows"], info[key]["cols"]) == shape for key, shape in shapes.items())
    dist = np.array(info["distortion_coefficients"]["data"])
    assert (info["distortion_model"], dist.size) == (("rational_polynomial", 8) if name == "rational" else ("plumb_bob", 5))
    assert (info["image_width"], info["image_height"]) == camera.size
    np.testing.assert_array_equal(matrices["projection_matrix"], np.column_stack([camera.K, np.zeros(3)]))
    np.testing.assert_array_equal(matrices["rectification_matrix"], np.eye(3))
    check(camera, by_opencv(camera, matrices["camera_matrix"], dist))


@pytest.mark.parametrize("name", HELD["kalibr"])
def test_kalibr(tmp_path, name):
    """PyYAML, with which Kalibr reads, gives the types that Kalibr asks for; radtan is k1 k2 p1 p2."""
    chain = yaml.safe_load(exported(tmp_path, "kalibr", name, "camchain.yaml").read_text())
    entry = chain["cam0"]
    assert (entry["camera_model"], entry["distortion_model"]) == ("pinhole", "radtan")
    assert isinstance(entry["rostopic"], str)
    assert [type(value) for value in entry["intrinsics"] + entry["distortion_coeffs"]] == [float] * 8
    assert [type(value) for value in entry["resolution"]] == [int] * 2
    camera = CAMERAS[name]
    assert tuple(entry["resolution"]) == camera.size
    fx, fy, cx, cy = entry["intrinsics"]
    k1, k2, p1, p2 = entry["distortion_coeffs"]
    x, y = (points(camera)[:, :2] / points(camera)[:, 2:]).T
    # aslam_cv's RadialTangentialDistortion: u += u rad + 2 p1 uv + p2 (rho + 2u²), with rho = u² + v².
    rho = x * x + y * y
    radial = k1 * rho + k2 * rho**2
    u = x + x * radial + 2 * p1 * x * y + p2 * (rho + 2 * x * x)
    v = y + y * radial + 2 * p2 * x * y + p1 * (rho + 2 * y * y)
    check(camera, np.column_stack([fx * u + cx, fy * v + cy]))


@pytest.mark.parametrize("name", HELD["colmap"])
@pytest.mark.parametrize("file", ["cameras.txt", "cameras.bin"])
def test_colmap(tmp_path, name, file):
    """Pycolmap loads text and binary and projects; its pixels lie half a pixel further."""
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
    exported(tmp_path, "colmap", name, file)
    ending = file.partition(".")[2]
    for other in ("images", "points3D", "rigs", "frames"):
        # An empty list: no bytes in text, a count of 0 in binary.
        (tmp_path / f"{other}.{ending}").write_bytes(b"" if ending == "txt" else bytes(8))
    reconstruction = pycolmap.Reconstruction(tmp_path)
    camera, loaded = CAMERAS[name], reconstruction.cameras[1]
    model = {"pinhole": "PINHOLE", "radtan": "OPENCV"}.get(name, "FULL_OPENCV")
    assert (loaded.model.name, (loaded.width, loaded.height)) == (model, camera.size)
    check(camera, np.asarray(loaded.img_from_cam(points(camera))) - 0.5)


MRCAL = """
import sys, json, numpy, mrcal
model = mrcal.cameramodel(sys.argv[1])
points = numpy.array(json.load(sys.stdin))
name, values = model.intrinsics()
print(json.dumps([name, model.imagersize().tolist(), mrcal.project(points, name, values).tolist()]))
"""


@pytest.mark.parametrize("name", HELD["mrcal"])
def test_mrcal(mrcal_python, tmp_path, name):
    """Mrcal loads the model and projects."""
    path = exported(tmp_path, "mrcal", name, "camera.cameramodel")
    camera = CAMERAS[name]
    given = json.dumps(points(camera).tolist())
    done = subprocess.run([mrcal_python, "-c", MRCAL, path], input=given, capture_output=True, text=True, check=True)
    model, size, pixels = json.loads(done.stdout)
    expected = {"pinhole": "PINHOLE", "radtan": "OPENCV4", "webcam": "OPENCV5", "rational": "OPENCV8"}[name]
    assert (model, tuple(size)) == (f"LENSMODEL_{expected}", camera.size)
    check(camera, np.array(pixels))


@pytest.mark.parametrize("name", HELD["nerfstudio"])
def test_nerfstudio(tmp_path, name):
    """The keys that nerfstudio reads; it undistorts by cv2 with half a pixel less and the order k1 k2 p1 p2 k3, k4 = 0."""
    data = json.loads(exported(tmp_path, "nerfstudio", name, "transforms.json").read_text())
    camera = CAMERAS[name]
    assert (data["camera_model"], data["k4"], data["frames"]) == ("OPENCV", 0, [])
    assert (data["w"], data["h"]) == camera.size
    K = np.array([[data["fl_x"], 0, data["cx"] - 0.5], [0, data["fl_y"], data["cy"] - 0.5], [0, 0, 1]])
    check(camera, by_opencv(camera, K, np.array([data[key] for key in ("k1", "k2", "p1", "p2", "k3")])))


@pytest.mark.parametrize("name", HELD["matlab"])
@pytest.mark.parametrize("suffix", [".m", ".json"])
def test_matlab(tmp_path, name, suffix):
    """cameraIntrinsics([fx fy], [cx cy], [rows columns], ...), whose first pixel is (1, 1), by MATLAB's documented formula."""
    text = exported(tmp_path, "matlab", name, f"camera{suffix}").read_text()
    names = ("FocalLength", "PrincipalPoint", "ImageSize", "RadialDistortion", "TangentialDistortion")
    if suffix == ".json":
        values = json.loads(text)
        skew = values["Skew"]
    else:
        assert re.search(r"^intrinsics = cameraIntrinsics\(\[", text, re.MULTILINE)
        code = re.sub(r"%.*", "", text)
        values = dict(zip(names, [[float(word) for word in v.split()] for v in re.findall(r"\[([^]]*)\]", code)], strict=True))
        skew = float(re.search(r"'Skew', (\S+)\);", code)[1])
    camera = CAMERAS[name]
    assert tuple(values["ImageSize"]) == camera.size[::-1]
    (fx, fy), (cx, cy), _, (k1, k2, k3), (p1, p2) = (values[key] for key in names)
    x, y = (points(camera)[:, :2] / points(camera)[:, 2:]).T
    r2 = x**2 + y**2
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    check(camera, np.column_stack([fx * u + skew * v + cx, fy * v + cy]) - 1)


@pytest.mark.parametrize("name", CAMERAS)
def test_json_against_its_schema(tmp_path, name):
    """Every camera fits our JSON; what is not known is null, and a wrong key is refused."""
    jsonschema = pytest.importorskip("jsonschema", reason="jsonschema is not installed")
    data = json.loads(exported(tmp_path, "json", name, "camera.json").read_text())
    jsonschema.Draft202012Validator.check_schema(camera_json_schema())
    jsonschema.validate(data, camera_json_schema())
    assert data["camcal"]["rms_px"] is None
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(data | {"fz": 1}, camera_json_schema())
    camera = CAMERAS[name]
    K = np.array([[data["fx"], data["skew"], data["cx"]], [0, data["fy"], data["cy"]], [0, 0, 1]])
    dist = np.array([data["distortion"][key] for key in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")])
    pixels = by_opencv(camera, K, dist)
    # OpenCV leaves the skew out.
    pixels[:, 0] += data["skew"] * (pixels[:, 1] - K[1, 2]) / K[1, 1]
    check(camera, pixels)


@pytest.mark.parametrize("size", [(640, 480), (480, 641), (6000, 4000)])
@pytest.mark.parametrize("options", [{}, {"crop_factor": 5.6}, {"focal_mm": 4.2}, {"crop_factor": 5.6, "focal_mm": 4.2}])
def test_lensfun(tmp_path, size, options):
    """Lensfun distorts ideal pixels as the camera does, to what its 32-bit floats resolve, off-centre lens included."""
    lensfunpy = pytest.importorskip("lensfunpy", reason="lensfunpy is not installed")
    width, height = size
    f = 0.8 * max(size)
    camera = Camera(size, [[f, 0, 0.47 * width], [0, f, 0.54 * height], [0, 0, 1]], [-0.18, 0.06])
    source = tmp_path / "camera.yaml"
    save_intrinsics(source, Intrinsics(camera, "the camera"))
    done = export_camera(source, "lensfun", lens_name="Lens & Co 4.2mm", **options)
    assert done.lost == ()
    database = lensfunpy.Database(xml=done.content, load_common=False, load_bundled=False)
    (body,) = database.find_cameras("camcal", "the camera")
    lens = database.find_lenses(body, "camcal", "Lens & Co 4.2mm")[0]
    assert lens.min_focal == pytest.approx(options.get("focal_mm", lens.min_focal))
    assert body.crop_factor == pytest.approx(options.get("crop_factor", body.crop_factor))
    modifier = lensfunpy.Modifier(lens, body.crop_factor, width, height)
    modifier.initialize(lens.min_focal, 4.0, 10.0, scale=1.0, flags=lensfunpy.ModifyFlags.DISTORTION)
    ideal = np.random.default_rng(1).uniform([0, 0], np.array(size) - 1, (1000, 2)).astype(np.float32).astype(float)
    # One by one: along a row lensfun adds up its 32-bit steps.
    found = np.array([modifier.apply_geometry_distortion(u, v, 1, 1)[0, 0] for u, v in ideal], dtype=float)
    rays = np.column_stack([(ideal - camera.K[:2, 2]) / f, np.ones(1000)])
    # A few roundings of coordinates up to the image's side, to 24 bits.
    close_px = 4 * max(size) * 2.0**-24
    assert np.abs(found - camera.project(rays)).max() < close_px
    assert np.abs(ideal - found).max() > 0.02 * max(size)
