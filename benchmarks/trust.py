"""What it costs to judge a calibration, beside solving it: made corners of 9x6 and 24x18 boards, 20 to 500 views.

Printed are CPU seconds of the solve, of the whole assessment and of its parts that look at every corner, the assessment's
share of the solve, and how the assessment grows from one row to the next (1 is linear in the views). The last column is
what the solve takes if every eighth view is nonsense, its corners shuffled, in times of the clean one.

    python benchmarks/trust.py [--views 20 100 500] [--stages]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.solve import solve
from camcal.geometry.camera import Camera
from camcal.observations import Detection
from camcal.synthesis.poses import sample_poses
from camcal.synthesis.scenario import PoseSampling, Scenario
from camcal.threads import single_threaded
from camcal.trust.assess import assess
from camcal.trust.cross_validation import cross_validate
from camcal.trust.fisheye import check_fisheye
from camcal.trust.influence import influence
from camcal.trust.linearised import Linearised
from camcal.trust.minimum import Minimum
from camcal.trust.models import compare_models

CAMERA = Camera((1280, 960), [[905, 0, 652.7], [0, 906.3, 471.9], [0, 0, 1]], [-0.21, 0.07, 0, 0, -0.011])
BOARDS = (Checkerboard(9, 6, 0.025), Checkerboard(24, 18, 0.01))
NOISE_PX = 0.05


def made(board: Checkerboard, views: int) -> list[Detection]:
    """Noisy corners of a board in as many poses."""
    sampling = PoseSampling(count=views, tilt_deg=(10.0, 45.0), roll_deg=(-45.0, 45.0), fill=(0.4, 0.8))
    rng = np.random.default_rng(5)
    points = board.object_points
    ids = np.arange(len(points))
    return [
        Detection(
            f"view_{index:04d}",
            CAMERA.size,
            ids,
            CAMERA.project(pose.apply(points)) + NOISE_PX * rng.normal(size=(len(points), 2)),
            np.full(len(points), np.nan),
        )
        for index, pose in enumerate(sample_poses(Scenario("made", 5, CAMERA, board, sampling)))
    ]


def spoilt(detections: list[Detection]) -> list[Detection]:
    """Shuffle the corners of every eighth view."""
    rng = np.random.default_rng(6)
    return [
        replace(seen, corners_px=rng.permutation(seen.corners_px)) if index % 8 == 0 else seen
        for index, seen in enumerate(detections)
    ]


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return the result of a piece of work, and its CPU seconds."""
    start = time.process_time()
    result = work()
    return result, time.process_time() - start


def stages(calibration: Any, board: Checkerboard) -> dict[str, float]:
    """CPU seconds of the parts of the assessment that compare views with each other."""
    seconds: dict[str, float] = {}
    with single_threaded():
        minimum, seconds["minimum"] = timed(lambda: Minimum.of(calibration, board))
        linearised, seconds["linearised"] = timed(lambda: Linearised.of(minimum))
        _, seconds["cross-validation"] = timed(lambda: cross_validate(linearised))
        sources = [seen.source for seen in calibration.detections]
        _, seconds["influence"] = timed(lambda: influence(linearised, sources, minimum.seen.corners_px))
        _, seconds["models"] = timed(lambda: compare_models(minimum, linearised))
        _, seconds["fisheye"] = timed(lambda: check_fisheye(minimum))
    return seconds


def main() -> None:
    """Make the corners, solve, judge, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, nargs="+", default=[20, 100, 500])
    parser.add_argument("--stages", action="store_true", help="also the parts that compare views with each other")
    arguments = parser.parse_args()
    print(
        f"{'board':>6s} {'views':>6s} {'corners':>8s} {'solve':>8s} {'assess':>8s} {'share':>6s} {'growth':>7s}"
        f" {'nonsense':>9s}"
    )
    for board in BOARDS:
        before: tuple[int, float] | None = None
        for views in arguments.views:
            detections = made(board, views)
            calibration, solving = timed(lambda detections=detections, board=board: solve(detections, board.object_points))
            _, judging = timed(lambda calibration=calibration, board=board: assess(calibration, board))
            nonsense = spoilt(detections)
            solved, spoilt_solving = timed(lambda nonsense=nonsense, board=board: solve(nonsense, board.object_points))
            assert len(solved.rejected) == len(range(0, views, 8))
            growth = "" if before is None else f"{np.log(judging / before[1]) / np.log(views / before[0]):.2f}"
            before = views, judging
            corners = views * len(board.object_points)
            name = f"{board.columns}x{board.rows}"
            print(
                f"{name:>6s} {views:6d} {corners:8d} {solving:6.2f} s {judging:6.2f} s {judging / solving:6.0%} {growth:>7s} "
                f"{spoilt_solving / solving:8.1f}x"
            )
            if arguments.stages:
                for stage, seconds in stages(calibration, board).items():
                    print(f"{'':>23s}{stage:>16s} {seconds:6.3f} s")


if __name__ == "__main__":
    main()
