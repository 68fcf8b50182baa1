"""Cross-validation and influence: against cameras solved apart and without a view, and against what is known to be wrong."""

from __future__ import annotations

from functools import partial

import cv2
import numpy as np
import pytest
from capture_scenes import BOARD, CAMERA, VERY_WIDE, careful_views, ordinary_poses, see

from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.board_shape import shape_basis
from camcal.calibration.solve import solve
from camcal.compare.projection import predicted_difference_px, predicted_length_px, projection_difference, projection_shifts
from camcal.formats.corners_file import load_corners
from camcal.geometry.camera import Camera
from camcal.observations import Detection
from camcal.records import Intrinsics
from camcal.trust.cross_validation import CrossValidation, balanced_splits, cross_validate
from camcal.trust.influence import influence
from camcal.trust.linearised import Linearised, inverse
from camcal.trust.minimum import Minimum
from camcal.workflows.calibrate import calibrate
from camcal.workflows.synth import synth

NOISE_PX = 0.1
capture = partial(careful_views, noise_px=NOISE_PX)


def linearised(views, board=BOARD, **options) -> Linearised:
    """Solve views and linearise the minimum."""
    return Linearised.of(Minimum.of(solve(views, board.object_points, **options), board))


def ratio(views, board=BOARD, **options) -> float:
    """Cross-validation's number."""
    return cross_validate(linearised(views, board, **options)).ratio


def bent(height_m: float) -> np.ndarray:
    """Features of a board that is bowed along its longer side."""
    points = BOARD.object_points
    return points + shape_basis(points, ("bow_x",))[..., 0] * height_m


@pytest.mark.parametrize("views", [6, 7, 8, 13, 20, 64, 100, 500])
def test_splits_are_halves_that_differ(views):
    """Each split has three views or more on either side, none occurs twice (nor the other way round), and few are asked for."""
    splits = balanced_splits(views)
    counts = splits.sum(axis=1)
    assert 1 <= len(splits) <= 63
    assert counts.min() >= 3
    assert (views - counts).min() >= 3
    assert len({row.tobytes() for row in np.concatenate([splits, ~splits])}) == 2 * len(splits)


@pytest.mark.parametrize("views", [8, 16, 64, 128])
def test_splits_are_orthogonal(views):
    """Where the number of views is a power of two the signs of any two splits are orthogonal, and every split is even."""
    signs = np.where(balanced_splits(views), 1, -1)
    assert (signs @ signs.T == views * np.eye(len(signs))).all()
    assert (signs.sum(axis=1) == 0).all()


def test_fewer_than_six_views_have_no_halves():
    """Two views determine no camera: five are too few for two halves."""
    assert balanced_splits(5).shape == (0, 5)


@pytest.mark.parametrize("board_m", [0.0, 5e-4])
def test_ratio_is_that_of_halves_solved_apart(board_m):
    """Over all splits, both ways to compute it from cameras that are really solved anew give the number of the one step.

    One is the fall of the sum of squares (Chow), the other the difference of the cameras in units of their covariances.
    The step is of first order: what it leaves out is a share of the noise over the size of a board in the image, some
    parts in a thousand, and with a bent board some parts in ten.
    """
    views = capture(3, points=bent(board_m))
    calibration = solve(views, BOARD.object_points)
    assert not calibration.outliers
    freedom = 2 * calibration.corner_count - 7 - 6 * len(views)
    total = calibration.rms_px**2 * calibration.corner_count
    variance = total / freedom
    falls, lengths = [], []
    for split in balanced_splits(len(views)):
        halves = [
            solve([view for view, chosen in zip(views, side, strict=True) if chosen], BOARD.object_points)
            for side in (split, ~split)
        ]
        costs = [half.rms_px**2 * half.corner_count for half in halves]
        falls.append((total - sum(costs)) / variance / 7)
        # Each half's own estimate of the variance gives way to that of all views.
        covariance = sum(
            half.covariance * variance / cost * (2 * half.corner_count - 7 - 6 * len(half.poses))
            for half, cost in zip(halves, costs, strict=True)
        )
        columns = [CAMERA.intrinsic_names.index(name) for name in calibration.free]
        d = (halves[0].camera.intrinsics - halves[1].camera.intrinsics)[columns]
        lengths.append(d @ np.linalg.solve(covariance, d) / 7)
    found = ratio(views)
    tolerance = 0.02 if board_m == 0 else 0.15
    assert found == pytest.approx(np.sqrt(np.mean(falls)), rel=tolerance)
    assert found == pytest.approx(np.sqrt(np.mean(lengths)), rel=2 * tolerance)


