"""From a printed pattern to its outlines in the image: jumps of light along fine straight segments in pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camcal.boards.base import Pattern
from camcal.errors import InputError
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.synthesis.scenario import Light

_BORDER_SAMPLES = 65
_REACH_SLACK = 1.02
_DIRECTIONS = 8192
_BISECTIONS = 60
_FARTHEST_RADIUS = 1e3


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A board that stands before a uniform background.

    Attributes
    ----------
    pattern : Pattern
        What is printed on the board.
    T_cam_board : Pose
        Where the board stands.
    light : Light
        Its `white`, `black` and `background`.
    """

    pattern: Pattern
    T_cam_board: Pose
    light: Light


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Straight pieces of outlines in the image.

    Attributes
    ----------
    start, end : ndarray of shape (N, 2)
        Ends in pixels; the direction matters.
    jump : ndarray of shape (N,)
        Light on the right side of a segment that runs down the image, minus that on its left.
    """

    start: FloatArray
    end: FloatArray
    jump: FloatArray

    @classmethod
    def joined(cls, *parts: Segments) -> Segments:
        """Put several lots together."""
        return cls(
            np.concatenate([part.start for part in parts]),
            np.concatenate([part.end for part in parts]),
            np.concatenate([part.jump for part in parts]),
        )


def pattern_edges(pattern: Pattern, light: Light) -> tuple[FloatArray, FloatArray]:
    """Collect the cell sides across which the light changes, the outline of the paper included.

    Parameters
    ----------
    pattern : Pattern
    light : Light

    Returns
    -------
    ends_m : ndarray of shape (E, 2, 2)
        Start and end of each side as (x, y) in metres, board frame; sides run right or down.
    jump : ndarray of shape (E,)
        Light on the right of a side that runs down, minus that on its left (a side that runs right: above minus below).
    """
    x, y = pattern.x_edges_m, pattern.y_edges_m
    level = np.pad(light.white + pattern.ink * (light.black - light.white), 1, constant_values=light.background)
    across, down = np.diff(level, axis=1)[1:-1], -np.diff(level, axis=0)[:, 1:-1]
    row, column = np.nonzero(across)
    vertical = np.stack([x[column], y[row], x[column], y[row + 1]], axis=-1)
    jump_vertical = across[row, column]
    row, column = np.nonzero(down)
    horizontal = np.stack([x[column], y[row], x[column + 1], y[row]], axis=-1)
    ends = np.concatenate([vertical, horizontal]).reshape(-1, 2, 2)
    return ends, np.concatenate([jump_vertical, down[row, column]])


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """How far from the optical axis a camera's image (and a margin around it) sees, by direction.

    The rasteriser counts how often an outline winds round a pixel, so what lies outside may be moved as long as it stays
    outside. Points past the reach are pulled back onto it along their ray; so no point is ever past the fold of the lens.

    Attributes
    ----------
    radius : ndarray of shape (1,) or (D,)
        Undistorted normalised radius; one for all directions, or one per direction at equal steps from angle 0.
    folds : bool
        Whether the lens turns back inside the reach: nothing lights the image beyond.
    """

    radius: FloatArray
    folds: bool

    @classmethod
    def of(cls, camera: Camera, margin_px: float) -> Reach:
        """Measure the reach of a camera's image widened by a margin in pixels."""
        t = np.linspace(0, 1, _BORDER_SAMPLES)
        low, high = -0.5 - margin_px, np.array(camera.size) - 0.5 + margin_px
        u, v = low + t * (high[0] - low), low + t * (high[1] - low)
        sides = [
            (u, np.full_like(u, low)),
            (u, np.full_like(u, high[1])),
            (np.full_like(v, low), v),
            (np.full_like(v, high[0]), v),
        ]
        rays = camera.unproject(np.concatenate([np.stack(side, axis=-1) for side in sides]))
        seen = float(np.hypot(rays[:, 0], rays[:, 1]).max())
        wanted = seen * _REACH_SLACK if np.isfinite(seen) else _FARTHEST_RADIUS
        if wanted < camera.lens.valid_radius:
            return cls(np.array([wanted]), folds=False)
        return cls(_fold_radius(camera, wanted), folds=True)

    def project(self, camera: Camera, points_cam: FloatArray) -> FloatArray:
        """Project points (..., 3) in front of the camera to pixels (..., 2), those past the reach pulled back onto it."""
        ideal = points_cam[..., :2] / points_cam[..., 2:]
        r = np.hypot(ideal[..., 0], ideal[..., 1])
        limit = self._limit(ideal)
        outside = r > limit
        if outside.any():
            ideal = ideal * np.where(outside, limit / np.where(outside, r, 1), 1)[..., None]
        return camera.pixels_from_normalised(camera.lens.distort_unchecked(ideal))

    def outline(self, camera: Camera, background: float, length_px: float) -> Segments:
        """Outline of the lit part of the image, the background's light inside it and darkness outside."""
        ideal = _directions() * self.radius[:, None]
        ring = camera.pixels_from_normalised(camera.lens.distort_unchecked(ideal))
        following = np.roll(ring, -1, axis=0)
        cuts = max(1, int(np.ceil(np.linalg.norm(following - ring, axis=1).max() / length_px)))
        share = np.arange(cuts + 1)[:, None, None] / cuts
        vertex = (1 - share) * ring + share * following
        start, end = vertex[:-1].reshape(-1, 2), vertex[1:].reshape(-1, 2)
        return Segments(start, end, np.full(len(start), -background))

    def _limit(self, ideal: FloatArray) -> FloatArray:
        """Reach in the direction of each point (..., 2)."""
        if self.radius.size == 1:
            return self.radius
        turn = np.arctan2(ideal[..., 1], ideal[..., 0]) * (self.radius.size / (2 * np.pi))
        limit: FloatArray = np.interp(turn, np.arange(self.radius.size), self.radius, period=self.radius.size)
        return limit


