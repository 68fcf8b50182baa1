"""Errors of the solved camera over the Cramér-Rao bound of the pixels: `python benchmarks/parameters.py [--seeds N]`.

Each seed is a data set of 20 views at 1280x960 that is calibrated from its pixels three times: by both stages of refinement
("warped"), by the pipeline that most people write ("plain": the classic finder, cv2.cornerSubPix with a window of 0.22 of
the spacing), and by camcal's own `--refine opencv`, which smooths before cornerSubPix. The bound is the covariance of the
intrinsics if every corner had the Cramér-Rao standard deviation of the pixels within 0.45 spacings. The exit code is 1 if a
figure misses its limit; the gain is judged against the plain pipeline.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.normal_equations import NormalEquations, Observations, State
from camcal.calibration.parameters import DEFAULT_DISTORTION, free_names, places
from camcal.calibration.solve import solve
from camcal.detection.detect import detect_board
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Calibration, Detection, Image, View
from camcal.refinement.corner_shapes import corner_shapes
from camcal.refinement.saddle import refine_saddle
from camcal.refinement.warped import refine_warped
from camcal.synthesis.bound import corner_bound
from camcal.synthesis.render import render_view
from camcal.synthesis.scenario import PoseSampling, Scenario
from camcal.workflows.parallel import each

CAMERA = Camera((1280, 960), [[900.0, 0.0, 645.3], [0.0, 902.0, 470.2], [0.0, 0.0, 1.0]], [-0.25, 0.08, 0, 0, -0.01])
BOARD = Checkerboard(9, 6, 0.025)
VIEWS = 20
FREE = free_names(DEFAULT_DISTORTION)
NAMES = ("fx", "cx", "k1", "k2", "k3")
RADIUS_SHARE = 0.45
LARGEST_OVER_BOUND = 1.3
LEAST_GAIN = 5.0
ALLOWED_SIGMAS = 2.0
PIPELINES = ("warped", "plain", "opencv")
PLAIN_REACH = 0.22


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One data set: by pipeline the errors (P,) of the named intrinsics and of the corners over their bounds (M, 2).

    `covariance` (P, P) is the bound of the intrinsics.
    """

    intrinsics: dict[str, FloatArray]
    corners: dict[str, FloatArray]
    covariance: FloatArray
    refused: int


def trial(seed: int) -> Trial:
    """Render a data set, calibrate it by both refinements, and work out the bound."""
    scenario = Scenario("parameters", seed, CAMERA, BOARD, views=PoseSampling(count=VIEWS))
    views = each(lambda index: render_view(scenario, index), range(VIEWS), None, lambda: None)
    bounds = dict(zip((v.detection.source for v in views), each(bound_px, views, None, lambda: None), strict=True))
    images = {view.detection.source: view.image for view in views}
    seen = each(found, views, None, lambda: None)
    solved = {
        "warped": solve(both_stages(seen, images), BOARD.object_points),
        "plain": solve(each(plain, views, None, lambda: None), BOARD.object_points),
        "opencv": solve(seen, BOARD.object_points),
    }
    truth = {view.detection.source: view.detection.corners_px for view in views}

    def corners(calibration: Calibration) -> FloatArray:
        ratios = [(d.corners_px - truth[d.source][d.ids]) / bounds[d.source][d.ids] for d in calibration.detections]
        return np.concatenate(ratios)

    return Trial(
        {name: errors(calibration) for name, calibration in solved.items()},
        {name: corners(calibration) for name, calibration in solved.items()},
        best_covariance([view.detection for view in views], [view.T_cam_board for view in views], list(bounds.values())),
        VIEWS * BOARD.feature_count - solved["warped"].corner_count,
    )


def plain(view: View) -> Detection:
    """Detect the board as a bare OpenCV script does; the finder may start at the opposite corner."""
    done, seen = cv2.findChessboardCorners(view.image, (BOARD.columns, BOARD.rows))
    if not done:
        raise SystemExit(f"{view.detection.source}: the classic finder fails")
    grid = seen.reshape(BOARD.rows, BOARD.columns, 2)
    spacing = min(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1))
    half = max(2, round(PLAIN_REACH * float(spacing)))
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    corners = cv2.cornerSubPix(view.image, seen.reshape(-1, 1, 2).astype(np.float32), (half, half), (-1, -1), criteria)
    corners = corners.reshape(-1, 2).astype(np.float64)
    true = view.detection.corners_px
    if np.linalg.norm(corners[0] - true[0]) > np.linalg.norm(corners[-1] - true[0]):
        corners = corners[::-1]
    return replace(view.detection, corners_px=corners)


def found(view: View) -> Detection:
    """Detect the board, whose corners cv2.cornerSubPix has refined."""
    seen = detect_board(view.image, BOARD, view.detection.source)
    if not isinstance(seen, Detection):
        raise SystemExit(f"{seen.source}: {seen.reason}")
    return seen


