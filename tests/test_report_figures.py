"""The figures of the report: what they show is what the calibration says, and they can be drawn whatever it says."""

from __future__ import annotations

import io
import re
import threading
import time
import xml.etree.ElementTree as ET
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from capture_scenes import CAMERA, GRID, ordinary_poses, see
from matplotlib.colors import to_hex
from matplotlib.patches import PathPatch
from PIL import Image
from scenes import BOARD, poses

from camcal.boards.checkerboard import Checkerboard
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Calibration, Detection, Outlier
from camcal.records import Intrinsics
from camcal.report.figures import (
    board_plane,
    coverage,
    distortion,
    histogram,
    quivers,
    radius,
    residuals,
    scene,
    stance,
    uncertainty,
)
from camcal.report.figures.canvas import magnification, magnified, round_below
from camcal.report.figures.catalogue import FIGURES, KINDS, STYLES, render, render_svg, view_quiver
from camcal.report.record import Record
from camcal.trust.uncertainty import projection_sigma

NAMES = [kind.name for kind in FIGURES]
BY_NAME = {kind.name: kind for kind in FIGURES}
LIGHT = STYLES["light"]
FREE = ("fx", "fy", "cx", "cy", "k1", "k2", "k3")
SVG = "{http://www.w3.org/2000/svg}"


def made(
    views: list[Pose],
    *,
    camera: Camera = CAMERA,
    board=BOARD,
    noise_px: float = 0.1,
    seed: int = 5,
    covariance: np.ndarray | None = None,
    scale: float = 1.0,
) -> Record:
    """A record whose residuals are Gaussian noise, as large as asked, without solving anything."""
    rng = np.random.default_rng(seed)
    seen = see(views, seed, camera, board, noise_px=noise_px)
    noise = tuple(scale * noise_px * rng.normal(size=(len(view), 2)) for view in seen)
    joint = np.diag([0.1, 0.1, 0.1, 0.1, 1e-3, 2e-3, 1e-3, *[1e-4] * 6]) ** 2 if covariance is None else covariance
    calibration = Calibration(camera, FREE, joint, tuple(seen), tuple(views), np.full((len(views), 6), 1e-4), noise)
    known = Intrinsics(camera, free=FREE, covariance=calibration.covariance, rms_px=calibration.rms_px)
    return Record(calibration, known, board)


@pytest.fixture(scope="module")
def record() -> Record:
    """Twelve views of a checkerboard."""
    return made(ordinary_poses(12, 3))


def wide_folding() -> Camera:
    """A lens of one negative coefficient, which turns back inside the image: 1 - 3 * 0.25 r² = 0 at r = 1.1547."""
    return Camera((1280, 960), [[500, 0, 640], [0, 500, 480], [0, 0, 1]], [-0.25])


def portrait() -> Record:
    """Four views of an AprilGrid, partly out of an upright image."""
    camera = Camera((720, 1280), [[900, 0, 361.0], [0, 905, 642.0], [0, 0, 1]], [-0.1, 0.02, 0.001, -0.002])
    views = ordinary_poses(4, 9, camera, GRID, partial=True, fill=(0.8, 1.4), tilt_deg=(0.0, 45.0))
    assert any(len(view) < GRID.feature_count for view in see(views, 9, camera, GRID))
    return made(views, camera=camera, board=GRID)


def folding() -> Record:
    """Eight views through a lens that folds inside the image."""
    camera = wide_folding()
    return made(poses(8, 4, camera=camera, reach=(0.6, 0.45)), camera=camera)


def absurd() -> Record:
    """Residuals of 1e6 px, a focal length of 1e7, coefficients of 1e14, a covariance of 1e300, boards light seconds away."""
    sane = made(ordinary_poses(6, 2), scale=1e7, covariance=np.eye(len(FREE) + 6) * 1e300)
    camera = Camera((1280, 960), [[1e7, 0, -1e6], [0, 1e5, 1e6], [0, 0, 1]], [1e14, -1e14, 3.0, 1e9, 1e14])
    far = [Pose(pose.R, pose.t * [1.0, 1.0, 10.0 ** (3 * index - 3)]) for index, pose in enumerate(sane.calibration.poses)]
    calibration = replace(sane.calibration, camera=camera, poses=tuple(far))
    return replace(sane, calibration=calibration)


