"""camcal: camera calibration and undistortion that can be trusted.

Conventions, everywhere in this package and in its files:

- Pixels: whole coordinates are pixel centres; the centre of the top-left pixel is (0, 0). Rescaling an image by s moves
  the principal point as c' = (c + 0.5) s - 0.5.
- Camera frame: x right, y down, z forward. Board frame: x right, y down as printed, z into the board, origin at the
  top-left feature, so R = I shows the board upright and unmirrored.
- `T_cam_board` maps board points to the camera: X_cam = R X_board + t. Metres and radians; degrees where a name says so.
- Distortion: x_d = x (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶) + tangential(p1, p2) on normalised
  coordinates, stored in OpenCV's order (k1, k2, p1, p2, k3, k4, k5, k6).
- K = [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]. `size` is (width, height), `shape` is (height, width).
- RMS is the root mean square of the 2-D residual length per corner (OpenCV's figure); corner accuracy and standard
  deviations are per axis.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from camcal.boards.spec import parse_board
    from camcal.compare.projection import projection_difference
    from camcal.errors import CamcalError, DetectionError, InputError, QualityError, SolveError
    from camcal.formats.board_file import load_board
    from camcal.formats.camera_file import load_intrinsics, save_intrinsics
    from camcal.geometry.camera import Camera
    from camcal.geometry.pose import Pose
    from camcal.synthesis.bound import corner_bound
    from camcal.workflows.board import board
    from camcal.workflows.calibrate import calibrate
    from camcal.workflows.demo import demo
    from camcal.workflows.regress import regress
    from camcal.workflows.synth import synth
    from camcal.workflows.undistort import undistort
    from camcal.workflows.verify import verify

__version__ = "0.1.0"

_HOMES = {
    "Camera": "camcal.geometry.camera",
    "CamcalError": "camcal.errors",
    "DetectionError": "camcal.errors",
    "InputError": "camcal.errors",
    "Pose": "camcal.geometry.pose",
    "QualityError": "camcal.errors",
    "SolveError": "camcal.errors",
    "board": "camcal.workflows.board",
    "calibrate": "camcal.workflows.calibrate",
    "corner_bound": "camcal.synthesis.bound",
    "demo": "camcal.workflows.demo",
    "load_board": "camcal.formats.board_file",
    "load_intrinsics": "camcal.formats.camera_file",
    "parse_board": "camcal.boards.spec",
    "projection_difference": "camcal.compare.projection",
    "regress": "camcal.workflows.regress",
    "save_intrinsics": "camcal.formats.camera_file",
    "synth": "camcal.workflows.synth",
    "undistort": "camcal.workflows.undistort",
    "verify": "camcal.workflows.verify",
}

__all__ = [
    "CamcalError",
    "Camera",
    "DetectionError",
    "InputError",
    "Pose",
    "QualityError",
    "SolveError",
    "__version__",
    "board",
    "calibrate",
    "corner_bound",
    "demo",
    "load_board",
    "load_intrinsics",
    "parse_board",
    "projection_difference",
    "regress",
    "save_intrinsics",
    "synth",
    "undistort",
    "verify",
]


def __getattr__(name: str) -> object:
    """Import a public name when it is first asked for, so that `camcal --help` answers at once."""
    if name not in _HOMES:
        raise AttributeError(f"module 'camcal' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names, imported or not."""
    return sorted(__all__)
