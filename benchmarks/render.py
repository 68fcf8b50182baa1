"""CPU seconds per rendered view of 1280x960: run `python benchmarks/render.py [--views N]`."""

from __future__ import annotations

import argparse
import os
import statistics
import time

# One thread, so that CPU time is what one core would take.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2

from camcal.boards.spec import parse_board
from camcal.geometry.camera import Camera
from camcal.synthesis.render import render_view
from camcal.synthesis.scenario import PoseSampling, Scenario, Sensor

TARGETS_S = {"checkerboard:9x6:25mm": 0.4, "aprilgrid:6x6:88mm:0.3": 0.8}
BLURS_PX = (0.0, 0.7, 2.0)


def scenario(spec: str, views: int, blur_px: float) -> Scenario:
    """Build the benchmark's dataset: a moderate barrel, boards over 35 to 80 % of the frame, noise 2."""
    camera = Camera((1280, 960), [[900, 0, 642.3], [0, 903, 471.7], [0, 0, 1]], [-0.28, 0.09, 0, 0, -0.01])
    return Scenario("benchmark", 1, camera, parse_board(spec), PoseSampling(views), sensor=Sensor(blur_px))


def seconds_per_view(spec: str, views: int, blur_px: float) -> list[float]:
    """CPU seconds of each view, drawing its pose included, after one view to warm up."""
    made = scenario(spec, views, blur_px)
    render_view(made, 0)
    spent = []
    for index in range(views):
        start = time.process_time()
        render_view(made, index)
        spent.append(time.process_time() - start)
    return spent


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=20, help="views per row")
    views = parser.parse_args().views
    cv2.setNumThreads(1)
    print(f"{'board':24} {'blur px':>7} {'median s':>9} {'worst s':>8} {'target s':>9}")
    for spec, target in TARGETS_S.items():
        for blur in BLURS_PX:
            spent = seconds_per_view(spec, views, blur)
            print(f"{spec:24} {blur:7.1f} {statistics.median(spent):9.3f} {max(spent):8.3f} {target:9.1f}")


if __name__ == "__main__":
    main()
