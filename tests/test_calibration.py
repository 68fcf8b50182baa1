"""The solve: exact on exact corners, OpenCV's minimum and standard deviations, honest covariances, and its refusals."""

from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenes import BOARD, CAMERA, WIDE_DISTANCES, WIDE_REACH, detections, poses

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.causes import quarter_turn, solve_board
from camcal.calibration.finish import descend
from camcal.calibration.normal_equations import Observations, State
from camcal.calibration.parameters import DEFAULT_DISTORTION, free_names, parse_distortion, places
from camcal.calibration.solve import solve
from camcal.errors import DetectionError, InputError, SolveError
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection, Rejected
from camcal.trust.gates import gate_findings

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


def test_a_focal_length_that_is_not_known_is_refused():
    """Tilts below a degree leave a solvable system, but no focal length: the error gives its standard deviation."""
    with pytest.raises(SolveError, match=r"fx and fy known to ±\d+ %.*Tilt the board") as caught:
        solve(detections(poses(10, 2, tilt=0.01), noise_px=0.1), POINTS)
    assert "--distortion" not in str(caught.value)


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


def with_corners(view, corners_px):
    """The same view with other corners."""
    return replace(view, corners_px=corners_px)


def grid(view):
    """A view's corners as (rows, columns, 2)."""
    return view.corners_px.reshape(6, 9, 2)


@pytest.mark.parametrize(
    ("corners", "reason"),
    [
        (np.tile([[300.0, 200.0]], (54, 1)), "one line or point of the image"),
        (np.linspace([0, 0], [900, 700], 54), "one line or point of the image"),
        (np.concatenate([[[9e6, 12.0]], np.mgrid[:53, :2][0] * [9.0, 7.0]]), "far outside the image .got 9e.06, 12"),
    ],
)
def test_corners_that_no_board_shows_are_rejected_by_name(corners, reason):
    """All on one pixel or line of the image, or one at nine million pixels: that view is left out, the others solved."""
    views = detections(poses(8, 15), noise_px=0.02)
    solved = solve([with_corners(views[3], corners), *views[:3], *views[4:]], POINTS)
    (rejected,) = solved.rejected
    assert rejected.source == "view_003"
    assert re.search(reason, rejected.reason)
    assert solved.covariance.tobytes() == solve(views[:3] + views[4:], POINTS).covariance.tobytes()


def test_copies_of_a_view_hold_no_information():
    """A view under a second name is rejected, so that copies neither shrink the uncertainty nor make up three views."""
    views = detections(poses(8, 15), noise_px=0.1)
    copies = [replace(view, source=f"{view.source}_copy") for view in views]
    solved = solve(copies + views, POINTS)
    assert solved.covariance.tobytes() == solve(views, POINTS).covariance.tobytes()
    assert {r.reason for r in solved.rejected} == {f"the same view as {view.source}" for view in views}
    with pytest.raises(DetectionError, match="got 2, expected at least 3"):
        solve(views[:2] + copies[:2], POINTS)


def test_a_view_of_garbage_is_left_out_by_name():
    """Random corners in one view bend the camera until it is not determined: without that view it is as good as ever."""
    views = detections(poses(12, 6), noise_px=0.1)
    garbage = with_corners(views[5], np.random.default_rng(0).uniform(0, 900, (54, 2)))
    solved = solve_board([garbage, *views[:5], *views[6:]], BOARD)
    (rejection,) = solved.rejected
    assert rejection.source == "view_005"
    assert "does not fit the other views" in rejection.reason
    expected = solve([*views[:5], *views[6:]], POINTS)
    np.testing.assert_allclose(solved.camera.intrinsics, expected.camera.intrinsics, rtol=1e-6, atol=1e-9)


def test_nothing_but_garbage_does_not_ask_for_tilt():
    """Corners that fit no board in any view: the SPEC is the likely cause, not the tilt or the coefficients."""
    rng = np.random.default_rng(0)
    views = [with_corners(view, rng.uniform(0, 900, (54, 2))) for view in detections(poses(8, 6))]
    with pytest.raises(SolveError, match=r"view_00. fits worst .*SPEC") as caught:
        solve_board(views, BOARD)
    assert "Tilt" not in str(caught.value)
    assert "--distortion" not in str(caught.value)


def test_mirrored_corners_are_refused():
    """Corners numbered from the wrong side fit perfectly, to boards seen from behind: an error that says so."""
    views = [with_corners(v, grid(v)[:, ::-1].reshape(-1, 2)) for v in detections(poses(9, 6), noise_px=0.1)]
    with pytest.raises(SolveError, match=r"seen from behind in 9 of 9 views: the ids or the images are mirrored"):
        solve_board(views, BOARD)


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


@pytest.mark.parametrize(
    ("board", "spec"),
    [
        (BOARD, "checkerboard:6x9:25mm"),
        (AprilGrid(5, 4, 0.03, 0.009, family="tag25h9"), "aprilgrid:4x5:30mm:0.3:family=tag25h9"),
    ],
)
def test_transposed_boards(board, spec):
    """Rows and columns change places, everything else stays; a board with as many of both has no other."""
    assert board.transposed.spec == spec
    assert board.transposed.transposed == board
    assert replace(board, columns=4, rows=4).transposed is None


@pytest.mark.parametrize(("turn_deg", "noted"), [(0, False), (90, True), (180, False), (-90, True)])
def test_quarter_turn_is_noted(turn_deg, noted):
    """A 6x9 board whose long side runs across the image may be meant as 9x6; one that stands upright may not."""
    board = Checkerboard(6, 9, 0.025)
    solved = solve(detections(poses(8, 6, board=board), board=board), board.object_points)
    turned = [Pose.from_rvec([0, 0, np.radians(turn_deg)], pose.t) for pose in solved.poses]
    note = quarter_turn(replace(solved, poses=tuple(turned)), board)
    assert (note is not None) == noted
    assert note is None or "checkerboard:9x6:25mm" in note
    assert quarter_turn(replace(solved, poses=tuple(turned)), BOARD) is None


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
        message = str(gate_findings(solved, BOARD)[0])
    assert "checkerboard:6x9:25mm" in message
    assert "rows and columns are swapped" in message


def test_unsolvable_views_of_the_right_board_are_not_called_swapped():
    """A degenerate capture stays an error of its own."""
    with pytest.raises(SolveError) as caught:
        solve_board(detections(poses(8, 12, tilt=0.0), noise_px=0.02), BOARD)
    assert "swapped" not in str(caught.value)


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
