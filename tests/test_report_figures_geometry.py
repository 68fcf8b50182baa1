"""Figures of camera, lens, board and views: what they show is where the geometry says."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from capture_scenes import CAMERA, ordinary_poses
from figure_records import LIGHT, folding, made

from camcal.boards.checkerboard import Checkerboard
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.report.figures import board_plane, coverage, distortion, scene, stance, uncertainty
from camcal.trust.uncertainty import projection_sigma


def test_sigma_map_is_the_projection_sigma(record):
    """The map's nodes span the image to its outer edges and hold `projection_sigma` there."""
    x, y, sigma = uncertainty.sigma_map(record.calibration, 0.4)
    assert (x[0], x[-1], y[0], y[-1]) == (-0.5, 1279.5, -0.5, 959.5)
    at = [[x[7], y[3]], [x[50], y[40]]]
    np.testing.assert_allclose([sigma[3, 7], sigma[40, 50]], projection_sigma(record.calibration, at, 0.4), rtol=1e-12)


def test_sigma_map_is_empty_past_the_fold():
    """No ray reaches beyond 500 * 1.1547 * (1 - 0.25 * 1.1547²) = 384.9 px from the principal point."""
    drawn = folding()
    x, y, sigma = uncertainty.sigma_map(drawn.calibration, float("inf"))
    away = np.hypot(*(np.stack(np.meshgrid(x, y)) - np.array([640, 480])[:, None, None]))
    assert np.isnan(sigma[away > 385]).all()
    assert np.isfinite(sigma[away < 384]).all()


def test_region_counts_add_up(record):
    """Every corner is in one region, the one that holds it; 1280 x 960 has 8 x 6 regions of 160 px."""
    corners = np.array([[-0.4, -0.4], [159.4, 159.4], [159.6, 0.0], [1279.4, 959.4], [2000.0, -50.0]])
    counts = coverage.region_counts(corners, (1280, 960))
    assert counts.shape == (6, 8)
    assert (counts[0, 0], counts[0, 1], counts[5, 7], counts[0, 7], counts.sum()) == (2, 1, 1, 1, 5)
    everywhere = np.concatenate([seen.corners_px for seen in record.calibration.detections])
    assert coverage.region_counts(everywhere, record.calibration.camera.size).sum() == record.calibration.corner_count


def test_stances_of_boards_turned_by_hand():
    """A board turned by 30° about y has its left side nearer; about x, by -20°, its bottom; distances are of its centre."""
    board = Checkerboard(9, 6, 0.025)
    centre = np.array([0.1, 0.0625, 0.0])
    turns = [Pose.from_rvec([0, np.radians(30), 0], [0, 0, 0]), Pose.from_rvec([np.radians(-20), 0, 0], [0, 0, 0])]
    views = [Pose(turn.R, np.array([0, 0, z]) - turn.R @ centre) for turn, z in zip(turns, (0.5, 0.8), strict=True)]
    nearer = [views[0].apply([[0.0, 0.06, 0], [0.2, 0.06, 0]])[:, 2], views[1].apply([[0.1, 0.0, 0], [0.1, 0.125, 0]])[:, 2]]
    tilt_deg, azimuth, distance_m = stance.stances(made(views, board=board))
    np.testing.assert_allclose(tilt_deg, [30, 20], atol=1e-9)
    np.testing.assert_allclose(distance_m, [0.5, 0.8], atol=1e-12)
    # Rotating about +y moves the right side (x > 0) towards the camera: z' = -x sin θ.
    assert nearer[0][1] < nearer[0][0]
    assert azimuth[0] == pytest.approx(0.0, abs=1e-12)
    # Rotating about +x moves the bottom away: z' = y sin θ; with -20° it comes nearer.
    assert nearer[1][1] < nearer[1][0]
    assert azimuth[1] == pytest.approx(-np.pi / 2)


