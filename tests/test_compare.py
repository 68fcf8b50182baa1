"""How far two cameras disagree: hand-worked differences, implied rotations, symmetric boards."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import BOARD, CAMERA, detections, poses

from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.solve import solve
from camcal.compare.parameters import parameter_errors
from camcal.compare.projection import predicted_difference_px, projection_difference
from camcal.compare.views import PosedView, view_errors
from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection
from camcal.records import Intrinsics


def test_equal_cameras_do_not_differ():
    """The difference of a camera with itself is zero, over the whole image."""
    difference = projection_difference(CAMERA, CAMERA)
    assert difference.max_px < 1e-9
    assert difference.compared_share == 1
    assert np.abs(difference.rvec).max() < 1e-12


def test_shifted_principal_point_is_mostly_a_rotation():
    """A principal point 1 px to the right at f = 1000 px is a turn of 1 mrad; what is left is second order.

    The turn moves a point at normalised (x, y) by f θ (1 + x², x y) instead of (1, 0) px. With |x|, |y| ≤ 0.5 and
    f θ ≤ 1 px, what stays is within 0.25 px along each axis.
    """
    a = Camera((1001, 1001), [[1000, 0, 500], [0, 1000, 500], [0, 0, 1]])
    b = Camera((1001, 1001), [[1000, 0, 501], [0, 1000, 500], [0, 0, 1]])
    difference = projection_difference(a, b)
    assert np.abs(difference.difference_px).max() <= 0.25
    assert difference.rvec[1] == pytest.approx(-1e-3, rel=0.15)
    assert np.abs(difference.rvec[[0, 2]]).max() < 1e-6


def test_a_longer_focal_length_differs_in_proportion_to_the_radius():
    """With f 1 % longer nothing can be turned away: 1 % of the distance to the centre, (500, 500) px at the corner."""
    a = Camera((1001, 1001), [[1000, 0, 500], [0, 1000, 500], [0, 0, 1]])
    b = Camera((1001, 1001), [[1010, 0, 500], [0, 1010, 500], [0, 0, 1]])
    difference = projection_difference(a, b)
    assert difference.max_px == pytest.approx(0.01 * 500 * np.sqrt(2), rel=1e-6)
    # The mean distance from the centre of a square of side 2 a is 0.7652 a.
    assert difference.mean_px == pytest.approx(0.01 * 0.7652 * 500, rel=0.03)
    assert difference.mean_px < difference.p95_px < difference.max_px


def test_predicted_difference_is_what_noise_makes():
    """Over 100 noise draws the mean square difference at each pixel is the predicted one: ratio 1 within 4 sigma.

    The mean over the image has at most 7 degrees of freedom a draw and at least one, so its relative standard deviation
    is at most sqrt(2 / 100).
    """
    views = poses(12, 4)
    measured, predicted = [], []
    for seed in range(100):
        solved = solve(detections(views, noise_px=0.1, seed=seed), BOARD.object_points)
        measured.append((projection_difference(CAMERA, solved.camera).difference_px ** 2).sum(axis=1))
        estimate = Intrinsics(solved.camera, free=solved.free, covariance=solved.covariance)
        predicted.append(predicted_difference_px(estimate) ** 2)
    assert np.mean(measured) / np.mean(predicted) == pytest.approx(1, abs=4 * np.sqrt(2 / 100))


def test_pixels_past_the_fold_are_not_compared():
    """Where either lens has turned back there is no difference, and the compared share says so."""
    folded = Camera(CAMERA.size, CAMERA.K, [-0.5])
    difference = projection_difference(CAMERA, folded)
    assert difference.compared_share < 1
    assert np.isfinite(difference.max_px)


def test_cameras_of_different_sizes_are_refused():
    """Sizes must agree."""
    with pytest.raises(InputError, match=r"got 640x480, expected 1280x960"):
        projection_difference(CAMERA, CAMERA.scaled((640, 480)))


def test_parameter_errors_by_hand():
    """Error and error in standard deviations; parameters that are 0 in both and not free do not appear."""
    truth = Intrinsics(Camera((100, 100), [[50, 0, 40], [0, 60, 30], [0, 0, 1]], [0.1]))
    covariance = np.diag([4.0, 1.0])
    estimate = Intrinsics(
        Camera((100, 100), [[53, 0, 40], [0, 60, 30], [0, 0, 1]], [0.2]), free=("fx", "k1"), covariance=covariance
    )
    errors = {e.name: e for e in parameter_errors(truth, estimate)}
    assert list(errors) == ["fx", "fy", "cx", "cy", "k1"]
    assert (errors["fx"].error, errors["fx"].error_in_sigma) == (3, 1.5)
    assert errors["k1"].error_in_sigma == pytest.approx(0.1)
    assert np.isnan(errors["fy"].error_in_sigma)


def posed(views, seen):
    """Views by name, as a comparison takes them."""
    return {d.source: PosedView(d, p) for d, p in zip(seen, views, strict=True)}


def test_view_errors_by_hand():
    """Corners 0.3 px to the right and 0.4 px down, boards 2 mm farther away and turned by 1 degree."""
    views = poses(3, 1)
    seen = detections(views)
    moved = [Detection(d.source, d.size, d.ids, d.corners_px + np.array([0.3, 0.4]), d.sigma_px) for d in seen]
    turn = Pose.from_rvec([0, 0, np.radians(1)], [0, 0, 0])
    off = [Pose(p.R @ turn.R, p.t + np.array([0, 0, 0.002])) for p in views]
    errors = view_errors(posed(views, seen), posed(off, moved), BOARD)
    assert (errors.views, errors.corners) == (3, 162)
    assert errors.corner_bias_px == pytest.approx((0.3, 0.4))
    assert errors.corner_rms_px == pytest.approx(0.5 / np.sqrt(2))
    assert errors.corner_max_px == pytest.approx(0.5)
    assert errors.rotation_deg == pytest.approx(1)
    assert errors.translation_m == pytest.approx(0.002)


def test_symmetric_board_is_compared_with_its_best_turn():
    """An 8x6 board seen upside down is the same board: labels and poses agree after the half turn."""
    board = Checkerboard(8, 6, 0.025)
    views = poses(3, 2, board=board)
    seen = detections(views, board=board)
    (half_turn,) = board.symmetries
    turned = [Detection(d.source, d.size, d.ids, d.corners_px[half_turn.ids], d.sigma_px) for d in seen]
    turned_views = [p @ half_turn.T_board_board for p in views]
    errors = view_errors(posed(views, seen), posed(turned_views, turned), board)
    assert errors.corner_max_px < 1e-9
    assert errors.rotation_deg < 1e-6
    assert errors.translation_m < 1e-12


def test_no_views_in_common():
    """Folders of different images have nothing to compare."""
    views = poses(1, 3)
    assert view_errors(posed(views, detections(views)), {}, BOARD) is None
