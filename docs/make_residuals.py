"""Make docs/residuals.png: where a board's corners lie beside where a flat board has them, averaged over all photographs.

    CAMCAL_PHOTOS=/path/to/photographs python docs/make_residuals.py

Each panel is one set of photographs. An arrow is the mean residual of one corner over all views, brought back to the board and
magnified; the ring around its foot is the standard deviation that the corners' own sigmas would give that mean. Arrows
far longer than their rings are not noise: they are the board.
"""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path

import cv2
import numpy as np

import camcal
from camcal.geometry.arrays import FloatArray
from camcal.observations import Image
from camcal.workflows.calibrate import CalibrationRun

SETS = {"opencv_left": "checkerboard:9x6:25mm", "swat_calib": "checkerboard:7x5:30mm"}
PANEL = (560, 420)
MARGIN = 70
# Lengths on the board are drawn this many times as long.
MAGNIFIED = 150


def main() -> None:
    """Calibrate both sets, draw them beside each other, print the mean lengths."""
    logging.getLogger("camcal").setLevel(logging.ERROR)
    folder = Path(os.environ.get("CAMCAL_PHOTOS") or sys.exit("CAMCAL_PHOTOS is not set"))
    panels = []
    for name, spec in SETS.items():
        run = camcal.calibrate(folder / name, spec)
        offsets, expected = board_offsets(run)
        panels.append(panel(name, run, offsets, expected))
        mean, noise = 1e6 * np.linalg.norm(offsets, axis=1).mean(), 1e6 * expected.mean()
        print(f"{name}: mean residual of a corner {mean:.0f} um on the board, {noise:.1f} um by its sigmas")
    cv2.imwrite(str(Path(__file__).with_name("residuals.png")), np.concatenate(panels, axis=1))


def board_offsets(run: CalibrationRun) -> tuple[FloatArray, FloatArray]:
    """Mean residual of each feature on the board (N, 2), and the size that its corners' sigmas would give it (N,), metres."""
    calibration, count = run.calibration, run.board.feature_count
    total, weight, variance = np.zeros((count, 2)), np.zeros(count), np.zeros(count)
    for seen, pose, residual in zip(calibration.detections, calibration.poses, calibration.residuals_px, strict=True):
        points_cam = pose.apply(run.board.object_points[seen.ids])
        _, d_point, _ = calibration.camera.project_with_jacobians(points_cam)
        px_per_metre = (d_point @ pose.R)[..., :2]
        total[seen.ids] += np.linalg.solve(px_per_metre, residual[..., None])[..., 0]
        variance[seen.ids] += 2 * seen.sigma_px**2 / np.abs(np.linalg.det(px_per_metre))
        weight[seen.ids] += 1
    return total / weight[:, None], np.sqrt(variance) / weight


def panel(name: str, run: CalibrationRun, offsets: FloatArray, expected: FloatArray) -> Image:
    """Draw one board with its arrows."""
    width, height = PANEL
    canvas = np.full((height, width, 3), 255, np.uint8)
    points = run.board.object_points[:, :2]
    scale = min((width - 2 * MARGIN) / np.ptp(points[:, 0]), (height - 2 * MARGIN) / np.ptp(points[:, 1]))
    middle = points.mean(axis=0)
    feet = (points - middle) * scale + np.array([width / 2, height / 2])
    tips = feet + MAGNIFIED * scale * offsets
    for foot, tip, ring in zip(feet, tips, MAGNIFIED * scale * expected, strict=True):
        start, end = np.round(foot).astype(int).tolist(), np.round(tip).astype(int).tolist()
        cv2.circle(canvas, start, max(1, round(float(ring))), (200, 160, 90), 1, cv2.LINE_AA)
        cv2.arrowedLine(canvas, start, end, (40, 40, 200), 1, cv2.LINE_AA, tipLength=0.25)
    title = f"{name}: mean residual of each corner on the board, x{MAGNIFIED}"
    cv2.putText(canvas, title, (16, 26), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (40, 40, 40), 1, cv2.LINE_AA)
    return canvas


if __name__ == "__main__":
    main()
