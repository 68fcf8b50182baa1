"""Fisheyes: told from other misfits, with the lens of cv2.fisheye."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from broken_photographs import orpc
from capture_scenes import BOARD, VERY_WIDE, Equidistant, ordinary_poses, placed_poses, see

from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.solve import solve
from camcal.geometry.camera import Camera
from camcal.observations import Detection
from camcal.trust.fisheye import AngleLens, FisheyeFit, check_fisheye, fit_fisheye
from camcal.trust.minimum import Minimum

# 110 degrees to either side, as far as boards in front of the camera are seen.
FISHEYE = Equidistant((1280, 960), 420.0, (640.0, 480.0))


def test_fisheye_formula_is_opencvs():
    """The lens of angles projects as cv2.fisheye does."""
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.uniform(-2, 2, (50, 2)), np.ones((50, 1))], axis=1)
    coefficients = np.array([0.05, -0.02, 0.007, -0.001])
    K = np.array([[420.0, 0, 640], [0, 425, 480], [0, 0, 1]])
    expected, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), K, coefficients)
    camera = Camera((1280, 960), K, AngleLens(coefficients))
    assert camera.project(points) == pytest.approx(expected.reshape(-1, 2), abs=1e-9)
    assert camera.unproject(camera.project(points)) == pytest.approx(points, abs=1e-9)
    assert camera.project([0, 0, 1]).tolist() == [640, 480]


def test_fisheye_derivatives():
    """Jacobians by the point and by the coefficients, against central differences."""
    angle_lens = AngleLens(np.array([0.05, -0.02, 0.007, -0.001]))
    points = np.array([[0.3, -0.4], [1.2, 0.7], [-2.0, 0.1]])
    step = 1e-6
    for axis in range(2):
        shift = np.eye(2)[axis] * step
        slope = (angle_lens.distort(points + shift) - angle_lens.distort(points - shift)) / (2 * step)
        assert angle_lens.jacobian_points(points)[..., axis] == pytest.approx(slope, abs=1e-8)
    for index in range(4):
        shift = np.eye(4)[index] * step
        high, low = (angle_lens.with_coefficients(angle_lens.coefficients + sign * shift) for sign in (1, -1))
        slope = (high.distort(points) - low.distort(points)) / (2 * step)
        assert angle_lens.jacobian_coefficients(points)[..., index] == pytest.approx(slope, rel=1e-6, abs=1e-8)
    assert angle_lens.jacobian_points(np.zeros(2)).tolist() == [[1, 0], [0, 1]]


def test_a_fisheye_is_called_one():
    """An equidistant lens whose boards reach 80 degrees: it fits to the noise, and the angle is the true one."""
    views = see(placed_poses(16, 2, FISHEYE, distance_m=(0.12, 0.3)), 2, FISHEYE)
    found = check_fisheye(Minimum.of(solve(views, BOARD.object_points), BOARD))
    (finding,) = found.findings
    assert (finding.code, finding.level) == ("fisheye", "rejected")
    # 0.05 px per axis, and 12 unknowns of 100 numbers a view.
    assert found.rms_px == pytest.approx(0.05 * np.sqrt(2), rel=0.15)
    farthest = max(np.linalg.norm(view.corners_px - FISHEYE.centre, axis=1).max() for view in views)
    assert found.angle_deg == pytest.approx(np.degrees(farthest / FISHEYE.f), abs=1)
    assert found.pinhole_rms_px > 1


def test_a_fisheye_that_no_pinhole_could_be_solved_from():
    """The same from corners alone."""
    views = see(placed_poses(16, 2, FISHEYE, distance_m=(0.12, 0.3)), 2, FISHEYE)
    found = fit_fisheye(views, BOARD.object_points)
    assert found.is_fisheye
    assert found.text.startswith("this is a fisheye: no pinhole can be fitted, a fisheye model 0.0")


def test_other_misfits_are_no_fisheyes():
    """Not a wide lens without k2, not corners that are numbered wrongly, and none where the fit is good."""
    wide = see(ordinary_poses(16, 1, VERY_WIDE), 1, VERY_WIDE)
    poor = Minimum.of(solve(wide, BOARD.object_points, distortion=("k1",)), BOARD)
    assert poor.cost / poor.seen.view.size > 1
    assert not check_fisheye(poor).is_fisheye
    assert check_fisheye(Minimum.of(solve(wide, BOARD.object_points), BOARD)) is None
    rng = np.random.default_rng(0)
    shuffled = [Detection(v.source, v.size, v.ids, rng.permutation(v.corners_px), v.sigma_px) for v in wide]
    found = fit_fisheye(shuffled, BOARD.object_points)
    assert found is None or not found.is_fisheye


@pytest.mark.parametrize(
    ("rms_px", "pinhole_px", "angle", "expected"),
    [(0.3, 9, 85, True), (0.3, 9, 55, False), (0.3, 0.95, 85, False), (0.5, 1.4, 85, False), (4, 100, 85, False)],
)
def test_what_makes_a_fisheye(rms_px, pinhole_px, angle, expected):
    """A pinhole that leaves over a pixel and three times as much as the fisheye, which fits, and wide angles."""
    assert FisheyeFit(rms_px, pinhole_px, pinhole_px, angle).is_fisheye is expected


def test_photographs_of_a_fisheye(photos):
    """Reference corners of a lens of 180 degrees: a fisheye leaves half a pixel, a pinhole ten."""
    board = Checkerboard(22, 22, 0.03)
    views = [orpc(path, board) for path in sorted((photos / "fisheye_plane").glob("*.orpc"))[::2]]
    found = check_fisheye(Minimum.of(solve(views, board.object_points), board))
    (finding,) = found.findings
    assert finding.level == "rejected"
    assert 8 < found.left_px < 12
    assert found.rms_px < 0.6
