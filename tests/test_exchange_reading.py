"""Cameras out of files as other tools write them: recognised by content, in our conventions, refused by name if not ours."""

from __future__ import annotations

import json
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exchange_cameras import CAMERAS, WEBCAM, K, same, saved

from camcal.cli import main
from camcal.errors import InputError, QualityError
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.exchange.table import FORMATS
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.verdict import Finding, Verdict
from camcal.workflows.export import export_camera
from camcal.workflows.import_ import import_camera

FILES = {
    "ros": ("camera.yaml",),
    "opencv": ("camera.yml", "camera.xml", "camera.json"),
    "kalibr": ("camchain.yaml",),
    "colmap": ("cameras.txt", "cameras.bin"),
    "mrcal": ("camera.cameramodel",),
    "nerfstudio": ("transforms.json",),
    "matlab": ("camera.m", "camera.json"),
    "lensfun": ("lens.xml",),
    "json": ("camera.json",),
}
# These move the principal point by half a pixel or a whole one: the last bit of it may be lost each way.
MOVED = {"colmap": 2, "nerfstudio": 2, "matlab": 2}


def write(folder: Path, name: str, text: str) -> Path:
    """A file with a text."""
    path = folder / name
    path.write_text(text)
    return path


HELD = [
    (kind, file, name)
    for kind, files in FILES.items()
    for name, camera in CAMERAS.items()
    if not FORMATS[kind].profile.missing(camera)
    for file in files
]


@pytest.mark.parametrize(("kind", "file", "name"), HELD)
def test_what_is_written_is_read_again(tmp_path, kind, file, name):
    """Whatever a format holds comes back bit for bit, recognised under a name that says nothing."""
    export_camera(saved(tmp_path, name), kind, tmp_path / file)
    nameless = (tmp_path / file).rename(tmp_path / "file")
    size = CAMERAS[name].size if kind == "lensfun" else None
    found = import_camera(nameless, size=size).camera
    if kind == "lensfun":
        # Two divisions and two products.
        np.testing.assert_allclose(found.intrinsics, CAMERAS[name].intrinsics, rtol=8 * 2.0**-53, atol=0)
    else:
        same(CAMERAS[name], found, MOVED.get(kind, 0))
        same(found, load_intrinsics(nameless).camera)


def test_all_that_is_known_goes_through_json(tmp_path, calibrated):
    """A calibration through our JSON and back is the same file, byte for byte."""
    export_camera(calibrated, "json", tmp_path / "camera.json")
    import_camera(tmp_path / "camera.json", tmp_path / "camera.yaml")
    assert (tmp_path / "camera.yaml").read_bytes() == (calibrated / "camera.yaml").read_bytes()


def test_our_own_file_is_imported_as_it_is(tmp_path, calibrated):
    """Nothing is lost either, from the file or its folder."""
    import_camera(calibrated, tmp_path / "camera.yaml")
    assert (tmp_path / "camera.yaml").read_bytes() == (calibrated / "camera.yaml").read_bytes()


