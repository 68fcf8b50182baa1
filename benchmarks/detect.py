"""CPU time and accuracy of detection beside bare OpenCV: `python benchmarks/detect.py [--views N]`.

The bare script for checkerboards is the classic finder at full size with cornerSubPix at a window adapted to the spacing;
for AprilGrids it is ArucoDetector with its default parameters over the whole family, without any refinement.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.detection.detect import detect_board
from camcal.formats.scenario_file import load_scenario
from camcal.geometry.arrays import FloatArray
from camcal.observations import Detection, Image, View
from camcal.resources import config_names, config_path
from camcal.synthesis.render import render_view
from camcal.synthesis.scenario import Scenario
from camcal.threads import single_threaded

BARE_REACH = 0.22
CLASSIC = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE


def main() -> None:
    """Print one line per scenario, and one for noise of 12 MP, the slowest image there is."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=6, help="views per scenario")
    count = parser.parse_args().views
    print(f"{'scenario':<20}{'views':>8}{'bare s':>9}{'ours s':>9}{'ratio':>7}{'corners':>12}{'RMS px':>9}{'max px':>8}")
    with single_threaded():
        for name in config_names():
            scenario = load_scenario(config_path(name))
            count_here = min(count, scenario.views.count)
            report(name, scenario, [render_view(scenario, index) for index in range(count_here)])
        noise = np.random.default_rng(0).integers(0, 256, (3000, 4000)).astype(np.uint8)
        for board in (Checkerboard(9, 6, 0.025), AprilGrid(6, 6, tag_m=0.088, gap_m=0.0264)):
            seconds = cpu_seconds(lambda image, board=board: detect_board(image, board, "noise"), [noise])
            print(f"12 MP of noise, {board.spec}: {seconds:.2f} s")


def report(name: str, scenario: Scenario, views: Sequence[View]) -> None:
    """Time both on the same images, and compare ours with the truth."""
    board = scenario.board
    images = [view.image if view.image.dtype == np.uint8 else (view.image >> 8).astype(np.uint8) for view in views]
    bare_s = cpu_seconds(lambda image: bare(image, board), images)
    ours_s = cpu_seconds(lambda image: detect_board(image, board, name), images)
    found = [detect_board(image, board, name) for image in images]
    pairs = [(one, view) for one, view in zip(found, views, strict=True) if isinstance(one, Detection)]
    errors = np.concatenate([differences_px(one, view, scenario) for one, view in pairs])
    corners = f"{len(errors)}/{sum(len(view.detection) for view in views)}"
    rms = np.sqrt((errors**2).mean())
    print(
        f"{name:<20}{len(pairs):>4}/{len(views):<3}{bare_s:>9.4f}{ours_s:>9.4f}{ours_s / bare_s:>7.2f}"
        f"{corners:>12}{rms:>9.4f}{np.abs(errors).max():>8.3f}"
    )


def cpu_seconds(work: Callable[[Image], object], images: Sequence[Image]) -> float:
    """CPU seconds per image; the first call, which fills caches, is not counted."""
    work(images[0])
    start = time.process_time()
    for image in images:
        work(image)
    return (time.process_time() - start) / len(images)


def bare(gray: Image, board: object) -> object:
    """What a short script on OpenCV alone does."""
    if isinstance(board, AprilGrid):
        family = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_APRILTAG_{board.family.removeprefix('tag')}"))
        parameters = cv2.aruco.DetectorParameters()
        parameters.markerBorderBits = board.border_bits
        return cv2.aruco.ArucoDetector(family, parameters).detectMarkers(gray)
    assert isinstance(board, Checkerboard)
    found, corners = cv2.findChessboardCorners(gray, (board.columns, board.rows), flags=CLASSIC)
    if not found:
        return None
    flat = np.asarray(corners, dtype=np.float32).reshape(-1, 2)
    apart = np.linalg.norm(flat[:, None] - flat[None], axis=2)
    half = max(2, round(BARE_REACH * float(np.min(apart[apart > 0]))))
    return cv2.cornerSubPix(gray, flat.reshape(-1, 1, 2), (half, half), (-1, -1), (3, 30, 0.005))


def differences_px(found: Detection, view: View, scenario: Scenario) -> FloatArray:
    """Found less true corners (N, 2), up to the board's symmetries."""
    truth = np.full((scenario.board.feature_count, 2), np.nan)
    truth[view.detection.ids] = view.detection.corners_px
    readings = [np.arange(len(truth)), *(turn.ids for turn in scenario.board.symmetries)]
    options = [found.corners_px - truth[ids][found.ids] for ids in readings]
    return min(options, key=lambda difference: float(np.abs(difference).sum()))


if __name__ == "__main__":
    main()