def test_ratio_is_one_for_noise():
    """Over 20 captures the mean square is 1: 12 views leave 11 independent differences of 7 parameters each, 4 sigma."""
    squares = [ratio(capture(seed)) ** 2 for seed in range(20)]
    assert np.mean(squares) == pytest.approx(1, abs=4 * np.sqrt(2 / (20 * 11 * 7)))


@pytest.mark.parametrize("config", ["webcam_720p", "wide_action"])
def test_ratio_of_clean_renders(config, tmp_path):
    """Rendered views that a pinhole with k1..k3 describes agree with each other as well as they should."""
    synth(config, tmp_path / "data")
    run = calibrate([tmp_path / "data" / "images"], str(tmp_path / "data" / "board.yaml"))
    assert 0.7 <= run.intrinsics.cross_validation <= 1.4


def test_a_bent_board_shows():
    """A board that is bowed by half a millimetre, in views that are otherwise exact to 0.05 px, exceeds 2 every time."""
    assert min(ratio(capture(seed, 20, noise_px=0.05, points=bent(5e-4))) for seed in range(5)) > 2


def test_a_wide_lens_without_k2_shows():
    """k1 alone does not describe a wide lens; nor, less coarsely, do k1 and k2."""
    views = see(ordinary_poses(20, 4, VERY_WIDE), 4, VERY_WIDE, noise_px=0.05)
    assert ratio(views, distortion=("k1",)) > 2
    assert ratio(views, distortion=("k1", "k2")) > 2
    assert ratio(views, distortion=("k1", "k2", "k3")) < 1.4


def test_corners_of_a_biased_finder_show(tmp_path):
    """Corners of cv2.findChessboardCornersSB, off by up to a pixel on a dense and tilted board, exceed 2, noise does not."""
    scene = (
        'name: dense\nseed: 1\nboard: "checkerboard:24x18:10mm"\n'
        "camera: {size: [1280, 960], fx: 900.0, fy: 902.0, cx: 645.0, cy: 470.0, distortion: {k1: -0.2, k2: 0.05}}\n"
        "views: {count: 10, tilt_deg: [0, 45], fill: [0.7, 0.95]}\n"
    )
    (tmp_path / "dense.yaml").write_text(scene)
    synth(tmp_path / "dense.yaml", tmp_path / "data")
    board = Checkerboard(24, 18, 0.01)
    found, exact = [], load_corners(tmp_path / "data" / "corners.csv")
    rng = np.random.default_rng(0)
    for truth in exact:
        image = cv2.imread(str(tmp_path / "data" / "images" / truth.source), cv2.IMREAD_GRAYSCALE)
        ok, corners = cv2.findChessboardCornersSB(image, (24, 18))
        if ok and len(truth) == len(corners):
            # The board has one orientation or two: the nearer one is meant.
            both = np.reshape(corners, (-1, 2)), np.reshape(corners, (-1, 2))[::-1]
            nearest = min(both, key=lambda each, at=truth.corners_px: np.abs(each - at).max())
            found.append(Detection(truth.source, truth.size, truth.ids, nearest.astype(float), truth.sigma_px))
    assert len(found) >= 8
    assert ratio(found, board) > 2
    noisy = [
        Detection(t.source, t.size, t.ids, t.corners_px + 0.05 * rng.normal(size=(len(t), 2)), np.full(len(t), np.nan))
        for t in exact
    ]
    assert ratio(noisy, board) < 1.4


@pytest.mark.parametrize("views", [3, 5])
def test_too_few_views_have_no_ratio(views):
    """Fewer than six views: no number and no finding."""
    found = cross_validate(linearised(capture(1, views)))
    assert np.isnan(found.ratio)
    assert found.findings == ()


def test_perfect_corners_have_no_ratio():
    """Where nothing scatters there is nothing to compare with."""
    found = cross_validate(linearised(capture(1, noise_px=0)))
    assert np.isnan(found.ratio)
    assert found.findings == ()


def test_predicted_error_is_the_covariances():
    """The median over the image is that of the calibration's own covariance."""
    views = capture(2)
    calibration = solve(views, BOARD.object_points)
    found = cross_validate(linearised(views))
    estimate = Intrinsics(calibration.camera, free=calibration.free, covariance=calibration.covariance)
    # Another grid of the same image: within a few per cent.
    assert found.predicted_px == pytest.approx(np.median(predicted_difference_px(estimate)), rel=0.1)
    assert found.error_px == found.ratio * found.predicted_px


@pytest.mark.parametrize(
    ("ratio", "px", "level"), [(1.9, 5.0, None), (2.1, 5.0, "usable"), (4.5, 0.1, "usable"), (4.5, 0.5, "poor")]
)
def test_level_of_inconsistent_halves(ratio, px, level):
    """Usable beyond 2; poor beyond 4 if far points are more than a pixel off as well."""
    findings = CrossValidation(ratio, 15, px).findings
    assert [finding.level for finding in findings] == ([level] if level else [])
    assert all(finding.code == "inconsistent" and f"{ratio:.1f} times" in finding.text for finding in findings)


