"""Lens models on held-out views: against views really held out, and made lenses of every kind."""

from __future__ import annotations

import numpy as np
import pytest
from capture_scenes import BOARD, CAMERA, VERY_WIDE, careful_views, placed_poses, see

from camcal.calibration.finish import descend
from camcal.calibration.normal_equations import Observations, State, view_costs
from camcal.calibration.solve import solve
from camcal.compare.projection import predicted_difference_px, projection_difference
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.trust.fisheye import check_fisheye
from camcal.trust.held_out import POLYNOMIALS, RATIONALS, Candidate, Judge
from camcal.trust.linearised import Linearised
from camcal.trust.minimum import Minimum
from camcal.trust.models import ModelCheck, choose_distortion, compare_models
from camcal.workflows.calibrate import calibrate

USUAL = ("k1", "k2", "k3")
RATIONAL = Camera((1280, 960), [[560, 0, 645.3], [0, 561, 470.2], [0, 0, 1]], [0.9, 0.12, 0, 0, 0.002, 1.25, 0.32, 0.012])


def lens(*dist: float) -> Camera:
    """The usual camera behind another lens."""
    return Camera(CAMERA.size, CAMERA.K, dist)


def check(views, distortion=USUAL, **options) -> ModelCheck | None:
    """Solve views and compare lens models."""
    minimum = Minimum.of(solve(views, BOARD.object_points, distortion=distortion, **options), BOARD)
    return compare_models(minimum, Linearised.of(minimum))


def really_held_out(views, distortion) -> np.ndarray:
    """Sum of squares of each view, posed anew under the camera that the others give."""
    squares = []
    for index, view in enumerate(views):
        others = solve([*views[:index], *views[index + 1 :]], BOARD.object_points, distortion=distortion)
        poses = solve(views, BOARD.object_points, distortion=distortion).poses
        seen = Observations.gather([view], BOARD.object_points)
        posed = descend(State.of(others.camera, [poses[index]]), seen, np.zeros(0, dtype=np.int64))
        assert not posed.failure
        squares.append(view_costs(posed.state, seen).sum())
    return np.array(squares)


@pytest.mark.parametrize("distortion", [("k1", "k2"), USUAL])
def test_held_out_squares_are_those_of_views_held_out(distortion):
    """Without solving anything again: what the others' cameras leave of each view, also if k3 is put to 0.

    First order: residuals of 0.05 px follow a step that is as small; of what they leave, some thousandths are neglected.
    """
    views = careful_views(2, 8, camera=lens(-0.21, 0.07))
    expected = really_held_out(views, distortion)
    minimum = Minimum.of(solve(views, BOARD.object_points), BOARD)
    here = Linearised.of(minimum)
    free = np.array([name in ("fx", "fy", "cx", "cy", *distortion) for name in here.names])
    found = here.held_out(free) * here.variance_px2
    assert found == pytest.approx(expected, rel=5e-3)
    # What is held out fits worse than what was solved for.
    assert (found > here.costs * here.variance_px2).mean() > 0.8


@pytest.mark.parametrize(
    ("dist", "distortion"),
    [
        ((), ()),
        ((-0.2,), ("k1",)),
        ((-0.25, 0.08), ("k1", "k2")),
        ((-0.25, 0.08, 0, 0, -0.03), USUAL),
        ((-0.25, 0.08, 0.001, -0.0008), ("k1", "k2", "p1", "p2")),
        ((-0.25, 0.08, 0.001, -0.0008, -0.03), ("k1", "k2", "p1", "p2", "k3")),
    ],
)
def test_the_true_model_is_chosen(dist, distortion):
    """Corners of a lens whose coefficients are known, in two captures each."""
    for seed in (1, 2):
        calibration = solve(careful_views(seed, camera=lens(*dist)), BOARD.object_points)
        assert choose_distortion(calibration, BOARD) == distortion


def test_a_rational_lens_is_chosen_where_no_polynomial_does():
    """A lens of 150 degrees: k1..k3 leave 0.7 px of corners that are exact to 0.05 px."""
    views = see(placed_poses(16, 3, RATIONAL, distance_m=(0.1, 0.3)), 3, RATIONAL)
    found = check(views)
    assert found.best.distortion == RATIONALS[0]
    (finding,) = [finding for finding in found.findings if finding.code == "lens_too_simple"]
    assert "k4,k5,k6" in finding.text
    assert "--distortion k1,k2,k3,k4,k5,k6" in finding.advice


