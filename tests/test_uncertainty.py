"""The predicted uncertainty: cases worked out by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import BOARD, CAMERA, detections, poses

from camcal.calibration.solve import solve
from camcal.geometry.camera import Camera
from camcal.observations import Calibration
from camcal.trust.uncertainty import projection_covariance, projection_sigma, uncertainty


@pytest.fixture(scope="module")
def solved() -> Calibration:
    """An ordinary calibration."""
    return solve(detections(poses(10, 17), noise_px=0.05), BOARD.object_points)


def with_covariance(calibration: Calibration, place: int, variance: float) -> Calibration:
    """The same calibration, unsure about one thing only: an intrinsic, or one of (wx, wy, wz, vx, vy, vz)."""
    joint = np.zeros_like(calibration.joint_covariance)
    joint[place, place] = variance
    pinhole = Camera(CAMERA.size, [[900, 0, 640], [0, 900, 480], [0, 0, 1]])
    return replace(calibration, camera=pinhole, joint_covariance=joint)


AXIS = np.array([[640.0, 480.0]])


@pytest.mark.parametrize("range_m", [0.5, np.inf])
def test_a_principal_point_that_is_unsure_moves_every_pixel_alike(solved, range_m):
    """With sigma(cx) = .3 px alone every pixel is known to .3 px along x, and exactly along y."""
    pixels = np.array([[0.0, 0], [640, 480], [1279, 100]])
    covariance = projection_covariance(with_covariance(solved, solved.free.index("cx"), 0.09), pixels, range_m)
    assert covariance == pytest.approx(np.broadcast_to([[0.09, 0], [0, 0]], (3, 2, 2)), abs=1e-15)


def test_a_focal_length_that_is_unsure_moves_pixels_by_their_distance(solved):
    """With sigma(fx) = 1.8 px, 0.2 %, a pixel 400 px right of the centre is known to 0.8 px."""
    sigma = projection_sigma(with_covariance(solved, 0, 1.8**2), AXIS + np.array([400, 0]), np.inf)
    assert sigma == pytest.approx([0.8], rel=1e-12)


@pytest.mark.parametrize("range_m", [0.5, 7.0, np.inf])
def test_a_turn_moves_far_points_and_near_ones_alike(solved, range_m):
    """Boards that may all be turned by 1 mrad about y move the centre by .9 px (f = 900), at any range."""
    sigma = projection_sigma(with_covariance(solved, len(solved.free) + 1, 1e-6), AXIS, range_m)
    assert sigma == pytest.approx([0.9], rel=1e-12)


@pytest.mark.parametrize(("range_m", "expected"), [(0.5, 1.8), (2.0, 0.45), (np.inf, 0.0)])
def test_a_shift_moves_near_points(solved, range_m, expected):
    """Boards that may all be shifted by 1 mm along x move the centre by 900 x .001 / range px, and nothing at infinity."""
    sigma = projection_sigma(with_covariance(solved, len(solved.free) + 3, 1e-6), AXIS, range_m)
    assert sigma == pytest.approx([expected], abs=1e-12)


def test_infinity_is_the_limit_of_great_ranges(solved):
    """At a million kilometres the standard deviation is that at infinity."""
    pixels = np.array([[100.0, 100], [640, 480], [1200, 900]])
    far, infinite = (projection_sigma(solved, pixels, range_m) for range_m in (1e9, np.inf))
    assert far == pytest.approx(infinite, rel=1e-6)


def test_sigma_is_that_of_the_worst_direction(solved):
    """It is the square root of the covariance's larger eigenvalue."""
    pixels = np.array([[10.0, 20], [640, 480], [1270, 30]])
    values = np.linalg.eigvalsh(projection_covariance(solved, pixels, 0.4))
    assert projection_sigma(solved, pixels, 0.4) == pytest.approx(np.sqrt(values[:, -1]), rel=1e-9)


def test_twice_the_noise_is_twice_the_uncertainty():
    """The same draw of noise, twice as large: every standard deviation doubles, up to the curvature of the model."""
    truth = poses(10, 17)
    small, large = (solve(detections(truth, noise_px=noise), BOARD.object_points) for noise in (0.001, 0.002))
    pixels = np.array([[400.0, 300], [640, 480]])
    once, twice = (projection_sigma(each, pixels, np.inf) for each in (small, large))
    assert twice == pytest.approx(2 * once, rel=1e-3)


def test_no_ray_no_figure(solved):
    """Pixels that the lens lets nothing reach have no standard deviation, and count as not known in the shares."""
    folded = replace(solved, camera=Camera(CAMERA.size, CAMERA.K, [-0.45, 0.0, 0, 0, 0.0]))
    assert np.isnan(projection_sigma(folded, np.array([[0.0, 0.0]]), 0.4))[0]
    assert np.isfinite(projection_sigma(folded, np.array([[640.0, 480.0]]), 0.4))[0]
    known = uncertainty(folded, BOARD.object_points)
    assert np.isnan(known.at_range.corners_px).all()
    assert known.at_range.shares[2] < 1


def test_summary_over_the_image(solved):
    """Centre, edge midpoints and corners are those of the outermost pixels; the range is the boards' median distance."""
    known = uncertainty(solved, BOARD.object_points)
    centre = np.array([0.1, 0.0625, 0.0])
    assert known.range_m == pytest.approx(np.median([np.linalg.norm(pose.apply(centre)) for pose in solved.poses]), rel=1e-12)
    for figures, range_m in ((known.at_range, known.range_m), (known.at_infinity, np.inf)):
        assert figures.centre_px == pytest.approx(projection_sigma(solved, np.array([[639.5, 479.5]]), range_m)[0])
        edges = np.array([[639.5, 0], [1279, 479.5], [639.5, 959], [0, 479.5]])
        assert figures.edges_px == pytest.approx(tuple(projection_sigma(solved, edges, range_m)))
        corners = np.array([[0.0, 0], [1279, 0], [1279, 959], [0, 959]])
        assert figures.corners_px == pytest.approx(tuple(projection_sigma(solved, corners, range_m)))


def test_shares_are_those_of_the_pixels(solved):
    """Counted over every fourth pixel, the share of the image below each limit comes out within 2 %."""
    loose = replace(solved, joint_covariance=solved.joint_covariance * 5.0**2)
    u, v = np.meshgrid(np.arange(0, 1280, 4), np.arange(0, 960, 4))
    sigma = projection_sigma(loose, np.stack([u.ravel(), v.ravel()], axis=1), np.inf)
    expected = [(sigma < limit).mean() for limit in (0.1, 0.5, 1.0)]
    shares = uncertainty(loose, BOARD.object_points).at_infinity.shares
    assert shares == pytest.approx(tuple(expected), abs=0.02)
    assert 0.05 < shares[1] < shares[2] < 0.95
