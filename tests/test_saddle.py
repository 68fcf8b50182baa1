"""Refinement without a camera: at its bound, honest about it, and never wrong about what is no corner."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from corner_scenes import BARREL, nearby, rms, scene
from scenes import BOARD

from camcal.boards.aprilgrid import AprilGrid
from camcal.observations import Detection
from camcal.refinement.saddle import refine_saddle
from camcal.synthesis.scenario import Light, Sensor


def refined(view, start_px=0.7, image=None):
    """Refine a view of the checkerboard from starts a given distance off."""
    return refine_saddle(view.image if image is None else image, view.ids, nearby(view.corners_px, start_px), BOARD)


def test_noise_leaves_what_the_bound_allows():
    """Within 1.6 x the bound of radius 12 px, and the predicted standard deviations are those that are seen.

    648 errors make a root mean square good to 2.8 %; four of that on each side.
    """
    ratios, pulls = [], []
    for index in range(6):
        view = scene(index)
        result = refined(view)
        assert result.ok.all()
        error = result.corners_px - view.corners_px
        ratios.append(error / view.bound(12.0))
        pulls.append(error / result.sigma_px)
    assert rms(np.concatenate(ratios)) < 1.6
    assert rms(np.concatenate(pulls)) == pytest.approx(1, abs=0.12)


@pytest.mark.parametrize("camera_blur", [0.5, 0.7, 1.5])
def test_without_noise_a_thousandth_of_a_pixel_is_left(camera_blur):
    """Strong barrel distortion, 16 bits."""
    view = scene(1, camera=BARREL, sensor=Sensor(blur_sigma_px=camera_blur, read_noise_levels=0, bits=16))
    assert np.abs(refined(view).corners_px - view.corners_px).max() < 1e-3


@pytest.mark.parametrize("off_px", [1.5, 3.0])
def test_distant_starts_converge_or_are_refused(off_px):
    """From 1.5 px all arrive; from 3 px nothing wrong is let through (errors beyond 6 sigma)."""
    for fill in ((0.15, 0.16), (0.5, 0.6)):
        view = scene(2, fill=fill)
        result = refined(view, off_px)
        error = np.abs(result.corners_px - view.corners_px)
        assert (error[result.ok] < 6 * result.sigma_px[result.ok]).all()
        assert result.ok.all() or off_px > 2


@pytest.mark.parametrize("seed", range(4))
def test_starts_on_other_corners_are_refused(seed):
    """Of the three starts put on other corners none survives, and no accepted corner is wrong."""
    view, rng = scene(3), np.random.default_rng(seed)
    start = nearby(view.corners_px, 0.3)
    moved = rng.choice(54, 3, replace=False)
    start[moved] = view.corners_px[(moved + rng.choice([1, 2, 9, 10, 18], 3)) % 54]
    result = refine_saddle(view.image, view.ids, start, BOARD)
    assert not result.ok[moved].any()
    assert np.nanmax(np.abs(result.corners_px - view.corners_px) / result.sigma_px) < 6
    assert result.ok.sum() > 40


def test_small_squares():
    """A board whose squares are 12 px wide is refined as well, below the error of cv2.cornerSubPix (0.02 px)."""
    view = scene(0, fill=(0.105, 0.11))
    assert 10 < view.spacing_px.min() < 13
    result = refined(view)
    assert result.ok.all()
    assert rms(result.corners_px - view.corners_px) < 0.02


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (np.full((960, 1280), 255, np.uint8), "no contrast"),
        (np.zeros((960, 1280), np.uint8), "no contrast"),
        (np.random.default_rng(0).integers(0, 256, (960, 1280)).astype(np.uint8), "no contrast"),
        (np.full((960, 1280), np.nan, np.float32), "no contrast"),
    ],
    ids=["white", "black", "noise", "nan"],
)
def test_nothing_to_see_is_refused(image, reason):
    """Flat, random and undefined images give no corner, NaN throughout, and say so."""
    result = refined(scene(0), image=image)
    assert not result.ok.any()
    assert np.isnan(result.corners_px).all()
    assert np.isnan(result.sigma_px).all()
    assert Counter(text[: len(reason)] for text in result.reasons)[reason] > 50


def test_unusable_starts_are_named():
    """NaN, infinity, outside the image and the opposite colours, each with its reason; the others are not harmed."""
    view = scene(0)
    start = view.corners_px.copy()
    start[0], start[20], start[53] = np.nan, np.inf, (-4, 3)
    result = refine_saddle(view.image, view.ids, start, BOARD)
    assert result.reasons[0] == result.reasons[20] == "its position is not a number"
    assert "border" in result.reasons[53]
    # A corner of the board that loses both its neighbours along an edge cannot be oriented; no other is lost.
    assert result.ok.sum() >= 48
    turned = refine_saddle(255 - view.image, view.ids, view.corners_px, BOARD)
    assert set(turned.reasons) == {"its colours are those of the corner next to it"}


def test_saturated_views():
    """Overexposed paper keeps its corners within 6 sigma; where ink is nearly as bright, no corner is far off."""
    for white, black in ((1.6, 0.15), (3.0, 0.9)):
        view = scene(0, light=Light(white=white, black=black))
        result = refined(view)
        error = np.abs(result.corners_px - view.corners_px)
        assert (error[result.ok] < 6 * result.sigma_px[result.ok]).all()


def test_depths_agree():
    """The same levels as 8 bits, 16 bits and floats give the same corners; so does a second run, bit for bit."""
    view = scene(0)
    first = refined(view).corners_px
    assert np.array_equal(refined(view).corners_px, first)
    assert np.abs(refined(view, image=view.image.astype(np.float32)).corners_px - first).max() < 1e-5
    assert np.abs(refined(view, image=view.image.astype(np.uint16) * 257).corners_px - first).max() < 1e-3


def test_threads_do_not_disturb_each_other():
    """Four threads at once give what one gives."""
    views = [scene(index) for index in range(4)]
    alone = [refined(view).corners_px for view in views]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda view: refined(view).corners_px, views))
    assert all(np.array_equal(a, b) for a, b in zip(alone, together, strict=True))


def test_empty_and_single():
    """No corners give no corners; a single one has no neighbour to tell its direction."""
    view = scene(0)
    assert refine_saddle(view.image, np.zeros(0, int), np.zeros((0, 2)), BOARD).corners_px.shape == (0, 2)
    alone = refine_saddle(view.image, view.ids[:1], view.corners_px[:1], BOARD)
    assert alone.reasons == ("no corner next to it along an edge",)


def test_aprilgrid_corners_are_saddles_too():
    """With black squares, at 1.6 x the bound of radius 12 px."""
    board = AprilGrid(4, 3, 0.06, 0.018)
    view = scene(0, board=board, fill=(0.6, 0.8))
    result = refine_saddle(view.image, view.ids, nearby(view.corners_px, 0.7), board)
    assert result.ok.all()
    assert rms((result.corners_px - view.corners_px) / view.bound(12.0)) < 1.7


def test_a_detection_takes_the_good_corners():
    """Refused corners are left out, sigma is per axis."""
    view = scene(0)
    start = view.corners_px.copy()
    start[7] = np.nan
    result = refine_saddle(view.image, view.ids, start, BOARD)
    seen = np.where(np.isnan(start), 1.0, start)
    detection = result.applied(Detection("a.png", view.camera.size, view.ids, seen, np.full(54, np.nan)))
    assert 7 not in detection.ids.tolist()
    assert len(detection) == result.ok.sum()
    assert (detection.sigma_px > 0).all()