@pytest.mark.parametrize("distortion", [(), ("k1",), ("k1", "k2")])
def test_a_wide_lens_needs_more(distortion):
    """From any smaller model the one of the lens is found, and the projection is as far off as it truly is."""
    views = careful_views(1, 16, camera=VERY_WIDE)
    found = check(views, distortion)
    assert found.best.distortion == USUAL
    (finding,) = found.findings
    assert (finding.code, finding.level) == ("lens_too_simple", "poor")
    assert finding.advice == "Pass --distortion k1,k2,k3."
    fitted = solve(views, BOARD.object_points, distortion=distortion).camera
    truth = np.median(projection_difference(VERY_WIDE, fitted).length_px)
    assert found.difference_px == pytest.approx(truth, rel=0.02)


@pytest.mark.parametrize("count", [4, 12])
def test_the_true_model_raises_no_finding(count):
    """k1..k3 of a lens that has them, in views that reach the corners, and k1, k2 of one that has those."""
    assert check(careful_views(5, count, camera=lens(-0.25, 0.08, 0, 0, -0.03))).findings == ()
    assert check(careful_views(5, count, camera=lens(-0.25, 0.08)), ("k1", "k2")).findings == ()


def test_an_unsupported_coefficient_is_named():
    """Boards that keep away from the image's edge: k3 is a guess there, and the corners are known far less well with it.

    How much less is the ratio of the standard deviations that each model's own solve predicts for the projection there.
    """
    views = see(placed_poses(12, 7, x=(0.3, 0.7), y=(0.3, 0.7), distance_m=(0.4, 0.7)), 7)
    found = check(views)
    (finding,) = found.findings
    assert (finding.code, finding.level) == ("unsupported_coefficient", "usable")
    assert finding.text.startswith("k3 is not supported")
    assert found.simpler.distortion == ("k1", "k2")
    sigmas = []
    for distortion in (USUAL, ("k1", "k2")):
        solved = solve(views, BOARD.object_points, distortion=distortion)
        estimate = Intrinsics(solved.camera, free=solved.free, covariance=solved.covariance)
        # The corners of the grid are those of the image, and its largest values.
        sigmas.append(np.nanmax(predicted_difference_px(estimate)))
    assert found.corner_sigma_px == pytest.approx(sigmas[0], rel=0.05)
    assert found.simpler_corner_sigma_px == pytest.approx(sigmas[1], rel=0.05)


@pytest.mark.parametrize(
    ("with_px", "without_px", "level", "words"),
    [
        (20.0, 4.0, "usable", "knows the image's corners 5 times as well"),
        (900.0, 1.0, "usable", "over 100 times as well"),
        (0.9, 0.1, "note", "9 times as well"),
        (20.0, 16.0, "note", "1.2 times as well"),
        (20.0, 19.0, None, ""),
        (np.nan, 2.0, "usable", "has an answer at the image's corners"),
        (20.0, np.nan, "usable", "0.1 px with k1,k2,k3)"),
    ],
)
def test_level_of_an_unsupported_coefficient(with_px, without_px, level, words):
    """By how much less well the image's corners are known with it, and whether that matters."""
    usual, simpler = Candidate(USUAL, 0.1, 2.0), Candidate(("k1", "k2"), 0.1, 1.0)
    findings = ModelCheck(usual, simpler, simpler, with_px, without_px, float("nan")).findings
    assert [finding.level for finding in findings] == ([level] if level else [])
    assert all(words in finding.text and finding.advice.startswith("Pass --distortion k1,k2,") for finding in findings)