OPENCV_SAMPLE = """\
%YAML:1.0
---
calibration_time: "Thu Jan  1 00:00:00 2026"
nframes: 13
image_width: 640
image_height: 480
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.3591573396163199e+02, 0., 3.4228315473308373e+02, 0.,
       5.3591573396163199e+02, 2.3557082909788173e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.6637260909660682e-01, -3.8588898922304653e-02,
       1.7831947042852964e-03, -2.8122100441115472e-04,
       2.3839153080878486e-01 ]
avg_reprojection_error: 3.9259109564815858e-01
"""
MATRIX = "<rows>3</rows><cols>3</cols><dt>d</dt><data>\n 657.5 0. 319.5 0. 658.5\n 239.5 0. 0. 1.</data>"
INTERACTIVE = f"""\
<?xml version="1.0"?>
<opencv_storage>
<calibrationDate>"Mon Jan  5 2026"</calibrationDate>
<cameraResolution>
  1280 720</cameraResolution>
<cameraMatrix type_id="opencv-matrix">{MATRIX}</cameraMatrix>
<dist_coeffs type_id="opencv-matrix"><rows>1</rows><cols>5</cols><dt>d</dt><data>-.41 .57 0. 0. -.58</data></dist_coeffs>
<cameraMatrix_std_dev type_id="opencv-matrix"><rows>1</rows><cols>1</cols><dt>d</dt><data>0.</data></cameraMatrix_std_dev>
</opencv_storage>
"""
OLD_SAMPLE = f"""\
<?xml version="1.0"?>
<opencv_storage>
<image_Width>640</image_Width><image_Height>480</image_Height>
<Camera_Matrix type_id="opencv-matrix">{MATRIX}</Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix"><rows>4</rows><cols>1</cols><dt>d</dt>
  <data>-.41 .57 1e-3 2e-3</data></Distortion_Coefficients>
</opencv_storage>
"""
ROS_MESSAGE = """\
header:
  frame_id: camera
height: 480
width: 640
distortion_model: plumb_bob
d: [0.1, -0.2, 0.001, 0.002, 0.03]
k: [500.0, 0.0, 320.5, 0.0, 501.0, 240.5, 0.0, 0.0, 1.0]
r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
p: [490.0, 0.0, 320.0, 0.0, 0.0, 491.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
"""
# As ROS's cameracalibrator lays it out: numpy prints the numbers.
OST = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [500.     ,   0.     , 320.5    ,
           0.     , 501.     , 240.5    ,
           0.     ,   0.     ,   1.     ]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.1, -0.2, 0.001, 0.002, 0.03]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0.,
         0., 1., 0.,
         0., 0., 1.]
projection_matrix:
  rows: 3
  cols: 4
  data: [490.    ,   0.     , 320.     ,   0.     ,
           0.     , 491.     , 240.     ,   0.     ,
           0.     ,   0.     ,   1.     ,   0.     ]