def perfect() -> Record:
    """Residuals that are all zero."""
    return made(ordinary_poses(5, 2), noise_px=0.0)


def few() -> Record:
    """Three views, no corner of which has a known standard deviation."""
    return made(ordinary_poses(3, 1))


CASES = {
    "few": cache(few),
    "portrait": cache(portrait),
    "folding": cache(folding),
    "absurd": cache(absurd),
    "perfect": cache(perfect),
}


def pixels(png: bytes) -> np.ndarray:
    """The image, RGBA."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))


def paths(axes) -> list[np.ndarray]:
    """Vertices (N, 5, 2) of every bundle of arrows in some axes."""
    return [patch.get_path().vertices.reshape(-1, 5, 2) for patch in axes.patches if isinstance(patch, PathPatch)]


def factor_of(title: str) -> float:
    """The magnification that a title states."""
    times = re.search(r"magnified ([\d,.]+)×", title)
    return float(times[1].replace(",", "")) if times else 1 / float(re.search(r"shrunk ([\d,]+)×", title)[1].replace(",", ""))


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("name", NAMES)
def test_every_figure_shows_something_in_every_style(record, name, style):
    """There is ink on more than a hundredth of the figure, and none in its outermost pixels, so nothing is cut off."""
    drawn = pixels(render(BY_NAME[name].draw(record, STYLES[style]), "png", 100))
    assert drawn.shape[1] == 720
    ground = drawn[0, 0]
    assert ground.tolist() == ([255] * 4 if style == "paper" else [255, 255, 255, 0])
    ink = (drawn != ground).any(axis=2)
    assert ink.mean() > 0.01
    assert not np.concatenate([ink[0], ink[-1], ink[:, 0], ink[:, -1]]).any()


@pytest.mark.parametrize("name", NAMES)
def test_axes_have_titles_and_units(record, name):
    """Axes are titled; labels name a unit, or what is counted, or what stands under each bar."""
    figure = BY_NAME[name].draw(record, LIGHT)
    titles = [axes.get_title() for axes in figure.axes] + [text.get_text() for text in figure.texts]
    assert any(titles)
    labels = {axes.get_xlabel() for axes in figure.axes} | {axes.get_ylabel() for axes in figure.axes}
    if name == "scene":
        labels |= {figure.axes[0].get_zlabel()}
    labels -= {"", "corners"}
    assert labels
    assert all(re.search(r"\((px|mm|m|°)\)$", label) for label in labels), labels


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", NAMES)
def test_every_case_can_be_drawn(case, name):
    """Few views, upright images, partial boards, folding lenses, absurd numbers and zeros all give a figure and a caption."""
    drawn = CASES[case]()
    kind = BY_NAME[name]
    figure = kind.draw(drawn, STYLES["page"])
    shown = pixels(render(figure, "png", 60))
    assert (shown != shown[0, 0]).any(axis=2).mean() > 0.005
    caption = kind.caption(drawn)
    assert caption.startswith("Good: ")
    assert "nan" not in caption
    assert "inf" not in caption.replace("infinity", "")


@pytest.mark.parametrize("case", CASES)
def test_a_view_of_every_case_can_be_drawn(case):
    """The quiver of a single view as well."""
    shown = pixels(render(view_quiver(CASES[case](), 1, STYLES["dark"]), "png", 60))
    assert (shown != shown[0, 0]).any(axis=2).mean() > 0.002


def test_unknown_uncertainty_is_said():
    """A covariance that overflows, and a lens without an inverse, are said to have nothing to show."""
    texts = [text.get_text() for axes in uncertainty.draw(absurd(), LIGHT).axes for text in axes.texts]
    assert sum(text.startswith("not available") for text in texts) == 2
    overflowing = made(ordinary_poses(4, 2), covariance=np.eye(len(FREE) + 6) * 1e307)
    texts = [text.get_text() for axes in uncertainty.draw(overflowing, LIGHT).axes for text in axes.texts]
    assert sum(text.startswith("not available") for text in texts) == 2
    assert any(text.get_text().startswith("not available") for text in distortion.draw(absurd(), LIGHT).axes[0].texts)
    assert any(text.get_text().startswith("not available") for text in histogram.draw(perfect(), LIGHT).axes[0].texts)


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


def test_arrows_are_residuals_times_the_stated_magnification(record):
    """Each arrow starts at its corner and is its residual, times the number in the title."""
    axes = residuals.draw(record, LIGHT).axes[0]
    (arrows,) = paths(axes)
    corners = np.concatenate([seen.corners_px for seen in record.calibration.detections])
    np.testing.assert_allclose(arrows[:, 0], corners)
    expected = factor_of(axes.get_title()) * np.concatenate(record.calibration.residuals_px)
    np.testing.assert_allclose(arrows[:, 1] - arrows[:, 0], expected, atol=1e-9)


def test_arrows_of_a_view_and_their_key(record):
    """The same for a single view; the key is as long as its label says; the corners left out are marked."""
    seen = record.calibration.detections[3]
    outlier = Outlier(seen.source, 7, (100.0, 50.0), 0.1, (9.0, 0.0), "too far off")
    marked = replace(record, calibration=replace(record.calibration, outliers=(outlier,)))
    axes = view_quiver(marked, 3, LIGHT).axes[0]
    (arrows,) = paths(axes)
    factor = factor_of(axes.get_title())
    np.testing.assert_allclose(arrows[:, 1] - arrows[:, 0], factor * record.calibration.residuals_px[3], atol=1e-9)
    crosses, key = axes.lines
    assert crosses.get_xydata().tolist() == [[100.0, 50.0]]
    assert np.ptp(key.get_xdata()) == pytest.approx(factor * float(axes.texts[0].get_text().removesuffix(" px")))
    assert seen.source in axes.get_title()


def test_quivers_are_residuals_on_one_scale(record):
    """The worst view comes first; its arrows are its residuals times one factor, the key's; names and RMS are told."""
    calibration = record.calibration
    axes = quivers.draw(record, LIGHT).axes[0]
    (arrows,) = paths(axes)
    order = sorted(range(12), key=lambda index: -calibration.view_rms_px[index])
    expected = np.concatenate([calibration.residuals_px[index] for index in order])
    (key,) = axes.lines
    *names, label = [text.get_text() for text in axes.texts]
    factor = np.ptp(key.get_xdata()) / float(label.removesuffix(" px"))
    np.testing.assert_allclose(arrows[:, 1] - arrows[:, 0], factor * expected, atol=1e-9)
    assert names[::2] == [calibration.detections[index].source for index in order]
    assert [float(name) for name in names[1::2]] == pytest.approx([calibration.view_rms_px[index] for index in order], rel=0.05)


