"""The whole `camcal calibrate` beside a bare OpenCV script, on the same 20 rendered views of 1280x960.

Both run as whole processes, start-up included, in turn; printed are the medians of CPU and wall time and the median of
the ratios. The bare script does what most people write: the classic finder at full size, cornerSubPix with a window
that follows the spacing, cv2.calibrateCamera.

    python benchmarks/calibrate.py [--runs 7]
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SCENE = """
name: benchmark
seed: 1
camera: {size: [1280, 960], fx: 900.0, fy: 902.0, cx: 645.0, cy: 470.0, distortion: {k1: -0.2, k2: 0.05}}
board: "checkerboard:9x6:25mm"
views: {count: 20, tilt_deg: [0, 45], fill: [0.35, 0.8]}
"""

BARE = """
import sys
from pathlib import Path
import cv2
import numpy as np

columns, rows, square = 9, 6, 0.025
board = np.zeros((rows * columns, 3), np.float32)
board[:, :2] = np.mgrid[0:columns, 0:rows].T.reshape(-1, 2) * square
points, corners = [], []
for path in sorted(Path(sys.argv[1]).glob("*.png")):
    gray = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    found, seen = cv2.findChessboardCorners(gray, (columns, rows))
    if not found:
        continue
    grid = seen.reshape(rows, columns, 2)
    spacing = min(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).min() for axis in (0, 1))
    half = max(2, round(0.22 * spacing))
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
    corners.append(cv2.cornerSubPix(gray, seen.astype(np.float32), (half, half), (-1, -1), criteria))
    points.append(board)
rms, K, dist, *_ = cv2.calibrateCamera(points, corners, gray.shape[::-1], None, None, flags=cv2.CALIB_ZERO_TANGENT_DIST)
print(len(points), rms, K, dist)
"""


def measure(command: list[str]) -> tuple[float, float]:
    """CPU and wall seconds of a finished process and its children."""
    start = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"{' '.join(command)}: failed with status {status}")
    return usage.ru_utime + usage.ru_stime, time.perf_counter() - start


def main() -> None:
    """Render the views, run all in turn, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=7)
    runs = parser.parse_args().runs
    camcal = shutil.which("camcal", path=str(Path(sys.executable).parent)) or "camcal"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.yaml").write_text(SCENE)
        (folder / "bare.py").write_text(BARE)
        data = str(folder / "data")
        subprocess.run([camcal, "synth", str(folder / "scene.yaml"), "-o", data], check=True, stdout=subprocess.DEVNULL)
        images = str(folder / "data" / "images")
        ours = [camcal, "calibrate", images, "--board", "checkerboard:9x6:25mm", "-o", str(folder / "calib"), "--force"]
        commands = {
            "bare OpenCV script": [sys.executable, str(folder / "bare.py"), images],
            "camcal --refine opencv": [*ours, "--refine", "opencv"],
            "camcal --refine saddle": [*ours, "--refine", "saddle"],
            "camcal": ours,
        }
        measured: dict[str, list[tuple[float, float]]] = {label: [] for label in commands}
        for _ in range(runs + 1):
            for label, command in commands.items():
                measured[label].append(measure(command))
    bare = measured["bare OpenCV script"][1:]
    print(f"{'':24}{'CPU s':>8}{'ratio':>8}{'wall s':>9}{'ratio':>8}   (medians of {runs} rounds)")
    for label, rows in measured.items():
        figures = []
        for index in (0, 1):
            figures.append(statistics.median(row[index] for row in rows[1:]))
            figures.append(statistics.median(row[index] / other[index] for row, other in zip(rows[1:], bare, strict=True)))
        print(f"{label:24}{figures[0]:8.3f}{figures[1]:8.2f}{figures[2]:9.3f}{figures[3]:8.2f}")


if __name__ == "__main__":
    main()
