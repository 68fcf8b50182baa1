"""CPU of both refinement stages per view at 1280x960: 54 corners, and 24x18 corners.

python benchmarks/refine.py
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.geometry.camera import Camera
from camcal.refinement.saddle import refine_saddle
from camcal.refinement.warped import refine_warped
from camcal.synthesis.poses import sample_pose
from camcal.synthesis.render import render_view
from camcal.synthesis.scenario import PoseSampling, Scenario
from camcal.threads import single_threaded

CAMERA = Camera((1280, 960), [[900, 0, 645.3], [0, 902, 470.2], [0, 0, 1]], [-0.2, 0.05])
BOARDS = {
    "9x6, 54 corners": Checkerboard(9, 6, 0.025),
    "12x9, 108 corners": Checkerboard(12, 9, 0.02),
    "24x18, 432 corners": Checkerboard(24, 18, 0.01),
}
RUNS = 7


def measure(board: Board) -> tuple[float, float]:
    """Median CPU milliseconds of the saddle fit and of the warped fit for one view, from starts up to 0.5 px off."""
    scenario = Scenario("refine", 1, CAMERA, board, views=PoseSampling(count=20, fill=(0.6, 0.7)))
    pose, image = sample_pose(scenario, 4), render_view(scenario, 4).image
    true = CAMERA.project(pose.apply(board.object_points))
    start = true + np.random.default_rng(1).uniform(-0.5, 0.5, true.shape)
    ids = np.arange(board.feature_count)
    saddle, warped = [], []
    for _ in range(RUNS + 1):
        began = time.process_time()
        fit = refine_saddle(image, ids, start, board)
        between = time.process_time()
        refine_warped(image, ids, fit.corners_px, board, camera=CAMERA, T_cam_board=pose)
        saddle.append(between - began)
        warped.append(time.process_time() - between)
    return 1e3 * statistics.median(saddle[1:]), 1e3 * statistics.median(warped[1:])


def main() -> None:
    """Print the table."""
    print(f"{'CPU ms per view':20}{'saddle':>10}{'warped':>10}{'both':>10}   (medians of {RUNS})")
    with single_threaded():
        for name, board in BOARDS.items():
            saddle, warped = measure(board)
            print(f"{name:20}{saddle:10.1f}{warped:10.1f}{saddle + warped:10.1f}")


if __name__ == "__main__":
    main()
