"""Calibrations to draw, made without solving anything, from ordinary to absurd; and what a drawn figure holds."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from functools import cache

import numpy as np
from capture_scenes import CAMERA, GRID, ordinary_poses, see
from matplotlib.patches import PathPatch
from PIL import Image
from scenes import BOARD, poses

from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Calibration
from camcal.records import Intrinsics
from camcal.report.figures.catalogue import FIGURES, STYLES
from camcal.report.record import Record

NAMES = [kind.name for kind in FIGURES]
BY_NAME = {kind.name: kind for kind in FIGURES}
LIGHT = STYLES["light"]
FREE = ("fx", "fy", "cx", "cy", "k1", "k2", "k3")


def made(
    views: list[Pose],
    *,
    camera: Camera = CAMERA,
    board=BOARD,
    noise_px: float = 0.1,
    seed: int = 5,
    covariance: np.ndarray | None = None,
    scale: float = 1.0,
) -> Record:
    """A record whose residuals are Gaussian noise, as large as asked, without solving anything."""
    rng = np.random.default_rng(seed)
    seen = see(views, seed, camera, board, noise_px=noise_px)
    noise = tuple(scale * noise_px * rng.normal(size=(len(view), 2)) for view in seen)
    joint = np.diag([0.1, 0.1, 0.1, 0.1, 1e-3, 2e-3, 1e-3, *[1e-4] * 6]) ** 2 if covariance is None else covariance
    calibration = Calibration(camera, FREE, joint, tuple(seen), tuple(views), np.full((len(views), 6), 1e-4), noise)
    known = Intrinsics(camera, free=FREE, covariance=calibration.covariance, rms_px=calibration.rms_px)
    return Record(calibration, known, board)


def wide_folding() -> Camera:
    """A lens of one negative coefficient, which turns back inside the image: 1 - 3 * 0.25 r² = 0 at r = 1.1547."""
    return Camera((1280, 960), [[500, 0, 640], [0, 500, 480], [0, 0, 1]], [-0.25])


def portrait() -> Record:
    """Four views of an AprilGrid, partly out of an upright image."""
    camera = Camera((720, 1280), [[900, 0, 361.0], [0, 905, 642.0], [0, 0, 1]], [-0.1, 0.02, 0.001, -0.002])
    views = ordinary_poses(4, 9, camera, GRID, partial=True, fill=(0.8, 1.4), tilt_deg=(0.0, 45.0))
    assert any(len(view) < GRID.feature_count for view in see(views, 9, camera, GRID))
    return made(views, camera=camera, board=GRID)


def folding() -> Record:
    """Eight views through a lens that folds inside the image."""
    camera = wide_folding()
    return made(poses(8, 4, camera=camera, reach=(0.6, 0.45)), camera=camera)


def absurd() -> Record:
    """Residuals of 1e6 px, a focal length of 1e7, coefficients of 1e14, a covariance of 1e300, boards light seconds away."""
    sane = made(ordinary_poses(6, 2), scale=1e7, covariance=np.eye(len(FREE) + 6) * 1e300)
    camera = Camera((1280, 960), [[1e7, 0, -1e6], [0, 1e5, 1e6], [0, 0, 1]], [1e14, -1e14, 3.0, 1e9, 1e14])
    far = [Pose(pose.R, pose.t * [1.0, 1.0, 10.0 ** (3 * index - 3)]) for index, pose in enumerate(sane.calibration.poses)]
    calibration = replace(sane.calibration, camera=camera, poses=tuple(far))
    return replace(sane, calibration=calibration)


def perfect() -> Record:
    """Residuals that are all zero."""
    return made(ordinary_poses(5, 2), noise_px=0.0)


def few() -> Record:
    """Three views, no corner of which has a known standard deviation."""
    return made(ordinary_poses(3, 1))


CASES = {
    "few": cache(few),
    "portrait": cache(portrait),
    "folding": cache(folding),
    "absurd": cache(absurd),
    "perfect": cache(perfect),
}


def pixels(png: bytes) -> np.ndarray:
    """The image, RGBA."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))


def paths(axes) -> list[np.ndarray]:
    """Vertices (N, 5, 2) of every bundle of arrows in some axes."""
    return [patch.get_path().vertices.reshape(-1, 5, 2) for patch in axes.patches if isinstance(patch, PathPatch)]


def factor_of(title: str) -> float:
    """The magnification that a title states."""
    times = re.search(r"magnified ([\d,.]+)×", title)
    return float(times[1].replace(",", "")) if times else 1 / float(re.search(r"shrunk ([\d,]+)×", title)[1].replace(",", ""))
