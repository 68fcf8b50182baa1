"""The solve: exact on exact corners, OpenCV's minimum and standard deviations, honest covariances."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenes import BOARD, CAMERA, WIDE_DISTANCES, WIDE_REACH, detections, poses

from camcal.calibration.finish import descend
from camcal.calibration.normal_equations import Observations, State
from camcal.calibration.parameters import DEFAULT_DISTORTION, free_names, parse_distortion, places
from camcal.calibration.solve import solve
from camcal.geometry.camera import Camera
from camcal.observations import Detection

POINTS = BOARD.object_points
FREE_COLUMNS = [0, 1, 2, 3, 5, 6, 9]


def opencv(views):
    """OpenCV's own calibration of the same views with k1..k3."""
    points = [POINTS[d.ids].astype(np.float32) for d in views]
    corners = [d.corners_px.astype(np.float32) for d in views]
    return cv2.calibrateCameraExtended(points, corners, views[0].size, None, None, flags=cv2.CALIB_ZERO_TANGENT_DIST)


@pytest.mark.parametrize("seed", range(3))
def test_exact_corners_give_the_exact_camera(seed):
    """From perfect corners f and c come back within 1e-6 px, k1 and k2 within 1e-9, k3 within 1e-8."""
    solved = solve(detections(poses(15, seed)), POINTS)
    error = np.abs(solved.camera.intrinsics - CAMERA.intrinsics)
    assert error[:4].max() < 1e-6
    assert error[5:7].max() < 1e-9
    assert error[9] < 1e-8
    assert solved.camera.intrinsics[[4, 7, 8, 10, 11, 12]].tolist() == [0] * 6


def test_exact_corners_give_the_exact_poses():
    """The poses come back too, in the order of the sorted view names."""
    truth = poses(10, 4)
    solved = solve(list(reversed(detections(truth))), POINTS)
    for pose, true in zip(solved.poses, truth, strict=True):
        assert np.abs(pose.R - true.R).max() < 1e-9
        assert np.abs(pose.t - true.t).max() < 1e-9


@pytest.mark.parametrize("free", ["k1,k2,p1,p2,k3", "k1,k2,p1,p2,k4"])
def test_every_coefficient_can_be_free(free):
    """Tangential and rational coefficients are solved when named: exact corners give them back exactly."""
    names = parse_distortion(free)
    values = {"k1": -0.2, "k2": 0.05, "p1": 0.001, "p2": -0.002, "k3": 0.01, "k4": 0.05}
    truth = Camera(CAMERA.size, CAMERA.K, [values[n] if n in names else 0.0 for n in CAMERA.lens.coefficient_names])
    solved = solve(detections(poses(25, 5, camera=truth), camera=truth), POINTS, distortion=names)
    assert solved.free == ("fx", "fy", "cx", "cy", *names)
    assert np.abs(solved.camera.intrinsics - truth.intrinsics).max() < 1e-6


def lens(focal, coefficients, principal=(645, 470)):
    """A camera of 1280x960 pixels."""
    cx, cy = principal
    return Camera((1280, 960), [[focal, 0, cx], [0, focal + 1, cy], [0, 0, 1]], coefficients)


def rms_from_the_truth(views, camera, truth):
    """RMS of the minimum that is reached from the true camera and poses: the right one."""
    seen = Observations.gather(views, POINTS)
    found = descend(State.of(camera, truth), seen, places(camera, free_names(DEFAULT_DISTORTION)))
    return np.sqrt(found.cost / seen.view.size)


@pytest.mark.parametrize(
    ("count", "focal", "coefficients"),
    [(15, 500, [-0.25, 0.05, 0, 0, -0.004]), (15, 350, [-0.22, 0.035, 0, 0, -0.002]), (3, 500, [-0.25, 0.05, 0, 0, -0.004])],
)
def test_wide_lenses_end_in_the_right_minimum(count, focal, coefficients):
    """Corners out to twice the focal length from the centre: no board of 20 captures stays in the wrong pose."""
    camera = lens(focal, coefficients)
    for seed in range(20):
        truth = poses(count, seed, camera=camera, tilt=0.4, reach=WIDE_REACH, distances=WIDE_DISTANCES)
        views = detections(truth, camera=camera, noise_px=0.1, seed=seed)
        # Both are the same minimum, found to 1e-13 of the sum of squares.
        assert solve(views, POINTS).rms_px == pytest.approx(rms_from_the_truth(views, camera, truth), rel=1e-6), seed


@pytest.mark.parametrize("principal", [(1279, 480), (1100, 100), (200, 700), (100, 900)])
def test_principal_points_far_from_the_centre(principal):
    """A cropped sensor's camera ends in the right minimum as well."""
    camera = lens(900, [-0.1], principal)
    for seed in range(6):
        truth = poses(12, seed, camera=camera)
        views = detections(truth, camera=camera, noise_px=0.1)
        assert solve(views, POINTS).rms_px == pytest.approx(rms_from_the_truth(views, camera, truth), rel=1e-6), seed