def test_a_view_fills_its_cell_upright(record):
    """Corners keep their shape: the second view's tails are a scaled and shifted copy of its corners, inside its own cell."""
    calibration = record.calibration
    order = sorted(range(12), key=lambda index: -calibration.view_rms_px[index])
    tails = paths(quivers.draw(record, LIGHT).axes[0])[0][54:108, 0]
    corners = calibration.detections[order[1]].corners_px
    scale = np.ptp(tails, axis=0) / np.ptp(corners, axis=0)
    assert scale[0] == pytest.approx(scale[1])
    np.testing.assert_allclose(tails - tails[0], scale * (corners - corners[0]), atol=1e-9)
    assert ((tails > [1, 0]) & (tails < [2, 1])).all()


def test_quivers_of_many_views_are_of_the_worst():
    """Of more views than are shown the best are left out, and the title says so."""
    drawn = made(ordinary_poses(quivers.MOST_SHOWN + 2, 5))
    axes = quivers.draw(drawn, LIGHT).axes[0]
    assert len(paths(axes)[0]) == quivers.MOST_SHOWN * 54
    assert axes.get_title() == f"Residuals of the worst {quivers.MOST_SHOWN} of {quivers.MOST_SHOWN + 2} views"


def test_no_such_view(record):
    """A view that does not exist is an IndexError."""
    with pytest.raises(IndexError):
        view_quiver(record, 12, LIGHT)