"""
SAMPLES = {
    "opencv sample": (
        OPENCV_SAMPLE,
        (640, 480),
        [535.91573396163199, 535.91573396163199, 342.28315473308373, 235.57082909788173],
        [-0.26637260909660682, -0.038588898922304653, 1.7831947042852964e-03, -2.8122100441115472e-04, 0.23839153080878486],
    ),
    "interactive": (INTERACTIVE, (1280, 720), [657.5, 658.5, 319.5, 239.5], [-0.41, 0.57, 0, 0, -0.58]),
    "opencv old": (OLD_SAMPLE, (640, 480), [657.5, 658.5, 319.5, 239.5], [-0.41, 0.57, 1e-3, 2e-3]),
    "ros message": (ROS_MESSAGE, (640, 480), [500, 501, 320.5, 240.5], [0.1, -0.2, 0.001, 0.002, 0.03]),
    "ros by hand": (
        "image_width: 640\nimage_height: 480\ndistortion_model: plumb_bob\ndistortion_coefficients: [0.1, -0.2, 0.001, 0.002]\n"
        "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [500.0, 0.0, 320.5, 0.0, 501.0, 240.5, 0.0, 0.0, 1.0]\n",
        (640, 480),
        [500, 501, 320.5, 240.5],
        [0.1, -0.2, 0.001, 0.002],
    ),
    "opencv by hand": (
        "%YAML:1.0\n\n# by hand\nwidth: 640\nheight: 480\nK: [500., 0., 320., 0., 501., 240., 0., 0., 1.]\n",
        (640, 480),
        [500, 501, 320, 240],
        [],
    ),
    "ros echoed": (ROS_MESSAGE + "---\n", (640, 480), [500, 501, 320.5, 240.5], [0.1, -0.2, 0.001, 0.002, 0.03]),
    "ost": (OST, (640, 480), [500, 501, 320.5, 240.5], [0.1, -0.2, 0.001, 0.002, 0.03]),
    "numpy": (
        '{"K": [[500, 0, 320], [0, 501, 240], [0, 0, 1]], "dist": [[0.1, -0.2, 0, 0, 0.05]], "image_size": [640, 480]}',
        (640, 480),
        [500, 501, 320, 240],
        [0.1, -0.2, 0, 0, 0.05],
    ),
    "script": (
        '{"camera_matrix": [[500, 0, 320], [0, 501, 240], [0, 0, 1]], "dist_coeff": [0.1, -0.2, 0, 0], "w": 640, "h": 480}',
        (640, 480),
        [500, 501, 320, 240],
        [0.1, -0.2],
    ),
    "colmap simple": ("1 SIMPLE_RADIAL 640 480 500 320 240 0.1\n", (640, 480), [500, 500, 319.5, 239.5], [0.1]),
    "colmap radial": ("# x\n\n1 RADIAL 640 480 500 320 240 .1 .2\n", (640, 480), [500, 500, 319.5, 239.5], [0.1, 0.2]),
    "nerfstudio frames": (
        json.dumps(
            {
                "k1": 0.1,
                "w": 640,
                "h": 480,
                "frames": [{"file_path": n, "fl_x": 500, "fl_y": 501, "cx": 320, "cy": 240} for n in ("a.png", "b.png")],
            }
        ),
        (640, 480),
        [500, 501, 319.5, 239.5],
        [0.1],
    ),
    "matlab named": (
        "c = cameraIntrinsics([800, 810], [320 240], [480 640], RadialDistortion=[0.1 0.2], TangentialDistortion=[1e-3 2e-3]);",
        (640, 480),
        [800, 810, 319, 239],
        [0.1, 0.2, 1e-3, 2e-3],
    ),
    "matlab parameters": (
        "% by hand\np = cameraParameters('K', [715.2 0.5 565.6; 0 711.5 355.3; 0 0 1], ... as estimated\n"
        "    'RadialDistortion', [-0.33 0.09], 'ImageSize', [720 1280]);\n",
        (1280, 720),
        [715.2, 711.5, 564.6, 354.3, 0.5],
        [-0.33, 0.09],
    ),
    "matlab variables": (
        "focalLength = [800, 810]; % px\nprincipalPoint = [320; 240];\nsizes=[480 640];\nradial = [0.1 ...\n 0.2];\n"
        "c = cameraIntrinsics(focalLength, principalPoint, sizes, 'RadialDistortion', radial);",
        (640, 480),
        [800, 810, 319, 239],
        [0.1, 0.2],
    ),
    "matlab struct": (
        '{"RadialDistortion": [-0.33, 0.09], "IntrinsicMatrix": [[715.2, 0, 0], [0.5, 711.5, 0], [565.6, 355.3, 1]], '
        '"ImageSize": [720, 1280]}',
        (1280, 720),
        [715.2, 711.5, 564.6, 354.3, 0.5],
        [-0.33, 0.09],
    ),
    "mrcal": (
        "# as mrcal writes\n{\n    'lensmodel':  'LENSMODEL_OPENCV5',\n    # five\n    'intrinsics': [ 500, 501, 320, 240, "
        "0.1, 0.01, 0.001, 0.002, 0.003,],\n    'extrinsics': [ 0, 0, 0, 0, 0, 0,],\n    'imagersize': [ 640, 480,],\n}\n",
        (640, 480),
        [500, 501, 320, 240],
        [0.1, 0.01, 0.001, 0.002, 0.003],
    ),
}


@pytest.mark.parametrize("name", SAMPLES)
def test_files_of_other_tools(tmp_path, name):
    """Hand-made files in each tool's layout; the pixel conventions are subtracted by hand."""
    text, size, pinhole, dist = SAMPLES[name]
    camera = load_intrinsics(write(tmp_path, "camera", text)).camera
    assert camera.size == size
    np.testing.assert_allclose(camera.intrinsics[:5], [*pinhole, 0][:5], rtol=0, atol=np.spacing(1000.0))
    assert camera.dist.tolist() == [*dist, *[0] * (8 - len(dist))]


