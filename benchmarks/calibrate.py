"""The whole `camcal calibrate` beside a bare OpenCV script, on the same 20 rendered views of 1280x960.

Both run as whole processes, start-up included, in turn; printed are the medians of CPU and wall time and the median of
the ratios. The bare script does what most people write: the classic finder at full size, cornerSubPix with a window
that follows the spacing, cv2.calibrateCamera; it writes nothing, so the rows of camcal but the last go without report.html.

    python benchmarks/calibrate.py [--runs 7]
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from processes import alternating, ratio

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
        whole = [camcal, "calibrate", images, "--board", "checkerboard:9x6:25mm", "-o", str(folder / "calib"), "--force"]
        ours = [*whole, "--no-report"]
        commands = {
            "bare OpenCV script": [sys.executable, str(folder / "bare.py"), images],
            "camcal --refine opencv": [*ours, "--refine", "opencv"],
            "camcal --refine saddle": [*ours, "--refine", "saddle"],
            "camcal": ours,
            "camcal, and its report": whole,
        }
        found = alternating(list(commands.values()), runs)
    print(f"{'':24}{'CPU s':>8}{'ratio':>8}{'wall s':>9}{'ratio':>8}   (medians of {runs} rounds)")
    for label, taken in zip(commands, found, strict=True):
        cpu_s, wall_s = (statistics.median(getattr(run, what) for run in taken) for what in ("cpu_s", "wall_s"))
        print(
            f"{label:24}{cpu_s:8.3f}{ratio(taken, found[0], 'cpu_s'):8.2f}{wall_s:9.3f}{ratio(taken, found[0], 'wall_s'):8.2f}"
        )


if __name__ == "__main__":
    main()