@pytest.mark.parametrize(
    ("held_out_px", "advice", "count"),
    [
        (0.05, "Pass --distortion k1,k2,p1,p2 (the lens needs p1,p2 as well), or add views", 2),
        (0.0999, "Pass --distortion k1,k2, or add views", 1),
    ],
)
def test_advice_where_a_coefficient_is_too_many_and_others_are_missing(held_out_px, advice, count):
    """Both findings advise the same model; without enough gain for the second the first is about the first alone."""
    usual, simpler = Candidate(USUAL, 0.1, 2.0), Candidate(("k1", "k2"), 0.1, 1.0)
    best = Candidate(("k1", "k2", "p1", "p2"), held_out_px, 0.5)
    findings = ModelCheck(usual, best, simpler, 20.0, 4.0, 0.3).findings
    assert len(findings) == count
    assert findings[0].advice.startswith(advice)
    assert all("Pass --distortion k1,k2,p1,p2" in finding.advice for finding in findings[1:])


def test_all_coefficients_of_the_rational_model_are_too_many():
    """k4..k6 of a lens without them are named, and the model of the lens is advised."""
    found = check(careful_views(4, 16), RATIONALS[0])
    assert found.simpler.distortion in {("k1", "k2"), USUAL}
    (finding,) = found.findings
    assert finding.code == "unsupported_coefficient"
    assert "k4,k5,k6 are not supported" in finding.text
    assert found.best.option in finding.advice


def test_a_board_that_is_shaped_is_compared_too():
    """The board's bow stays free in every model."""
    found = check(careful_views(3), shape=("bow_x", "bow_y"))
    assert found.best.distortion in {("k1", "k2"), USUAL}
    assert found.findings == ()


def test_three_views_are_too_few():
    """Without one of three views nothing is determined: k1 alone is chosen."""
    views = careful_views(1, 3)
    assert check(views) is None
    assert choose_distortion(solve(views, BOARD.object_points), BOARD) == ("k1",)


def test_perfect_corners_choose_the_lens():
    """Corners without any noise, of k1 and k2: nothing else is needed, and nothing divides by zero."""
    found = check(careful_views(1, camera=lens(-0.2, 0.05), noise_px=0))
    assert found.best.distortion == ("k1", "k2")


def test_small_gains_do_not_count():
    """Of a model that gains a hundredth of the residual or less the simpler one is the best, of one that gains more it is."""
    minimum = Minimum.of(solve(careful_views(1), BOARD.object_points), BOARD)
    judge = Judge.of(minimum)
    tried = [judge.foreseen(model) for model in POLYNOMIALS]
    least = min(tried, key=lambda each: each.score)
    simpler = [each for each in tried if len(each.distortion) < len(judge.best().distortion)]
    assert judge.best().held_out_px <= 1.01 * least.held_out_px
    assert all(each.held_out_px > 1.01 * least.held_out_px for each in simpler)


def compared(current: str, best: str, held_out_px: float, difference_px: float) -> ModelCheck:
    """Two models, of which the best one leaves 1 px."""
    one, other = (Candidate(tuple(names.split(",")), px, 0.0) for names, px in ((current, held_out_px), (best, 1.0)))
    return ModelCheck(one, other, None, 1.0, float("nan"), difference_px)


@pytest.mark.parametrize(
    ("held_out_px", "difference_px", "level"),
    [(1.005, 9, None), (1.05, 9, "note"), (1.2, 0.1, "usable"), (1.6, 0.9, "usable"), (1.6, 1.1, "poor")],
)
def test_level_of_a_lens_that_is_too_simple(held_out_px, difference_px, level):
    """By the share of the residual that the better model takes away, and by the pixels that it moves the projection."""
    findings = compared("k1", "k1,k2", held_out_px, difference_px).findings
    assert [finding.level for finding in findings] == ([level] if level else [])


def test_a_best_model_with_fewer_coefficients_is_no_lack():
    """What the current model has already is not missing."""
    assert compared("k1,k2,k3", "k1,k2", 2.0, 9.0).findings == ()


def test_photographs_that_do_not_determine_k3(photos):
    """swat_calib: a phone's long lens and small boards; k3 is as good as free."""
    run = calibrate([str(photos / "swat_calib" / "IMG*.JPG")], "checkerboard:7x5:30mm")
    minimum = Minimum.of(run.calibration, run.board)
    (finding,) = compare_models(minimum, Linearised.of(minimum)).findings
    assert (finding.code, finding.level) == ("unsupported_coefficient", "usable")
    assert "k3" in finding.text
    assert check_fisheye(minimum) is None