def board_segments(camera: Camera, scene: Scene, reach: Reach, *, chord_px: float, length_px: float) -> Segments:
    """Trace every outline of a board in the image.

    Parameters
    ----------
    camera : Camera
    scene : Scene
    reach : Reach
        Of this camera.
    chord_px : float
        Largest distance between the true curve and a segment.
    length_px : float
        Longest segment, about; may be inf.

    Raises
    ------
    InputError
        If the board is not wholly in front of the camera, or turns its back to it.
    """
    _refuse_unseen(scene.T_cam_board, scene.pattern)
    ends, jump = pattern_edges(scene.pattern, scene.light)
    R, t = scene.T_cam_board.R, scene.T_cam_board.t

    def project(xy: FloatArray) -> FloatArray:
        return reach.project(camera, xy @ R[:, :2].T + t)

    start, end, edge = _trace(ends, project, chord_px, length_px)
    return Segments(start, end, jump[edge])


def _trace(
    ends: FloatArray, project: Callable[[FloatArray], FloatArray], chord_px: float, length_px: float
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Cut edges (E, 2, 2) on the board into segments in the image: starts (N, 2), ends (N, 2) and the edge of each (N,)."""
    first, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    probe = project(first[:, None] + np.linspace(0, 1, 5)[:, None] * along[:, None])
    length = np.linalg.norm(np.diff(probe, axis=1), axis=-1).sum(axis=1)
    chord = probe[:, -1] - probe[:, 0]
    offset = probe[:, 1:-1] - probe[:, :1]
    bulge = np.abs(offset[..., 0] * chord[:, None, 1] - offset[..., 1] * chord[:, None, 0]).max(axis=1)
    bulge /= np.maximum(np.hypot(chord[:, 0], chord[:, 1]), np.finfo(float).tiny)
    # A curve cut into n chords stands off each by 1 / n² of what it stood off the whole one.
    count = np.ceil(np.maximum(length / length_px, np.sqrt(np.minimum(bulge, length) / chord_px))).astype(np.intp).clip(min=1)
    edge = np.repeat(np.arange(len(ends)), count + 1)
    step = np.arange(edge.size) - np.repeat(np.cumsum(count + 1) - count - 1, count + 1)
    vertex = project(first[edge] + (step / count[edge])[:, None] * along[edge])
    begins = step < count[edge]
    return vertex[begins], vertex[step > 0], edge[begins]


def _refuse_unseen(T_cam_board: Pose, pattern: Pattern) -> None:
    """Refuse a board that is not wholly in front of the camera with its print towards it."""
    left, top, right, bottom = pattern.extent_m
    corners = np.array([[left, top, 0], [right, top, 0], [right, bottom, 0], [left, bottom, 0]])
    nearest = T_cam_board.apply(corners)[:, 2].min()
    if nearest <= 0:
        raise InputError(
            f"pose: the board reaches behind the camera (got Z = {nearest:.4g} m at one corner, expected > 0). Move it away."
        )
    if T_cam_board.R[:, 2] @ T_cam_board.t <= 0:
        raise InputError("pose: the camera sees the back of the board (expected its z axis to point away). Turn it round.")


def _fold_radius(camera: Camera, wanted: float) -> FloatArray:
    """Undistorted radius at which the lens turns back, at most `wanted`, in each of the directions: shape (D,)."""
    direction = _directions()
    low, high = np.zeros(_DIRECTIONS), np.full(_DIRECTIONS, wanted)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        past = np.isnan(camera.lens.distort(middle[:, None] * direction)[:, 0])
        low, high = np.where(past, low, middle), np.where(past, middle, high)
    return low


def _directions() -> FloatArray:
    """Unit vectors at equal steps from angle 0: shape (D, 2)."""
    angle = np.arange(_DIRECTIONS) * (2 * np.pi / _DIRECTIONS)
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