CHAIN = """\
cam0:
  camera_model: pinhole
  intrinsics: [500.0, 501.0, 320.0, 240.0]
  distortion_model: radtan
  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  intrinsics: [510.0, 511.0, 321.0, 241.0]
  distortion_model: equidistant
  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]
  resolution: [640, 480]
cam2:
  camera_model: omni
  intrinsics: [1.2, 500.0, 501.0, 320.0, 240.0]
cam3:
  camera_model: pinhole
  intrinsics: [510.0, 511.0, 321.0, 241.0]
  distortion_model: none
  resolution: [640, 480]
"""


def test_one_of_several_cameras(tmp_path):
    """Without a choice they are named; a choice may stand in the path; a fisheye among them harms nobody else."""
    path = write(tmp_path, "camchain.yaml", CHAIN)
    with pytest.raises(InputError, match=r"camchain\.yaml: several cameras \(got cam0, cam1, cam2, cam3, expected one\)"):
        load_intrinsics(path)
    assert load_intrinsics(f"{path}#cam0").camera.dist[:4].tolist() == [0.1, -0.2, 0.001, 0.002]
    assert import_camera(path, camera="cam3").camera.intrinsics[:4].tolist() == [510, 511, 321, 241]
    with pytest.raises(InputError, match=r"no camera 'cam9' .*Did you mean 'cam"):
        load_intrinsics(f"{path}#cam9")
    with pytest.raises(
        InputError, match=r"camchain\.yaml:16: cam1\.distortion_model: unsupported lens model \(got 'equidistant'"
    ):
        load_intrinsics(f"{path}#cam1")
    with pytest.raises(InputError, match=r"camchain\.yaml:20: cam2\.camera_model: unsupported lens model \(got 'omni'"):
        import_camera(path, camera="cam2")


def test_what_to_do_about_one_of_several(tmp_path):
    """The command that a message advises is about the camera that was named, and works."""
    path = write(
        tmp_path, "intrinsics.yml", "%YAML:1.0\n---\nM1: [5, 0, 3, 0, 6, 2, 0, 0, 1]\nM2: [7, 0, 3, 0, 8, 2, 0, 0, 1]\n"
    )
    with pytest.raises(InputError) as caught:
        load_intrinsics(f"{path}#M2")
    words = shlex.split(str(caught.value).partition("Tell it: ")[2].replace("WxH", "7x5"))
    assert main([*words[1:-1], str(tmp_path / "camera.yaml")]) == 0
    assert load_intrinsics(tmp_path / "camera.yaml").camera.K[0, 0] == 7


def test_one_of_matlabs_stereo_pair(tmp_path):
    """Of stereoParameters neither camera is taken unasked."""
    left = {"K": K, "RadialDistortion": [0.1, 0.2], "ImageSize": [480, 640]}
    pair = {"CameraParameters1": left, "CameraParameters2": left | {"RadialDistortion": [0.3, 0.4]}, "RotationOfCamera2": K}
    path = write(tmp_path, "stereo.json", json.dumps(pair))
    with pytest.raises(InputError, match=r"several cameras \(got CameraParameters1, CameraParameters2"):
        load_intrinsics(path)
    assert load_intrinsics(f"{path}#CameraParameters2").camera.dist[:2].tolist() == [0.3, 0.4]


def test_a_file_whose_name_has_the_mark(tmp_path):
    """A file that is called `a#b` is that file."""
    save_intrinsics(tmp_path / "a#b", Intrinsics(WEBCAM))
    save_intrinsics(tmp_path / "a", Intrinsics(CAMERAS["pinhole"]))
    (tmp_path / "a#b").write_text((tmp_path / "a#b").read_text().replace('dt: "d"', "dt: d"))
    same(load_intrinsics(tmp_path / "a#b").camera, WEBCAM)