@pytest.mark.parametrize("is_bow_free", [False, True])
def test_advice_is_not_what_was_done(is_bow_free):
    """Where the bow is solved for already, --warp is no advice."""
    (finding,) = CrossValidation(3.0, 15, 1.0, is_bow_free).findings
    assert ("--warp" in finding.advice) != is_bow_free


def test_inverse_of_very_different_units():
    """Parameters whose units lie 12 orders of magnitude apart are inverted to full precision; what is undetermined stays 0."""
    units = np.array([1e6, 1.0, 1e-6])
    matrix = np.array([[2.0, 1, 0], [1, 2, 1], [0, 1, 2]])
    assert inverse(matrix * np.outer(units, units)) * np.outer(units, units) == pytest.approx(np.linalg.inv(matrix), rel=1e-12)
    assert inverse(np.diag([4.0, 0.0])).tolist() == [[0.25, 0], [0, 0]]


def test_shifts_are_those_of_another_camera():
    """Intrinsics moved a little: to first order, far points move as a comparison of the two cameras finds them moved."""
    moved = CAMERA.intrinsics + np.array([0.2, 0.1, 0.3, -0.2, 0, 1e-4, -1e-4, 0, 0, 0, 0, 0, 0])
    difference = projection_difference(CAMERA, CAMERA.with_intrinsics(moved))
    names = ("fx", "fy", "cx", "cy", "k1", "k2")
    change = np.array([[0.2, 0.1, 0.3, -0.2, 1e-4, -1e-4]])
    shifts = projection_shifts(CAMERA, names, change, difference.pixels)[0]
    # Second order: a relative change of the intrinsics of 3e-4 times a difference of about half a pixel.
    assert np.abs(shifts - difference.difference_px).max() < 1e-3
    assert np.linalg.norm(shifts, axis=1).max() > 0.1
    lengths = predicted_length_px(CAMERA, names, change.T @ change, difference.pixels)
    assert lengths == pytest.approx(np.linalg.norm(shifts, axis=1), rel=1e-6)


def test_influence_is_that_of_leaving_a_view_out():
    """Each view left out and the rest solved anew: the same view matters most, by the same distance, within a tenth."""
    views = capture(5)
    calibration = solve(views, BOARD.object_points)
    columns = [CAMERA.intrinsic_names.index(name) for name in calibration.free]
    moves = []
    for left_out in range(len(views)):
        others = solve([view for index, view in enumerate(views) if index != left_out], BOARD.object_points)
        moves.append((others.camera.intrinsics - calibration.camera.intrinsics)[columns])
    distances = [np.sqrt(d @ np.linalg.solve(calibration.covariance, d) / len(d)) for d in moves]
    corners = np.concatenate([view.corners_px for view in views])
    found = influence(linearised(views), [view.source for view in views], corners)
    most = int(np.argmax(distances))
    assert found.source == views[most].source
    assert found.sigmas == pytest.approx(distances[most], rel=0.1)
    assert found.typical == pytest.approx(np.median(distances), rel=0.1)
    # How far the projection moves at the place that is named, with the rotation fitted at pixels spread over the image.
    here = np.array([found.place_px])
    grid = np.concatenate([here, corners[::3]])
    shift = projection_shifts(calibration.camera, calibration.free, moves[most][None], grid)[0, 0]
    assert found.shift_px == pytest.approx(np.linalg.norm(shift), rel=0.2)
    assert found.findings == ()


def test_a_view_that_contradicts_the_others_is_named():
    """One view of another camera, near enough not to be thrown out, moves the answer most and is named."""
    poses = ordinary_poses(12, 7)
    # Its focal length is 1 % longer.
    other = Camera(CAMERA.size, np.diag([1.01, 1.01, 1]) @ CAMERA.K, CAMERA.lens)
    views = see(poses, 7, lambda index: other if index == 4 else CAMERA, noise_px=0.02)
    calibration = solve(views, BOARD.object_points)
    assert len(calibration.poses) == 12
    corners = np.concatenate([view.corners_px for view in calibration.detections])
    found = influence(linearised(views), [view.source for view in views], corners)
    assert found.source == views[4].source
    (finding,) = found.findings
    assert finding.code == "influential_view"
    assert views[4].source in finding.text


def test_three_views_have_no_influence():
    """Without one of three views the other two determine nothing."""
    views = capture(1, 3)
    found = influence(linearised(views), [view.source for view in views], views[0].corners_px)
    assert np.isnan(found.sigmas)
    assert found.findings == ()
