"""A camera, a board and where it stands, through the Python API alone."""

from __future__ import annotations

import camcal

TRUTH = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06, 0.001, -0.002])
BOARD = camcal.load_board("checkerboard:7x6:20mm")
POSE = camcal.Pose.from_rvec([0.3, -0.2, 0.1], [-0.07, -0.05, 0.3])
