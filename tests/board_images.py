"""Pictures of boards for the detection tests: rendered from the forward model, with the true corners beside them."""

from __future__ import annotations

import numpy as np

from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.synthesis.render import render_ideal, true_detection

CAMERA = Camera((640, 480), [[600, 0, 322.4], [0, 603, 236.1], [0, 0, 1]], [-0.2, 0.05])
WHITE_LEVEL = 255


def pose_of(
    board, *, fill: float = 0.6, turn_deg: float = 0.0, tilt_deg: float = 20.0, shift=(0.0, 0.0), camera=CAMERA
) -> Pose:
    """Stand a board before the camera: `fill` is its longer side over the image's width, `shift` is in image widths."""
    points = board.object_points
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    distance = np.ptp(points, axis=0).max() * camera.K[0, 0] / (fill * camera.size[0])
    turned = Pose.from_rvec([0, 0, np.radians(turn_deg)], [0, 0, 0])
    tilted = Pose.from_rvec(np.radians(tilt_deg) * np.array([0.8, 0.6, 0]), [0, 0, 0]) @ turned
    place = np.array([shift[0], shift[1], 1]) * distance * np.array([camera.size[0] / camera.K[0, 0]] * 2 + [1])
    return Pose(tilted.R, place - tilted.R @ centre)


def shoot(board, pose: Pose, *, camera=CAMERA, blur_px: float = 0.7, noise: float = 2.0, seed: int = 0):
    """Render a board in 8 bits; return the image and the true detection."""
    ideal = render_ideal(camera, board, pose, blur_sigma_px=blur_px) * WHITE_LEVEL
    noisy = ideal + noise * np.random.default_rng(seed).normal(size=ideal.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8), true_detection(camera, board, pose, "truth.png")


def errors_px(found, truth) -> np.ndarray:
    """Differences (N, 2) of a detection's corners to the true ones of the same ids."""
    position = dict(zip(truth.ids.tolist(), truth.corners_px, strict=True))
    return found.corners_px - np.array([position[feature] for feature in found.ids.tolist()])
