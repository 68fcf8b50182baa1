"""The solve: exact on exact corners, OpenCV's minimum and standard deviations, honest covariances, and its refusals."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenes import BOARD, CAMERA, detections, poses

from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.causes import solve_board
from camcal.calibration.gates import quality_problems
from camcal.calibration.parameters import free_names, parse_distortion
from camcal.calibration.solve import solve
from camcal.errors import DetectionError, InputError, SolveError
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection, Rejected

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


def test_indistinguishable_coefficients_are_refused():
    """k1..k3 and k4..k6 all free on a mild lens say the same thing twice: an error that advises to free fewer."""
    with pytest.raises(SolveError, match="free fewer coefficients"):
        solve(detections(poses(10, 5)), POINTS, distortion=parse_distortion("k1,k2,k3,k4,k5,k6"))


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


def test_fronto_parallel_views_are_refused():
    """Without any tilt focal length and distance cannot be told apart: an error that says to tilt."""
    views = [Pose(p.R, p.t) for p in poses(8, 12, tilt=0.0)]
    with pytest.raises(SolveError, match="Tilt the board"):
        solve(detections(views, noise_px=0.02), POINTS)


def test_two_views_are_too_few():
    """Fewer than three usable views: an error that names the first rejected image and why."""
    with pytest.raises(DetectionError, match=r"got 2, expected at least 3.*bad\.png: no board"):
        solve(detections(poses(2, 14)), POINTS, rejected=[Rejected("bad.png", "no board found")])


def test_views_with_too_few_corners_are_rejected_by_name():
    """A view of five corners, or of one row only, is left out with its reason."""
    views = detections(poses(8, 15), noise_px=0.02)
    few = Detection("few", views[0].size, np.arange(5), views[0].corners_px[:5], np.full(5, np.nan))
    line = Detection("line", views[0].size, np.arange(9), views[0].corners_px[:9], np.full(9, np.nan))
    solved = solve([*views, few, line], POINTS)
    assert len(solved.detections) == 8
    assert {r.source: r.reason for r in solved.rejected} == {
        "few": "too few corners for a pose (got 5, expected at least 6)",
        "line": "all corners lie on one line",
    }


@pytest.mark.parametrize("seed", [16, 21, 22])
def test_swapped_rows_and_columns_are_recognised(seed):
    """Corners labelled for 6x9 but solved as 9x6 never pass: an error or a problem that names the board that fits."""
    other = Checkerboard(6, 9, 0.025)
    views = detections(poses(10, seed, board=other), board=other, noise_px=0.02)
    try:
        solved = solve_board(views, BOARD)
    except SolveError as error:
        message = str(error)
    else:
        assert solved.rms_px > 3
        message = quality_problems(solved, BOARD)[0]
    assert "checkerboard:6x9:25mm" in message
    assert "rows and columns are swapped" in message


def test_unsolvable_views_of_the_right_board_are_not_called_swapped():
    """A degenerate capture stays an error of its own."""
    with pytest.raises(SolveError) as caught:
        solve_board(detections(poses(8, 12, tilt=0.0), noise_px=0.02), BOARD)
    assert "swapped" not in str(caught.value)


def test_good_calibration_passes_every_gate():
    """Ordinary noise raises no problem."""
    assert quality_problems(solve(detections(poses(10, 17), noise_px=0.1), POINTS), BOARD) == ()


def test_pixels_far_from_square_need_the_flag():
    """An fx / fy of 2 is a problem unless it was announced."""
    camera = Camera(CAMERA.size, [[900, 0, 640], [0, 450, 480], [0, 0, 1]], [-0.1])
    solved = solve(detections(poses(10, 18, camera=camera), camera=camera), POINTS)
    assert "fx / fy is 2.000" in quality_problems(solved, BOARD)[0]
    assert quality_problems(solved, BOARD, anamorphic=True) == ()


def test_fold_inside_the_corners_is_a_problem():
    """A model that turns back inside the area of the corners must not be handed over."""
    solved = solve(detections(poses(10, 19), noise_px=0.1), POINTS)
    folded = replace(solved, camera=Camera(CAMERA.size, CAMERA.K, [-2.0]))
    problems = quality_problems(folded, BOARD)
    assert any("turns back" in problem for problem in problems)


def test_mixed_image_sizes_are_a_programming_error():
    """The caller groups by size; a mixture is refused."""
    views = detections(poses(4, 20))
    with pytest.raises(ValueError, match="one image size"):
        solve([*views[:3], replace(views[3], size=(640, 480))], POINTS)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("k1,k2,k3", ("k1", "k2", "k3")),
        ("k3, k1", ("k1", "k3")),
        ("p2,p1,k1", ("k1", "p1", "p2")),
        ("none", ()),
        ("k1,k2,p1,p2,k3,k4,k5,k6", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
    ],
)
def test_distortion_lists_are_read_in_any_order(text, names):
    """The names come back in stored order."""
    assert parse_distortion(text) == names
    assert free_names(names)[:4] == ("fx", "fy", "cx", "cy")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("k7", "unknown coefficient"),
        ("k1,k1", "each coefficient once"),
        ("", "each coefficient once"),
        ("k1,p1", "go together"),
    ],
)
def test_wrong_distortion_lists_are_refused(text, message):
    """Unknown, repeated, missing names and half a tangential pair."""
    with pytest.raises(InputError, match=message):
        parse_distortion(text)