def both_stages(seen: Sequence[Detection], images: dict[str, Image]) -> list[Detection]:
    """Refine by the saddle, solve, and refine with the edges that the solution predicts."""

    def first(view: Detection) -> Detection:
        return refine_saddle(images[view.source], view.ids, view.corners_px, BOARD).applied(view)

    start: Calibration = solve(each(first, seen, None, lambda: None), BOARD.object_points)

    def second(item: tuple[Detection, Pose]) -> Detection:
        view, pose = item
        image, corners = images[view.source], view.corners_px
        return refine_warped(image, view.ids, corners, BOARD, camera=start.camera, T_cam_board=pose).applied(view)

    return each(second, list(zip(start.detections, start.poses, strict=True)), None, lambda: None)


def errors(calibration: Calibration) -> FloatArray:
    """Errors of the named intrinsics, shape (P,)."""
    columns = places(CAMERA, NAMES)
    difference: FloatArray = calibration.camera.intrinsics[columns] - CAMERA.intrinsics[columns]
    return difference


def bound_px(view: View) -> FloatArray:
    """Cramér-Rao bound (N, 2) of the corners of a view of the default sensor; rounding counts as noise."""
    corners, neighbours = view.detection.corners_px, corner_shapes(BOARD).neighbours
    distance = np.linalg.norm(corners[neighbours] - corners[:, None], axis=-1)
    distance[neighbours < 0] = np.inf
    sensor = Scenario("", 0, CAMERA, BOARD).sensor
    return corner_bound(
        CAMERA,
        BOARD,
        view.T_cam_board,
        blur_sigma_px=sensor.blur_sigma_px,
        noise_levels=float(np.hypot(sensor.read_noise_levels, 12**-0.5)),
        radius_px=RADIUS_SHARE * distance.min(axis=1),
    )


def best_covariance(truth: Sequence[Detection], poses: Sequence[Pose], bounds_px: Sequence[FloatArray]) -> FloatArray:
    """Covariance (P, P) of the named intrinsics if every corner is as good as its bound."""
    sigma = np.sqrt((np.concatenate(bounds_px) ** 2).mean(axis=1))
    # Not `weighted`, which scales all weights by one number: in these units the residuals have a variance of 1.
    seen = replace(Observations.gather(truth, BOARD.object_points), weights=1 / sigma)
    state = State.of(CAMERA, poses)
    covariance = NormalEquations.build(state, seen, places(CAMERA, FREE)).covariances(state, 1.0).shared
    named = [FREE.index(name) for name in NAMES]
    return covariance[np.ix_(named, named)]


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt((values**2).mean()))


def whitened(errors_by_seed: FloatArray, covariances: FloatArray) -> FloatArray:
    """Errors (S, P) as independent numbers of standard deviation 1, if they are at the bound (S, P, P)."""
    factors = np.linalg.cholesky(covariances)
    independent: FloatArray = np.linalg.solve(factors, errors_by_seed[..., None])[..., 0]
    return independent


def report(trials: Sequence[Trial]) -> bool:
    """Print the table; True if nothing misses.

    A parameter is let off by twice the sampling error of its RMSE. All of them together, made independent of each other,
    are sampled so much better that they are held to the limits themselves.
    """
    covariances = np.array([t.covariance for t in trials])
    best = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    error = {name: np.array([t.intrinsics[name] for t in trials]) for name in PIPELINES}
    sampling = 1 / np.sqrt(2 * len(trials))
    slack = 1 + ALLOWED_SIGMAS * sampling
    together = sampling / np.sqrt(len(NAMES))
    print(f"{len(trials)} seeds: an RMSE is good to {sampling:.0%} (1 sigma), that of all together to {together:.0%}")
    head = ("bound", "warped / bound", "plain / bound", "opencv / bound", "plain / warped")
    print(f"{'RMSE':6}" + "".join(f"{title:>16}" for title in head))
    good = True
    for column, name in enumerate(NAMES):
        bound = rms(best[:, column])
        ratios = {pipeline: rms(values[:, column]) / bound for pipeline, values in error.items()}
        good &= line(name, bound, ratios, LARGEST_OVER_BOUND * slack, LEAST_GAIN / slack)
    ratios = {pipeline: rms(whitened(values, covariances)) for pipeline, values in error.items()}
    good &= line("all", 1.0, ratios, LARGEST_OVER_BOUND, LEAST_GAIN)
    corners = {name: np.concatenate([t.corners[name] for t in trials]) for name in PIPELINES}
    figures = ", ".join(f"{name} {rms(values):.3f}" for name, values in corners.items())
    print(f"corners, RMS over the bound: {figures}; {sum(t.refused for t in trials)} refused by warped")
    return good


def line(name: str, bound: float, ratios: dict[str, float], largest: float, least: float) -> bool:
    """Print one line from the bound and each pipeline's RMSE over it; True if it does not miss."""
    gain = ratios["plain"] / ratios["warped"]
    good = ratios["warped"] <= largest and gain >= least
    limits = f"  (<= {largest:.2f} x bound, >= {least:.2f} x better){'' if good else '  MISSED'}"
    print(f"{name:6}" + "".join(f"{value:16.4g}" for value in (bound, *(ratios[p] for p in PIPELINES), gain)) + limits)
    return good


def main() -> int:
    """Run and print; 1 if a figure misses its limit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=12, help="data sets")
    count, began = parser.parse_args().seeds, time.perf_counter()
    good = report([trial(seed) for seed in range(count)])
    print(f"{time.perf_counter() - began:.0f} s")
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