def test_opencv_starts_with_few_coefficients(monkeypatch):
    """OpenCV is first asked for K and k1 alone, then for everything; and an ordinary capture needs no more than that."""
    asked = []
    original = cv2.calibrateCamera

    def spy(*args, flags, **kwargs):
        asked.append(flags)
        return original(*args, flags=flags, **kwargs)

    monkeypatch.setattr(cv2, "calibrateCamera", spy)
    solve(detections(poses(12, 6), noise_px=0.1), POINTS)
    first, second = asked
    held = cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
    assert first & (held | cv2.CALIB_FIX_K1) == held
    assert second & (held | cv2.CALIB_FIX_K1) == 0
    assert second & cv2.CALIB_USE_INTRINSIC_GUESS


def test_minimum_is_no_higher_than_opencvs():
    """The float64 finish ends at a sum of squares that is not above OpenCV's, and close to it."""
    views = detections(poses(12, 6), noise_px=0.2)
    reference = opencv(views)[0]
    rms = solve(views, POINTS).rms_px
    assert rms <= reference * (1 + 1e-6)
    assert rms == pytest.approx(reference, rel=1e-4)


def test_standard_deviations_are_opencvs():
    """Intrinsics and poses: within 0.1 % of calibrateCameraExtended, which works from single-precision corners."""
    views = detections(poses(15, 7), noise_px=0.1)
    solved = solve(views, POINTS)
    *_, intrinsics, extrinsics, _ = opencv(views)
    assert np.sqrt(np.diag(solved.covariance)) == pytest.approx(intrinsics.ravel()[[0, 1, 2, 3, 4, 5, 8]], rel=1e-3)
    assert solved.pose_sigmas == pytest.approx(extrinsics.reshape(-1, 6), rel=1e-3)


def test_errors_follow_the_covariance():
    """Over 60 noise draws the squared Mahalanobis distance of the intrinsics averages 7, their number, within 4 sigma."""
    views = poses(10, 8)
    distances = []
    for seed in range(60):
        solved = solve(detections(views, noise_px=0.1, seed=seed), POINTS)
        error = (solved.camera.intrinsics - CAMERA.intrinsics)[FREE_COLUMNS]
        distances.append(error @ np.linalg.solve(solved.covariance, error))
    assert np.mean(distances) == pytest.approx(7, abs=4 * np.sqrt(2 * 7 / 60))


def test_order_of_the_views_changes_no_bit():
    """Shuffled views give the same bytes."""
    views = detections(poses(9, 9), noise_px=0.1)
    first, second = solve(views, POINTS), solve(views[4:] + views[:4], POINTS)
    assert first.camera.intrinsics.tobytes() == second.camera.intrinsics.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()


def test_known_sigmas_weigh_the_corners():
    """With half of the views ten times as noisy, weighing them by their sigma shrinks the error of the focal length.

    The bad half carries 1 % of the information: the weighted standard deviation must be near that of the good half
    alone, where equal weights leave sqrt(101 / 2) / sqrt(2), five times as much.
    """
    truth = poses(16, 10)
    good, bad = detections(truth[:8], noise_px=0.05), detections(truth[8:], noise_px=0.5, seed=1)
    bad = [replace(d, source=f"zbad_{d.source}") for d in bad]
    weighted = [replace(d, sigma_px=np.full(len(d), 0.05)) for d in good]
    weighted += [replace(d, sigma_px=np.full(len(d), 0.5)) for d in bad]
    sigma = np.sqrt(solve(weighted, POINTS).covariance[0, 0])
    equal = np.sqrt(solve(good + bad, POINTS).covariance[0, 0])
    assert sigma < 0.4 * equal


def test_partial_views_are_solved():
    """Each view may show its own subset of the features; exact corners still give the exact camera."""
    rng = np.random.default_rng(11)
    views = []
    for view in detections(poses(12, 11)):
        keep = np.sort(rng.choice(len(view), size=20, replace=False))
        views.append(Detection(view.source, view.size, view.ids[keep], view.corners_px[keep], view.sigma_px[keep]))
    assert np.abs(solve(views, POINTS).camera.intrinsics - CAMERA.intrinsics)[:4].max() < 1e-6


@pytest.mark.parametrize("extreme", [5e-324, 1e-300, 1e308])
def test_extreme_sigmas_do_no_harm(extreme):
    """A sigma off by hundreds of orders of magnitude weighs a hundredfold at most: no warning, and a camera as good.

    Half of the corners alone give standard deviations about sqrt(2) times as large.
    """
    views = detections(poses(12, 6), noise_px=0.1)
    sigma = np.ones(54)
    sigma[::2] = extreme
    solved = solve([replace(view, sigma_px=sigma) for view in views], POINTS)
    plain = solve(views, POINTS)
    assert np.abs(solved.camera.intrinsics - CAMERA.intrinsics)[0] < 4 * np.sqrt(2 * plain.covariance[0, 0])


def test_covariance_is_exactly_symmetric():
    """Not only up to the last bits."""
    covariance = solve(detections(poses(9, 6), noise_px=0.1), POINTS).covariance
    assert np.array_equal(covariance, covariance.T)