def test_a_file_without_size(tmp_path):
    """It is asked for; a size that contradicts the file is refused."""
    path = write(tmp_path, "k.json", '{"mtx": [[500, 0, 320], [0, 501, 240], [0, 0, 1]], "dist": [0.1, 0, 0, 0]}')
    with pytest.raises(InputError, match=r"no image size in this file. Tell it: camcal import .* --size WxH"):
        load_intrinsics(path)
    with pytest.raises(InputError, match="Tell it with --size WxH"):
        import_camera(path)
    assert import_camera(path, size=(640, 480)).camera.size == (640, 480)
    sized = write(tmp_path, "sized", SAMPLES["numpy"][0])
    with pytest.raises(InputError, match=r"--size: not the size .*\(got 64x48, expected 640x480\)"):
        import_camera(sized, size=(64, 48))


def test_mrcal_writes_what_is_read(tmp_path):
    """A model that mrcal itself has written, comments and all."""
    python = Path("/usr/bin/python3")
    code = (
        "import mrcal, numpy, sys; mrcal.cameramodel(intrinsics=('LENSMODEL_OPENCV4', "
        "numpy.array([500.25, 501.5, 320.75, 240, .1, .2, .001, .002])), imagersize=numpy.array([640, 480])).write(sys.argv[1])"
    )
    path = tmp_path / "m.cameramodel"
    if not python.exists() or subprocess.run([python, "-c", code, path], check=False, capture_output=True).returncode:
        pytest.skip("mrcal is not installed")
    camera = load_intrinsics(path).camera
    assert camera.intrinsics[:9].tolist() == [500.25, 501.5, 320.75, 240, 0, 0.1, 0.2, 0.001, 0.002]


def test_pycolmap_writes_what_is_read(tmp_path):
    """Lists of cameras that COLMAP itself has written, text and binary, one of them a fisheye."""
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
    reconstruction = pycolmap.Reconstruction()
    for number, (model, values) in enumerate(
        [("OPENCV", [500, 501, 320, 240, 0.1, 0.2, 0.01, 0.02]), ("OPENCV_FISHEYE", [500, 501, 320, 240, 0, 0, 0, 0])], 1
    ):
        camera = pycolmap.Camera(model=model, width=640, height=480, params=values)
        camera.camera_id = number
        reconstruction.add_camera(camera)
    reconstruction.write_text(tmp_path)
    reconstruction.write_binary(tmp_path)
    for file in ("cameras.txt", "cameras.bin"):
        found = load_intrinsics(f"{tmp_path / file}#1").camera
        assert found.intrinsics[:9].tolist() == [500, 501, 319.5, 239.5, 0, 0.1, 0.2, 0.01, 0.02]
        with pytest.raises(InputError, match=r"camera 2: unsupported lens model \(got 'OPENCV_FISHEYE'"):
            load_intrinsics(f"{tmp_path / file}#2")


def test_mat_files(tmp_path):
    """A struct as toStruct makes it, in a MAT file of version 7; 7.3 and files without one are refused with what to do."""
    io = pytest.importorskip("scipy.io", reason="scipy is not installed")
    struct_ = {
        "K": np.array(K),
        "RadialDistortion": [[0.1, 0.2]],
        "TangentialDistortion": [[0.0, 0.0]],
        "ImageSize": [[720, 1280]],
    }
    io.savemat(tmp_path / "c.mat", {"params": struct_, "other": 3})
    camera = load_intrinsics(tmp_path / "c.mat").camera
    assert (camera.size, camera.dist[:2].tolist()) == ((1280, 720), [0.1, 0.2])
    np.testing.assert_allclose(camera.K[:2, 2], [639.3, 351.7], rtol=0, atol=np.spacing(640.0))
    io.savemat(tmp_path / "d.mat", {"other": 3})
    with pytest.raises(InputError, match=r"no camera struct \(got other\)"):
        load_intrinsics(tmp_path / "d.mat")
    (tmp_path / "e.mat").write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(500))
    with pytest.raises(InputError, match=r"version 7\.3 .*'-v7'"):
        load_intrinsics(tmp_path / "e.mat")
    (tmp_path / "f.mat").write_bytes((tmp_path / "c.mat").read_bytes()[:300])
    with pytest.raises(InputError, match="not a whole MAT file"):
        load_intrinsics(tmp_path / "f.mat")