def test_the_curve_is_what_opencv_projects(record):
    """cv2.projectPoints displaces the pixel's own ray to the radius that the curve gives, in every direction."""
    camera = Camera((1280, 960), [[900, 0, 600], [0, 950, 470], [0, 0, 1]], [-0.2, 0.05, 0.002, -0.001, 0.01])
    radii, displacement = distortion.displacements(camera)
    for row, direction in ((40, 0), (90, 7), (160, 30)):
        angle = direction / displacement.shape[1] * 2 * np.pi
        pixel = camera.K[:2, 2] + radii[row] * np.array([np.cos(angle), np.sin(angle)])
        ray = camera.unproject(pixel)
        seen = cv2.projectPoints(ray[None], np.zeros(3), np.zeros(3), camera.K, camera.dist)[0].ravel()
        pinhole = cv2.projectPoints(ray[None], np.zeros(3), np.zeros(3), camera.K, None)[0].ravel()
        lengths = [np.linalg.norm(point - camera.K[:2, 2]) for point in (seen, pinhole)]
        assert lengths[0] == pytest.approx(radii[row], abs=1e-6)
        assert displacement[row, direction] == pytest.approx(lengths[0] - lengths[1], abs=1e-6)
    line = distortion.draw(record, LIGHT).axes[0].lines[0]
    assert line.get_ydata()[-1] < 0  # a barrel


def test_the_valid_radius_is_marked():
    """A line stands at 384.9 px (see above), and the curve ends there."""
    axes = distortion.draw(folding(), LIGHT).axes[0]
    lines = {line.get_label(): line.get_xdata() for line in axes.lines}
    assert lines["valid up to 385 px"][0] == pytest.approx(500 * 2 / np.sqrt(3) * (1 - 1 / 3), rel=1e-6)
    assert lines["this lens"][-1] < 385
    assert "Beyond 385 px" in distortion.caption(folding())


def test_a_displaced_feature_is_found():
    """A feature printed 0.2 mm from its place shows there, as far as poses do not take it up; the others stay."""
    board = Checkerboard(9, 6, 0.025)
    views = ordinary_poses(12, 3)
    printed = board.object_points.copy()
    printed[22, :2] += [0.0002, -0.0001]
    off = tuple(CAMERA.project(pose.apply(printed)) - CAMERA.project(pose.apply(board.object_points)) for pose in views)
    base = made(views, board=board)
    found, sigmas = board_plane.feature_offsets(replace(base, calibration=replace(base.calibration, residuals_px=off)))
    # The projection is linear in so small a shift but for its square over the distance: below a millionth of a metre.
    np.testing.assert_allclose(found[22], [0.0002, -0.0001], atol=1e-6)
    assert np.abs(np.delete(found, 22, axis=0)).max() < 1e-12
    assert np.isfinite(sigmas).all()


def test_features_hardly_seen_are_left_open():
    """A feature seen in one view only has no mean."""
    drawn = made(ordinary_poses(3, 1))
    seen = [view.take(view.ids != 10) if i else view for i, view in enumerate(drawn.calibration.detections)]
    off = [o[view.ids != 10] if i else o for i, (o, view) in enumerate(
        zip(drawn.calibration.residuals_px, drawn.calibration.detections, strict=True))]  # fmt: skip
    calibration = replace(drawn.calibration, detections=tuple(seen), residuals_px=tuple(off))
    _, sigmas = board_plane.feature_offsets(replace(drawn, calibration=calibration))
    assert np.flatnonzero(np.isnan(sigmas)).tolist() == [10]


def test_the_sigma_of_a_feature_is_that_of_its_mean():
    """Over 200 draws of noise the offsets of a feature scatter as its sigma says, within 4 standard errors.

    These are of 400 components, and of the 648 that the RMS comes from.
    """
    base = made(ordinary_poses(6, 3))
    draws = [made(ordinary_poses(6, 3), seed=seed).calibration.residuals_px for seed in range(200)]
    found = [
        board_plane.feature_offsets(replace(base, calibration=replace(base.calibration, residuals_px=noise)))[0][22]
        for noise in draws
    ]
    _, sigmas = board_plane.feature_offsets(base)
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(sigmas[22], rel=4 * np.sqrt(1 / 800 + 1 / 1296))


def test_boards_stand_where_the_poses_say(record):
    """The quads are the outermost features in the camera frame, coloured darker the better the view fits."""
    quads = scene.outlines(record)
    pose = record.calibration.poses[4]
    np.testing.assert_allclose(quads[4], pose.apply([[0, 0, 0], [0.2, 0, 0], [0.2, 0.125, 0], [0, 0.125, 0]]))
    axes = scene.draw(record, LIGHT).axes[0]
    low, high = axes.get_zlim()
    assert low > high  # y points down
    spans = np.abs([np.subtract(*axes.get_xlim()), np.subtract(*axes.get_ylim()), high - low])
    box = np.array(axes._box_aspect)
    np.testing.assert_allclose(spans / spans[0], box / box[0], rtol=1e-9)
