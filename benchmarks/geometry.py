"""Time the forward model on whole images: `python benchmarks/geometry.py`."""

from __future__ import annotations

import resource
import time

import numpy as np

from camcal.geometry.camera import Camera

LENSES = {
    "pinhole": [],
    "barrel": [-0.28, 0.09, 0, 0, -0.012],
    "pincushion": [0.2, 0.05],
    "folds in the image": [-0.38],
    "tangential": [-0.28, 0.09, 1e-3, -2e-3, -0.012],
    "rational, folds in the image": [0.5, -0.2, 1e-4, 2e-4, 0.01, 0.8, -0.1, 0.02],
}


def main() -> None:
    """Print CPU seconds, the worst round trip and the peak memory."""
    print(f"{'lens':30s} {'image':>10s} {'unproject':>10s} {'project':>8s} {'round trip':>11s} {'NaN':>6s}")
    for width, height in ((1280, 960), (4000, 3000)):
        K = [[0.7 * width, 0, width / 2], [0, 0.7 * width, height / 2], [0, 0, 1]]
        pixels = np.stack(np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float)), axis=-1)
        for name, dist in LENSES.items():
            camera = Camera((width, height), K, dist)
            begin = time.process_time()
            rays = camera.unproject(pixels)
            middle = time.process_time()
            again = camera.project(rays)
            end = time.process_time()
            worst = np.nanmax(np.abs(again - pixels))
            share = np.isnan(rays[..., 0]).mean()
            size = f"{width}x{height}"
            print(f"{name:30s} {size:>10s} {middle - begin:8.2f} s {end - middle:6.2f} s {worst:8.1e} px {share:6.1%}")
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    main()