LENS = """\
<!DOCTYPE lensdatabase SYSTEM "lensfun-database.dtd">
<lensdatabase version="1">
  <camera><maker>M</maker><model>C</model><mount>m</mount><cropfactor>1.5</cropfactor></camera>
  <lens><maker>M</maker><model>L</model><mount>m</mount><cropfactor>1.5</cropfactor>{extra}
    <calibration><distortion model="{model}" focal="20" {terms}/></calibration></lens>
</lensdatabase>
"""
LENSES = {
    "poly3": ('model="poly3"', {"k1": -0.03}, ""),
    "poly5": ('model="poly5"', {"k1": -0.03, "k2": 0.01}, "<aspect-ratio>4:3</aspect-ratio>"),
    "ptlens": ('model="ptlens"', {"a": 0.02, "b": -0.05, "c": 0.01}, '<center x="0.02" y="-0.03"/>'),
}


@pytest.mark.parametrize("model", LENSES)
def test_lensfun_lenses(tmp_path, model):
    """The imported camera distorts as lensfun does: exactly, or within what its refit tells."""
    lensfunpy = pytest.importorskip("lensfunpy", reason="lensfunpy is not installed")
    _, values, extra = LENSES[model]
    terms = " ".join(f'{name}="{value}"' for name, value in values.items())
    path = write(tmp_path, "lens.xml", LENS.format(model=model, terms=terms, extra=extra))
    size = (900, 600)
    told: list[str] = []
    reporter = type("Told", (), {"warn": lambda _, text: told.append(text)})()
    camera = import_camera(path, size=size, reporter=reporter).camera
    assert (camera.K[0, 1], camera.K[0, 0]) == (0, camera.K[1, 1])
    assert ("refitted" in " ".join(told)) == (model == "ptlens")
    allowed_px = float(told[0].partition("up to ")[2].split()[0]) if told else 0.0
    assert allowed_px < 0.1
    database = lensfunpy.Database(xml=path.read_text(), load_common=False, load_bundled=False)
    body = database.find_cameras("M", "C")[0]
    lens = database.find_lenses(body, "M", "L")[0]
    modifier = lensfunpy.Modifier(lens, 1.5, *size)
    modifier.initialize(20.0, 4.0, 10.0, scale=1.0, flags=lensfunpy.ModifyFlags.DISTORTION)
    ideal = np.random.default_rng(2).uniform([0, 0], np.array(size) - 1, (500, 2)).astype(np.float32).astype(float)
    found = np.array([modifier.apply_geometry_distortion(u, v, 1, 1)[0, 0] for u, v in ideal], dtype=float)
    inside = (np.abs(found - (np.array(size) - 1) / 2) < np.array(size) / 2).all(axis=1)
    # lensfun's ideal image has its own scale, by which poly3 and ptlens shrink the middle.
    shrunk = 1 - sum(values.values()) if model != "poly5" else 1.0
    shrunk = 1 - values["k1"] if model == "poly3" else shrunk
    # 20 mm on a sensor 1.5 times smaller than a full frame, of the calibration's aspect.
    half_side_mm = np.hypot(36, 24) / 2 / 1.5 / np.hypot(4 / 3 if model == "poly5" else 1.5, 1)
    half_side_px = 599 / 2 * np.hypot(899 / 599, 1) / np.hypot(4 / 3 if model == "poly5" else 1.5, 1)
    f = 20 * shrunk / half_side_mm * half_side_px
    centre = (np.array(size) - 1) / 2 + (np.array([0.02, -0.03]) * 599 / 2 if model == "ptlens" else 0)
    rays = np.column_stack([(ideal - centre) * shrunk / f, np.ones(500)])
    # The coordinates are 32-bit floats after a few operations.
    close_px = allowed_px + 8 * max(size) * 2.0**-24
    assert np.abs(found - camera.project(rays))[inside].max() < close_px