def test_region_means_are_means(record):
    """Against a plain loop over regions of 160 px with five corners or more; noise of σ leaves σ / sqrt(n)."""
    places, means, sigmas = residuals.region_means(record.calibration)
    corners = np.concatenate([seen.corners_px for seen in record.calibration.detections])
    off = np.concatenate(record.calibration.residuals_px)
    expected = []
    for row in range(6):
        for column in range(8):
            inside = (np.floor((corners + 0.5) / 160) == [column, row]).all(axis=1)
            if inside.sum() >= 5:
                expected.append((*corners[inside].mean(axis=0), *off[inside].mean(axis=0), np.sqrt(inside.sum())))
    np.testing.assert_allclose(np.column_stack([places, means]), np.array(expected)[:, :4], rtol=1e-9)
    np.testing.assert_allclose(sigmas, record.calibration.rms_px / np.sqrt(2) / np.array(expected)[:, 4], rtol=1e-12)


def test_a_region_that_is_off_is_told(record):
    """Residuals of noise leave all means within their circles, ones shifted in a corner of the image do not."""
    assert "means are noise" in residuals.caption(record)
    shifted = tuple(
        np.where((seen.corners_px < [640, 480]).all(axis=1)[:, None], off + 0.2, off)
        for seen, off in zip(record.calibration.detections, record.calibration.residuals_px, strict=True)
    )
    assert "is more than noise" in residuals.caption(
        replace(record, calibration=replace(record.calibration, residuals_px=shifted))
    )


def test_running_percentiles():
    """Of 1000 values equal to their radius the groups' medians are the middles of their ranges."""
    rng = np.random.default_rng(1)
    values = rng.permutation(np.arange(1000.0))
    centres, low, middle, high = radius.running(values, values)
    np.testing.assert_allclose(middle, centres)
    assert len(centres) == 24
    np.testing.assert_allclose((low + high) / 2, middle, atol=1e-9)


def test_radial_residuals_by_hand():
    """A residual away from the principal point is positive, one across it is nothing."""
    seen = Detection("a", CAMERA.size, np.arange(2), CAMERA.K[:2, 2] + [[100, 0], [0, 50]], np.full(2, np.nan))
    pose = Pose(np.eye(3), np.array([0, 0, 1.0]))
    off = (np.array([[0.3, 0.4], [0.5, -0.2]]),)
    calibration = Calibration(CAMERA, FREE, np.eye(13), (seen,), (pose,), np.ones((1, 6)), off)
    away, outward = radius.radial_residuals(calibration)
    np.testing.assert_allclose(away, [100, 50])
    np.testing.assert_allclose(outward, [0.3, -0.2])


def test_histograms_count_every_corner(record):
    """Each component's counts add up to the corners, far ones included, and the Gaussian's area over the bins to erf(5/√2)."""
    off = np.concatenate(record.calibration.residuals_px).copy()
    off[0] = [40.0, -40.0]
    sigma = float(np.sqrt((off**2).mean()))
    edges, counts = histogram.histogram(off, sigma)
    assert counts.sum(axis=1).tolist() == [len(off), len(off)]
    np.testing.assert_allclose(edges[[0, -1]], [-5 * sigma, 5 * sigma])
    x = np.linspace(edges[0], edges[-1], 20_001)
    area = np.trapezoid(histogram.gaussian(x, sigma, edges, len(off)), x) / (edges[1] - edges[0])
    assert area == pytest.approx(len(off) * 0.9999994266968563, rel=1e-9)
    drawn = histogram.draw(record, LIGHT).axes[0]
    stairs = [patch.get_data().values.sum() for patch in drawn.patches]
    assert stairs == [record.calibration.corner_count] * 3


