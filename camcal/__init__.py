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
    from camcal.boards.base import Board
    from camcal.boards.spec import parse_board
    from camcal.compare.projection import projection_difference
    from camcal.errors import CamcalError, DetectionError, InputError, QualityError, SolveError
    from camcal.formats.board_file import load_board, save_board
    from camcal.formats.camera_file import load_intrinsics, save_intrinsics
    from camcal.formats.corners_file import load_corners, save_corners
    from camcal.geometry.camera import Camera
    from camcal.geometry.pose import Pose
    from camcal.observations import Calibration, Detection, Rejected
    from camcal.records import Intrinsics
    from camcal.synthesis.bound import corner_bound
    from camcal.synthesis.scenario import Light, Sensor
    from camcal.trust.assess import Gates
    from camcal.trust.uncertainty import projection_sigma
    from camcal.undistortion.maps import dense_map, undistort_map, valid_mask
    from camcal.undistortion.points import distort_points, undistort_points
    from camcal.undistortion.target import target_camera
    from camcal.verdict import Finding, Verdict
    from camcal.workflows.arrays import detect_corners, load_camera, render, undistort_image
    from camcal.workflows.board import board
    from camcal.workflows.calibrate import CalibrationRun, calibrate
    from camcal.workflows.demo import demo
    from camcal.workflows.detect import detect
    from camcal.workflows.export import export_camera
    from camcal.workflows.export_board import export_board
    from camcal.workflows.export_corners import export_corners
    from camcal.workflows.import_ import import_camera
    from camcal.workflows.regress import regress
    from camcal.workflows.report import make_report
    from camcal.workflows.schema import schema
    from camcal.workflows.synth import synth
    from camcal.workflows.undistort import undistort
    from camcal.workflows.verify import verify

__version__ = "0.1.0"

_NAMES = {
    "boards.base": "Board",
    "boards.spec": "parse_board",
    "compare.projection": "projection_difference",
    "errors": "CamcalError DetectionError InputError QualityError SolveError",
    "formats.board_file": "load_board save_board",
    "formats.camera_file": "load_intrinsics save_intrinsics",
    "formats.corners_file": "load_corners save_corners",
    "geometry.camera": "Camera",
    "geometry.pose": "Pose",
    "observations": "Calibration Detection Rejected",
    "records": "Intrinsics",
    "synthesis.bound": "corner_bound",
    "synthesis.scenario": "Light Sensor",
    "trust.assess": "Gates",
    "trust.uncertainty": "projection_sigma",
    "undistortion.maps": "dense_map undistort_map valid_mask",
    "undistortion.points": "distort_points undistort_points",
    "undistortion.target": "target_camera",
    "verdict": "Finding Verdict",
    "workflows.arrays": "detect_corners load_camera render undistort_image",
    "workflows.board": "board",
    "workflows.calibrate": "CalibrationRun calibrate",
    "workflows.demo": "demo",
    "workflows.detect": "detect",
    "workflows.export": "export_camera",
    "workflows.export_board": "export_board",
    "workflows.export_corners": "export_corners",
    "workflows.import_": "import_camera",
    "workflows.regress": "regress",
    "workflows.report": "make_report",
    "workflows.schema": "schema",
    "workflows.synth": "synth",
    "workflows.undistort": "undistort",
    "workflows.verify": "verify",
}
"""The public names by the module that each is imported from when it is first asked for."""

_HOMES = {name: f"camcal.{module}" for module, names in _NAMES.items() for name in names.split()}

__all__ = [
    "Board",
    "Calibration",
    "CalibrationRun",
    "CamcalError",
    "Camera",
    "Detection",
    "DetectionError",
    "Finding",
    "Gates",
    "InputError",
    "Intrinsics",
    "Light",
    "Pose",
    "QualityError",
    "Rejected",
    "Sensor",
    "SolveError",
    "Verdict",
    "__version__",
    "board",
    "calibrate",
    "corner_bound",
    "demo",
    "dense_map",
    "detect",
    "detect_corners",
    "distort_points",
    "export_board",
    "export_camera",
    "export_corners",
    "import_camera",
    "load_board",
    "load_camera",
    "load_corners",
    "load_intrinsics",
    "make_report",
    "parse_board",
    "projection_difference",
    "projection_sigma",
    "regress",
    "render",
    "save_board",
    "save_corners",
    "save_intrinsics",
    "schema",
    "synth",
    "target_camera",
    "undistort",
    "undistort_image",
    "undistort_map",
    "undistort_points",
    "valid_mask",
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