def test_nerfstudio_fourth_coefficient(tmp_path):
    """Its k4 is that of r⁸: refitted on import, and not taken without being asked."""
    path = write(tmp_path, "t.json", '{"fl_x": 500, "cx": 320, "cy": 240, "w": 640, "h": 480, "k1": 0.1, "k4": 0.01}')
    with pytest.raises(InputError, match="camcal import"):
        load_intrinsics(path)
    with pytest.raises(QualityError, match="r⁸ term is not camcal's lens: refitted, it differs by up to"):
        import_camera(path, refit=False)
    with pytest.raises(QualityError, match="more than --max-refit-px 1e-05"):
        import_camera(path, tmp_path / "camera.yaml", max_refit_px=1e-5)
    assert not (tmp_path / "camera.yaml").exists()
    camera = import_camera(path).camera
    x = np.linspace(-0.55, 0.55, 23)
    s = x * x
    expected = 500 * x * (1 + 0.1 * s + 0.01 * s**4) + 319.5
    seen = camera.project(np.column_stack([x, np.zeros(23), np.ones(23)]))[:, 0]
    assert np.abs(seen - expected).max() < 0.01


def test_what_is_not_to_be_trusted_stays_so(tmp_path):
    """A rejected calibration says so in the file and on the way."""
    verdict = Verdict((Finding("large_rms", "rejected", 1.0, "RMS 9 px", "Look."),))
    told: list[str] = []
    reporter = type("Told", (), {"warn": lambda _, text: told.append(text)})()
    done = export_camera(saved(tmp_path, "webcam", verdict=verdict), "opencv", reporter=reporter)
    assert "# NOT TO BE TRUSTED: RMS 9 px" in str(done.content)
    assert "RMS 9 px" in told[0]
    assert "# NOT TO BE TRUSTED: RMS 9 px" in str(export_camera(tmp_path / "webcam.yaml", "kalibr", reporter=reporter).content)


def test_lensfun_acm_is_ours(tmp_path):
    """Adobe's model counts in focal lengths, as ours does; its k4, k5 are our p1, p2."""
    terms = 'k1="0.1" k2="0.02" k3="0.003" k4="0.0004" k5="0.00005"'
    path = write(tmp_path, "lens.xml", LENS.format(model="acm", terms=terms, extra=""))
    camera = import_camera(path, size=(900, 600)).camera
    assert isinstance(camera, Camera)
    assert camera.dist[:5].tolist() == [0.1, 0.02, 0.0004, 0.00005, 0.003]


def test_lensfun_lenses_of_one_name(tmp_path):
    """Its database has lenses twice, measured on cameras of different sensors: each can be had, none is taken unasked."""
    text = LENS.format(model="poly3", terms='k1="-0.03"', extra="")
    lens = text[text.index("  <lens>") : text.index("</lensdatabase>")]
    others = lens.replace("1.5", "1") + lens.replace("-0.03", "-0.02")
    path = write(tmp_path, "lens.xml", text.replace("</lensdatabase>", others + "</lensdatabase>"))
    with pytest.raises(
        InputError, match=r"several cameras \(got L 20 mm, crop 1\.5, L 20 mm, crop 1, L 20 mm, crop 1\.5 \(2\)"
    ):
        import_camera(path, size=(640, 480))
    first, second, third = (
        import_camera(path, size=(640, 480), camera=f"L 20 mm, crop {crop}").camera for crop in ("1.5", "1", "1.5 (2)")
    )
    # A sensor 1.5 times as large has a unit 1.5 times as long, in millimetres and so in the focal length's pixels.
    assert second.K[0, 0] / first.K[0, 0] == pytest.approx(1 / 1.5, rel=1e-12)
    assert third.K[0, 0] / first.K[0, 0] == pytest.approx(1.02 / 1.03, rel=1e-12)


def test_two_cameras_of_one_name(tmp_path):
    """Which one is meant cannot be known."""
    path = write(tmp_path, "cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n1 PINHOLE 640 480 600 600 320 240\n")
    with pytest.raises(InputError, match=r"2 cameras are called '1'"):
        load_intrinsics(f"{path}#1")
