"""The error budget on rendered truth, in three steps: corners found, camera from perfect corners, camera from pixels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from camcal.calibration.solve import solve
from camcal.compare.projection import projection_difference
from camcal.detection.detect import detect_board
from camcal.formats.scenario_file import load_scenario
from camcal.observations import Detection
from camcal.resources import config_names, config_path
from camcal.synthesis.poses import sample_poses
from camcal.synthesis.render import render_view, true_detection

SEEDS = (101, 102, 103)


def scenario_of(config: str, seed: int):
    """Return a shipped scenario with another seed."""
    return replace(load_scenario(config_path(config)), seed=seed)


@pytest.fixture(scope="module")
def seen():
    """Render and detect a scenario once per seed: pairs of truth and what was found."""
    cache: dict[tuple[str, int], list] = {}

    def views(config: str, seed: int) -> list:
        if (config, seed) not in cache:
            scenario = scenario_of(config, seed)
            pairs = []
            for index in range(scenario.views.count):
                view = render_view(scenario, index)
                pairs.append((view.detection, detect_board(view.image, scenario.board, view.detection.source)))
            cache[config, seed] = pairs
        return cache[config, seed]

    return views


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
def test_every_rendered_board_is_found(config, seed, seen):
    """Step 1: no view is lost, no id is wrong, no corner is a gross error."""
    for truth, found in seen(config, seed):
        assert isinstance(found, Detection), (truth.source, found)
        common, in_truth, in_found = np.intersect1d(truth.ids, found.ids, return_indices=True)
        assert common.size == len(found)
        error = found.corners_px[in_found] - truth.corners_px[in_truth]
        assert np.abs(error).max() < 2


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("config", config_names())
def test_camera_from_pixels_is_within_four_sigma(config, seed, seen):
    """Step 3: every recovered parameter lies within 4 of its standard deviations of the truth."""
    scenario = scenario_of(config, seed)
    solved = solve([found for _, found in seen(config, seed)], scenario.board.object_points)
    columns = [scenario.camera.intrinsic_names.index(name) for name in solved.free]
    error = (solved.camera.intrinsics - scenario.camera.intrinsics)[columns]
    assert np.abs(error / np.sqrt(np.diag(solved.covariance))).max() < 4, dict(zip(solved.free, error, strict=True))
    assert projection_difference(scenario.camera, solved.camera).mean_px < 1
