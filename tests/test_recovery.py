"""The error budget on rendered truth, in three steps: corners found, camera from perfect corners, camera from pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from camcal.calibration.solve import solve
from camcal.detection.detect import detect_board
from camcal.formats.scenario_file import load_scenario
from camcal.observations import Calibration, Detection
from camcal.refinement.saddle import refine_saddle
from camcal.refinement.warped import refine_warped
from camcal.resources import config_names, config_path
from camcal.synthesis.poses import sample_poses
from camcal.synthesis.render import render_view, true_detection
from camcal.synthesis.scenario import Scenario

SEEDS = (101, 102)


def scenario_of(config: str, seed: int) -> Scenario:
    """Return a shipped scenario with another seed."""
    return replace(load_scenario(config_path(config)), seed=seed)


@dataclass(frozen=True)
class Recovered:
    """A scenario, its true corners, and what came of its pixels."""

    scenario: Scenario
    truth: list[Detection]
    found: list
    calibration: Calibration


@pytest.fixture(scope="module")
def recovered():
    """Render, detect, refine and solve a scenario once per seed, as `calibrate` does it."""
    cache: dict[tuple[str, int], Recovered] = {}

    def run(config: str, seed: int) -> Recovered:
        if (config, seed) not in cache:
            scenario = scenario_of(config, seed)
            board, points = scenario.board, scenario.board.object_points
            views = [render_view(scenario, index) for index in range(scenario.views.count)]
            images = {view.detection.source: view.image for view in views}
            found = [detect_board(view.image, board, view.detection.source) for view in views]
            saddles = [
                refine_saddle(images[d.source], d.ids, d.corners_px, board).applied(d)
                for d in found
                if isinstance(d, Detection)
            ]
            first = solve(saddles, points)
            warped = [
                refine_warped(images[d.source], d.ids, d.corners_px, board, camera=first.camera, T_cam_board=pose).applied(d)
                for d, pose in zip(first.detections, first.poses, strict=True)
            ]
            cache[config, seed] = Recovered(scenario, [view.detection for view in views], found, solve(warped, points))
        return cache[config, seed]

    return run


@pytest.mark.parametrize("config", config_names())
def test_perfect_corners_give_the_true_camera(config):
    """Step 2: from exact corners f and c within 1e-6 px, k1 and k2 within 1e-9, k3 within 1e-8."""
    scenario = scenario_of(config, 7)
    poses = sample_poses(scenario)
    views = [true_detection(scenario.camera, scenario.board, pose, f"{i:03d}") for i, pose in enumerate(poses)]
    solved = solve(views, scenario.board.object_points)
    error = np.abs(solved.camera.intrinsics - scenario.camera.intrinsics)
    assert error[:4].max() < 1e-6
    assert error[5:7].max() < 1e-9
    assert error[9] < 1e-8


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("config", config_names())
def test_every_rendered_board_is_found_and_used(config, seed, recovered):
    """Step 1: no view is lost on the way from pixels to camera."""
    run = recovered(config, seed)
    assert [found for found in run.found if not isinstance(found, Detection)] == []
    assert len(run.calibration.detections) == run.scenario.views.count


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("config", config_names())
def test_corner_errors_are_what_their_sigmas_say(config, seed, recovered):
    """Step 1: errors over their own predicted standard deviations have an RMS of 1, and none is a gross error.

    With a thousand corners the RMS of normal errors is 1 within 4 x 0.016; the rest of the 10 % is what each sigma, estimated
    from one patch, may be off. Beyond 6 sigma there should be one corner in 500 million.
    """
    run = recovered(config, seed)
    truth = {view.source: view for view in run.truth}
    scaled = []
    for seen in run.calibration.detections:
        # No shipped board looks the same after a turn, so ids are compared as they are.
        _, in_truth, in_seen = np.intersect1d(truth[seen.source].ids, seen.ids, return_indices=True)
        assert in_seen.size == len(seen)
        errors = seen.corners_px[in_seen] - truth[seen.source].corners_px[in_truth]
        scaled.append(errors / seen.sigma_px[in_seen][:, None])
    every = np.concatenate(scaled)
    assert np.sqrt((every**2).mean()) == pytest.approx(1, abs=0.1)
    assert np.abs(every).max() < 6


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("config", config_names())
def test_camera_from_pixels_is_within_four_sigma(config, seed, recovered):
    """Step 3: every recovered parameter lies within 4 of its standard deviations of the truth."""
    run = recovered(config, seed)
    solved, truth = run.calibration, run.scenario.camera
    columns = [truth.intrinsic_names.index(name) for name in solved.free]
    error = (solved.camera.intrinsics - truth.intrinsics)[columns]
    assert np.abs(error / np.sqrt(np.diag(solved.covariance))).max() < 4, dict(zip(solved.free, error, strict=True))