def test_bars_are_the_views_rms(record):
    """Heights are the views' RMS, sorted; gids name the views, links lead to them; the line is at the median."""
    axes = BY_NAME["view_rms"].draw(record, LIGHT).axes[0]
    rms = np.array([np.sqrt((off**2).sum(axis=1).mean()) for off in record.calibration.residuals_px])
    heights = np.array([bar.get_height() for bar in axes.patches])
    index = [int(bar.get_gid().removeprefix("bar-")) for bar in axes.patches]
    np.testing.assert_allclose(heights, np.sort(rms)[::-1])
    np.testing.assert_allclose(heights, rms[index])
    assert [bar.get_url() for bar in axes.patches] == [f"#view-{i}" for i in index]
    assert axes.lines[0].get_ydata()[0] == pytest.approx(np.median(rms))


def test_bars_are_coloured_by_the_median(record):
    """Twice the median is to be looked at, five times it is bad, and the caption names it."""
    off = [o * 0.1 / np.sqrt((o**2).sum(axis=1).mean()) for o in record.calibration.residuals_px]
    off[4], off[5] = off[4] * 2, off[5] * 5
    odd = replace(record, calibration=replace(record.calibration, residuals_px=tuple(off)))
    bars = {bar.get_gid(): to_hex(bar.get_facecolor()) for bar in BY_NAME["view_rms"].draw(odd, LIGHT).axes[0].patches}
    assert (bars["bar-4"], bars["bar-5"], bars["bar-0"]) == (LIGHT.notable, LIGHT.bad, LIGHT.plain)
    assert record.calibration.detections[5].source in BY_NAME["view_rms"].caption(odd)


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


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["uncertainty", "residuals", "view_rms", "scene"])
def test_files_are_the_same_each_time(record, name, kind):
    """Drawn twice, the bytes are equal."""
    first, second = (render(BY_NAME[name].draw(record, STYLES["paper"]), kind, 60) for _ in range(2))
    assert first == second
    assert first.startswith({"svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}[kind])


def test_unknown_kind_of_file(record):
    """There is no such file."""
    with pytest.raises(ValueError, match=r"kind: unknown \(got 'gif'"):
        render(BY_NAME["view_rms"].draw(record, LIGHT), "gif")


@pytest.mark.parametrize("name", NAMES)
def test_svg_stands_in_a_page(record, name):
    """Well-formed, sized by its viewBox; ids start with the prefix and every reference finds its id; no rule reaches out."""
    text = render_svg(BY_NAME[name].draw(record, STYLES["page"]), "fig7")
    assert text == render_svg(BY_NAME[name].draw(record, STYLES["page"]), "fig7")
    root = ET.fromstring(text)
    assert root.tag == f"{SVG}svg"
    assert "width" not in root.attrib
    assert root.attrib["viewBox"].startswith("0 0 518.4 ")
    assert "<style" not in text
    assert "http://www.w3.org/2000/svg" in text
    ids = re.findall(r'\bid="([^"]*)"', text)
    assert len(ids) == len(set(ids))
    assert all(found.startswith("fig7-") for found in ids)
    references = set(re.findall(r'(?:href="|url\()#([^")]*)', text))
    assert {found for found in references if not found.startswith("view-")} <= set(ids)
    left = set(re.findall(r"#[0-9a-f]{6}", re.sub(r"var\([^)]*\)", "", text)))
    assert not left & set(STYLES["page"].colours.values())


def test_svg_keeps_its_text(record):
    """Titles are text that can be searched, with their digits, and bars can be found by their view."""
    text = render_svg(BY_NAME["view_rms"].draw(record, STYLES["page"]), "bars")
    assert ">RMS of 12 views, worst first<" in text
    assert all(f'id="bars-bar-{i}"' in text and f'href="#view-{i}"' in text for i in range(12))
    assert "var(--figure-plain," in text
    assert "DejaVu Sans', 'Bitstream" not in text


def test_styles_declare_what_pages_refer_to(record):
    """Every variable that an SVG refers to is declared by the light and by the dark style."""
    text = "".join(render_svg(kind.draw(record, STYLES["page"]), kind.name) for kind in FIGURES)
    for style in ("light", "dark"):
        declared = set(re.findall(r"--figure-\w+", STYLES[style].css())) | {"--figure-font"}
        assert set(re.findall(r"--figure-\w+", text)) <= declared


@pytest.mark.parametrize("style", ["light", "dark"])
def test_colours_can_be_read(style):
    """Text keeps a contrast of 4.5 to its ground, and data one of 3 (WCAG 2.1)."""

    def luminance(colour: str) -> float:
        parts = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
        linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    colours = STYLES[style].colours
    ground = luminance(colours["paper"])

    def contrast(name: str) -> float:
        lighter, darker = sorted([luminance(colours[name]), ground], reverse=True)
        return (lighter + 0.05) / (darker + 0.05)

    assert min(contrast("ink"), contrast("muted"), contrast("strong")) >= 4.5
    assert min(contrast("plain"), contrast("bad")) >= 3.0


def test_colours_of_the_page_are_told_apart():
    """No colour of the style that is replaced by variables occurs twice, or it would become the wrong variable."""
    colours = list(STYLES["page"].colours.values())
    assert len(set(colours)) == len(colours)


def test_fifty_views_fit_in_a_page():
    """All figures of 50 views of 54 corners, and all quivers, take less than 2 of the page's 5 MB."""
    drawn = made(ordinary_poses(50, 8))
    whole = sum(len(render_svg(kind.draw(drawn, STYLES["page"]), kind.name)) for kind in FIGURES)
    assert whole + 50 * len(render_svg(view_quiver(drawn, 0, STYLES["page"]), "v")) < 2e6


def test_five_hundred_views_of_four_hundred_corners():
    """Each figure takes less than a second of processor time and 300 kB."""
    board = Checkerboard(20, 20, 0.01)
    centre = board.object_points.mean(axis=0)
    rng = np.random.default_rng(0)
    views = []
    for _ in range(500):
        turn = Pose.from_rvec(rng.uniform(-0.5, 0.5, 3), [0, 0, 0])
        views.append(Pose(turn.R, rng.uniform([-0.1, -0.1, 0.3], [0.1, 0.1, 0.6]) - turn.R @ centre))
    drawn = made(views, board=board)
    for kind in FIGURES:
        start = time.thread_time()
        text = render_svg(kind.draw(drawn, STYLES["page"]), kind.name)
        assert time.thread_time() - start < 1, kind.name
        assert len(text) < 300_000, kind.name


def test_threads_do_not_disturb_one_another(record):
    """Figures drawn by four threads at once equal those drawn one after the other."""
    kinds = [BY_NAME[name] for name in ("view_rms", "distortion", "stance", "residual_histogram")]
    alone = [render_svg(kind.draw(record, STYLES["page"]), "a") for kind in kinds]
    together: dict[int, str] = {}

    def work(index: int) -> None:
        together[index] = render_svg(kinds[index].draw(record, STYLES["page"]), "a")

    threads = [threading.Thread(target=work, args=(index,)) for index in range(len(kinds))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [together[index] for index in range(len(kinds))] == alone


def test_settings_of_the_user_neither_count_nor_change(record):
    """A user's own settings of matplotlib are left as they are and change no figure."""
    import matplotlib as mpl

    plain = render(BY_NAME["view_rms"].draw(record, LIGHT), "svg")
    with mpl.rc_context({"font.size": 30, "lines.linewidth": 9, "axes.facecolor": "red", "svg.fonttype": "none"}):
        before = dict(mpl.rcParams)
        assert render(BY_NAME["view_rms"].draw(record, LIGHT), "svg") == plain
        assert dict(mpl.rcParams) == before


def test_round_numbers():
    """By hand."""
    assert [round_below(value) for value in (1.0, 1.99, 2.0, 4.9, 0.07, 730.0)] == pytest.approx([1, 1, 2, 2, 0.05, 500])
    assert (magnified(1500.0), magnified(1.5), magnified(0.02)) == ("magnified 1,500×", "magnified 1.5×", "shrunk 50×")
    assert magnification(np.zeros((4, 2)), 50.0) == 1.0
    assert magnification(np.full((9, 2), 0.1) / np.sqrt(2), 50.0) == pytest.approx(500)


def test_names_and_titles_are_told_apart():
    """They become files, ids and headings."""
    assert len(set(NAMES)) == len(FIGURES) == len({kind.title for kind in FIGURES})
    assert all(re.fullmatch(r"[a-z_]+", name) for name in NAMES)
