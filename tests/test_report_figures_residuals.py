"""Figures of residuals: arrows, regions, percentiles, histograms and bars are those of the calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from capture_scenes import CAMERA, ordinary_poses
from figure_records import BY_NAME, FREE, LIGHT, factor_of, made, paths
from matplotlib.colors import to_hex

from camcal.geometry.pose import Pose
from camcal.observations import Calibration, Detection, Outlier
from camcal.report.figures import histogram, quivers, radius, residuals
from camcal.report.figures.catalogue import view_quiver


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
