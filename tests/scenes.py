"""Scenes for tests: cameras, boards and exact or noisy detections, built from the forward model alone."""

from __future__ import annotations

import numpy as np

from camcal.boards.checkerboard import Checkerboard
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection

BOARD = Checkerboard(9, 6, 0.025)
CAMERA = Camera((1280, 960), [[900, 0, 645.3], [0, 905, 470.2], [0, 0, 1]], [-0.25, 0.08, 0, 0, -0.01])


WIDE_REACH, WIDE_DISTANCES = (1.6, 1.2), (0.08, 0.4)


def poses(
    count: int,
    seed: int,
    *,
    camera: Camera = CAMERA,
    board=BOARD,
    tilt: float = 0.5,
    reach: tuple[float, float] = (0.5, 0.35),
    distances: tuple[float, float] = (0.25, 0.5),
) -> list[Pose]:
    """Draw poses whose whole board lies inside the image.

    `tilt` is the spread of the rotation about x and y in radians, `reach` how far |X / Z| and |Y / Z| of the board's
    centre go, `distances` between which Z of it lies, metres.
    """
    rng = np.random.default_rng(seed)
    centre = board.object_points.mean(axis=0)
    found: list[Pose] = []
    while len(found) < count:
        turn = Pose.from_rvec(rng.normal(size=3) * [tilt, tilt, 1], np.zeros(3))
        (x, y), (near, far) = reach, distances
        ray = np.array([rng.uniform(-x, x), rng.uniform(-y, y), 1]) * rng.uniform(near, far)
        pose = Pose(turn.R, ray - turn.R @ centre)
        if camera.contains(camera.project(pose.apply(board.object_points)), 5).all():
            found.append(pose)
    return found


def detections(
    views: list[Pose], *, noise_px: float = 0.0, seed: int = 0, camera: Camera = CAMERA, board=BOARD
) -> list[Detection]:
    """Project the board at each pose and add Gaussian noise per axis."""
    rng = np.random.default_rng((seed, 7))
    points = board.object_points
    count = len(points)
    return [
        Detection(
            f"view_{index:03d}",
            camera.size,
            np.arange(count),
            camera.project(pose.apply(points)) + noise_px * rng.normal(size=(count, 2)),
            np.full(count, np.nan),
        )
        for index, pose in enumerate(views)
    ]
