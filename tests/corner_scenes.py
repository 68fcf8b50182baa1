"""Rendered views with known corners, for the tests of the refinement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scenes import BOARD, CAMERA

from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.refinement.corner_shapes import corner_shapes
from camcal.refinement.look import Look
from camcal.synthesis.bound import corner_bound
from camcal.synthesis.poses import sample_pose
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light, PoseSampling, Scenario, Sensor
from camcal.synthesis.sensor import expose

BARREL = Camera((1280, 960), [[780, 0, 645.3], [0, 782, 470.2], [0, 0, 1]], [-0.38, 0.16, 0, 0, -0.03])
LOOK = Look(
    blur_sigma_px=0.7,
    overshoot=0.0,
    noise=0.008,
    unexplained=0.008,
    ink=0.15,
    paper=0.86,
    background=0.5,
    gradient=0.0,
    gradient_direction_deg=0.0,
    bits=8,
)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A rendered view: how it was made, where the corners are, and how far apart."""

    camera: Camera
    board: object
    pose: Pose
    image: np.ndarray
    corners_px: np.ndarray
    spacing_px: np.ndarray
    light: Light
    sensor: Sensor

    @property
    def ids(self) -> np.ndarray:
        """Every feature of the board."""
        return np.arange(len(self.corners_px))

    def bound(self, largest_px: float = np.inf) -> np.ndarray:
        """Cramér-Rao bound (N, 2) for a radius of 0.45 of the spacing, at most `largest_px`; rounding counts as noise.

        Nor does the radius go beyond what the print leaves clear around a corner.
        """
        shapes = corner_shapes(self.board)
        clear = self.spacing_px * shapes.clear_m / shapes.pitch_m.min(axis=1)
        noise = float(np.hypot(self.sensor.read_noise_levels, np.sqrt(1 / 12)))
        return corner_bound(
            self.camera,
            self.board,
            self.pose,
            self.light,
            blur_sigma_px=self.sensor.blur_sigma_px,
            noise_levels=noise,
            radius_px=np.minimum(np.minimum(0.45 * self.spacing_px, clear), largest_px),
        )


def scene(index, *, camera=CAMERA, board=BOARD, fill=(0.35, 0.8), light=None, sensor=None, tilt_deg=(0.0, 45.0)):
    """Render view `index` of a scenario; the seed of everything is the index."""
    light, sensor = light or Light(), sensor or Sensor()
    views = PoseSampling(count=index + 1, fill=fill, tilt_deg=tilt_deg)
    pose = sample_pose(Scenario("corners", 1, camera, board, views=views), index)
    ideal = render_ideal(
        camera, board, pose, light, blur_sigma_px=sensor.blur_sigma_px, defocus_radius_px=sensor.defocus_radius_px
    )
    image = expose(ideal, sensor, np.random.default_rng(index))
    corners = camera.project(pose.apply(board.object_points))
    neighbours = corner_shapes(board).neighbours
    distance = np.linalg.norm(corners[neighbours] - corners[:, None], axis=-1)
    distance[neighbours < 0] = np.inf
    return Scene(camera, board, pose, image, corners, distance.min(axis=1), light, sensor)


def nearby(corners_px, radius_px, seed=0):
    """Points at a given distance from the corners, in random directions."""
    angle = np.random.default_rng(seed).uniform(0, 2 * np.pi, len(corners_px))
    return corners_px + radius_px * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def rms(values):
    """Root mean square, NaN left out."""
    return float(np.sqrt(np.nanmean(np.square(values))))
