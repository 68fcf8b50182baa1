"""Files of other tools, written by hand in the layout of each."""

from __future__ import annotations

import json
from pathlib import Path

# Names that the tools give to such files.
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
LENS = """\
<!DOCTYPE lensdatabase SYSTEM "lensfun-database.dtd">
<lensdatabase version="1">
  <camera><maker>M</maker><model>C</model><mount>m</mount><cropfactor>1.5</cropfactor></camera>
  <lens><maker>M</maker><model>L</model><mount>m</mount><cropfactor>1.5</cropfactor>{extra}
    <calibration><distortion model="{model}" focal="20" {terms}/></calibration></lens>
</lensdatabase>
"""


def write(folder: Path, name: str, text: str) -> Path:
    """Write a file with a text."""
    path = folder / name
    path.write_text(text)
    return path
