"""Made captures: where boards stand, what a camera sees of them, and how that is written down, from the forward model alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from scenes import BOARD

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.formats.corners_file import save_corners
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection
from camcal.synthesis.poses import sample_poses
from camcal.synthesis.scenario import PoseSampling, Scenario

GRID = AprilGrid(6, 5, tag_m=0.03, gap_m=0.009)
CAMERA = Camera((1280, 960), [[905, 0, 652.7], [0, 906.3, 471.9], [0, 0, 1]], [-0.21, 0.07, 0, 0, -0.011])
# 117 degrees across the diagonal.
VERY_WIDE = Camera((1280, 960), [[701.3, 0, 631.2], [0, 699.8, 488.6], [0, 0, 1]], [-0.33, 0.12, 0, 0, -0.014])
NOISE_PX = 0.05
_DRAWS = 20_000


class Eye(Protocol):
    """What is needed of a camera to place boards before it and to see them."""

    size: tuple[int, int]

    def project(self, points_cam: Any) -> np.ndarray:
        """Points (..., 3) to pixels (..., 2)."""
        ...

    def unproject(self, pixels: Any) -> np.ndarray:
        """Pixels (..., 2) to rays (..., 3)."""
        ...


@dataclass(frozen=True)
class Equidistant:
    """A fisheye: the distance from the centre of the image is proportional to the angle from the axis."""

    size: tuple[int, int]
    f: float
    centre: tuple[float, float]

    def project(self, points_cam: Any) -> np.ndarray:
        """Points (..., 3) to pixels (..., 2)."""
        points = np.asarray(points_cam, dtype=np.float64)
        across = np.linalg.norm(points[..., :2], axis=-1)
        angle = np.arctan2(across, points[..., 2])
        return points[..., :2] * (self.f * angle / np.maximum(across, 1e-12))[..., None] + self.centre

    def unproject(self, pixels: Any) -> np.ndarray:
        """Pixels (..., 2) to unit rays (..., 3)."""
        offset = (np.asarray(pixels, dtype=np.float64) - self.centre) / self.f
        angle = np.linalg.norm(offset, axis=-1)
        sine = np.sinc(angle / np.pi)
        return np.concatenate([offset * sine[..., None], np.cos(angle)[..., None]], axis=-1)


def ordinary_poses(count: int, seed: int, camera: Camera = CAMERA, board: Board = BOARD, **sampling: Any) -> list[Pose]:
    """Boards as a careful person holds them: tilted, near and far, over the whole image."""
    asked: dict[str, Any] = {"tilt_deg": (10.0, 45.0), "roll_deg": (-45.0, 45.0), "fill": (0.4, 0.8)} | sampling
    return list(sample_poses(Scenario("made", seed, camera, board, PoseSampling(count=count, **asked))))


def placed_poses(
    count: int,
    seed: int,
    camera: Eye = CAMERA,
    board: Board = BOARD,
    *,
    x: tuple[float, float] = (0.0, 1.0),
    y: tuple[float, float] = (0.0, 1.0),
    tilt_deg: tuple[float, float] = (10.0, 45.0),
    distance_m: tuple[float, float] = (0.25, 0.5),
) -> list[Pose]:
    """Boards somewhere in particular: every feature inside the part of the image from x and y, in shares of its sides."""
    rng = np.random.default_rng((seed, 3))
    points = board.object_points
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    low, high = (np.array([x[end], y[end]]) * camera.size - 0.5 for end in (0, 1))
    found: list[Pose] = []
    for _ in range(_DRAWS):
        azimuth, tilt, roll = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(*tilt_deg)), rng.uniform(-0.8, 0.8)
        turn = Pose.from_rvec([tilt * np.cos(azimuth), tilt * np.sin(azimuth), 0], [0, 0, 0])
        turn = turn @ Pose.from_rvec([0, 0, roll], [0, 0, 0])
        ray = camera.unproject(rng.uniform(low, high))
        pose = Pose(turn.R, ray / np.linalg.norm(ray) * rng.uniform(*distance_m) - turn.R @ centre)
        stands = pose.apply(points)
        # In front of the camera with some room, and its print towards the camera.
        if (stands[:, 2] < 0.02).any() or pose.R[:, 2] @ pose.t < 0.1 * np.linalg.norm(pose.t):
            continue
        corners = camera.project(stands)
        if np.isfinite(corners).all() and ((corners > low + 3) & (corners < high - 3)).all():
            found.append(pose)
        if len(found) == count:
            return found
    raise ValueError(f"placed_poses: no room for the boards (got {len(found)} of {count})")


def see(
    poses: Sequence[Pose],
    seed: int,
    camera: Eye | Callable[[int], Eye] = CAMERA,
    board: Board = BOARD,
    *,
    noise_px: float = NOISE_PX,
    points: np.ndarray | None = None,
) -> list[Detection]:
    """See the board at each pose, what lies in the image of it, with Gaussian noise per axis.

    Parameters
    ----------
    camera : Eye or function of a view's index that gives one
    points : ndarray of shape (N, 3), optional
        Features of the real board, where they differ from the nominal ones.
    """
    rng = np.random.default_rng((seed, 7))
    real = board.object_points if points is None else points
    views = []
    for index, pose in enumerate(poses):
        eye = camera if hasattr(camera, "project") else camera(index)
        exact = eye.project(pose.apply(real))
        inside = np.isfinite(exact).all(axis=1) & ((exact >= 0) & (exact <= np.array(eye.size) - 1)).all(axis=1)
        noisy = exact + noise_px * rng.normal(size=exact.shape)
        ids = np.flatnonzero(inside & ((noisy >= -0.5) & (noisy <= np.array(eye.size) - 0.5)).all(axis=1))
        views.append(Detection(f"view_{index:03d}.png", eye.size, ids, noisy[ids], np.full(ids.size, np.nan)))
    return views


def careful_views(
    seed: int, count: int = 12, *, camera: Camera = CAMERA, noise_px: float = NOISE_PX, points: np.ndarray | None = None
) -> list[Detection]:
    """Corners of boards held with care."""
    return see(ordinary_poses(count, seed, camera), seed, camera, noise_px=noise_px, points=points)


def grid_of(view: Detection, board: Checkerboard = BOARD) -> np.ndarray:
    """Corners of a view that shows all of a checkerboard, as (rows, columns, 2)."""
    return view.corners_px.reshape(board.rows, board.columns, 2)


def written(views: Sequence[Detection], folder: Path) -> Path:
    """Write views as a corners file."""
    path = folder / "corners.csv"
    save_corners(path, views)
    return path
