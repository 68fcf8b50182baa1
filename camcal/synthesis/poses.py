"""Where the boards stand: poses drawn so that the views together cover the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.boards.checkerboard import Checkerboard
from camcal.errors import InputError
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose, rotation_from_rvec
from camcal.synthesis.scenario import PoseSampling, Range, Scenario
from camcal.synthesis.streams import POSE, random_stream

# Which ninth of the image a view leans towards, as (column, row): few views already reach the corners and the centre.
_NINTHS = ((0, 0), (2, 2), (2, 0), (0, 2), (1, 1), (1, 0), (1, 2), (0, 1), (2, 1))
_JITTER = 0.15
_PARTIAL_INSET = 0.12
_DRAWS = 60
_STEPS = 50
_POINTS_PER_SIDE = 9
# A whole board keeps this share of the image's shorter side between its print and the image's edge.
_MARGIN = 0.015
# A board that leaves the frame keeps this share of its features in it.
_FEATURES_SEEN = 0.4
_FILL_TOLERANCE = 0.005
_SHIFT_TOLERANCE = 0.1
_NEAREST_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class _Wish:
    """One draw: how a board should stand, and where in its room to move (0 is far left or top, 1 far right or bottom)."""

    tilt_rad: float
    azimuth_rad: float
    roll_rad: float
    fill: float
    anchor: tuple[float, float]


def sample_poses(scenario: Scenario) -> tuple[Pose, ...]:
    """Draw the poses of all views of a scenario.

    Returns
    -------
    tuple of Pose
        T_cam_board of each view; pose i is `sample_pose(scenario, i)`.

    Raises
    ------
    InputError
        If a view cannot be placed as the scenario asks.
    """
    return tuple(sample_pose(scenario, index) for index in range(scenario.views.count))


def sample_pose(scenario: Scenario, index: int) -> Pose:
    """Draw the pose of one view.

    The views lean in turn towards the nine thirds of the image. Tilt, roll and fill are uniform in their ranges. A whole
    board keeps all its print inside the image and inside the lens's fold; a partial one may leave the frame but keeps
    two fifths of its features in it.

    Parameters
    ----------
    scenario : Scenario
    index : int
        Which view, 0..count - 1.

    Returns
    -------
    Pose
        T_cam_board.

    Raises
    ------
    InputError
        If the view cannot be placed as the scenario asks.
    ValueError
        If there is no such view.
    """
    views = scenario.views
    if not 0 <= index < views.count:
        raise ValueError(f"index: no such view (got {index}, expected 0..{views.count - 1})")
    if views.partial and isinstance(scenario.board, Checkerboard):
        raise InputError("views.partial: a checkerboard must be seen whole to be found. Take an AprilGrid, or partial: false.")
    rng = random_stream(scenario.seed, index, POSE)
    place = _place_partial if views.partial else _place_whole
    for _ in range(_DRAWS):
        pose = place(scenario, _draw(views, index, rng))
        if pose is not None:
            return pose
    asked = f"fill {list(views.fill)}, tilt_deg {list(views.tilt_deg)}"
    raise InputError(
        f"views: no room for the board in view {index} (got {asked}, tried {_DRAWS} draws). "
        f"Lower fill{' or tilt_deg' if views.partial else ', lower tilt_deg or allow partial boards'}."
    )


def _draw(views: PoseSampling, index: int, rng: np.random.Generator) -> _Wish:
    """Draw one wish; always the same number of values, so that a draw never depends on the ones before it."""
    column, row = _NINTHS[index % len(_NINTHS)]
    x, y = np.clip(np.array([column, row]) / 2 + rng.uniform(-_JITTER, _JITTER, 2), 0, 1)

    def angle(limits: Range) -> float:
        return float(np.radians(rng.uniform(*limits)))

    return _Wish(
        tilt_rad=angle(views.tilt_deg),
        azimuth_rad=angle((0, 360)),
        roll_rad=angle(views.roll_deg),
        fill=float(rng.uniform(*views.fill)),
        anchor=(float(x), float(y)),
    )


def _place_whole(scenario: Scenario, wish: _Wish) -> Pose | None:
    """Place a board wholly inside the image; None if it does not fit."""
    found = _solve(scenario, wish, stay_inside=True)
    if found is None or not _in_front(found[0], scenario):
        return None
    pose, _ = found
    corners = scenario.camera.project(pose.apply(scenario.board.object_points))
    return pose if np.isfinite(corners).all() else None


def _place_partial(scenario: Scenario, wish: _Wish) -> Pose | None:
    """Place a board that may leave the image, at the distance of its fill in the middle; None if too little is seen."""
    camera = scenario.camera
    found = _solve(scenario, wish, stay_inside=False)
    if found is None:
        return None
    _, distance = found
    share = _PARTIAL_INSET + (1 - 2 * _PARTIAL_INSET) * np.array(wish.anchor)
    pose = _stand(camera, _print_outline(scenario).mean(axis=0), wish, share * camera.size - 0.5, distance)
    if pose is None or not _in_front(pose, scenario):
        return None
    seen = camera.contains(camera.project(pose.apply(scenario.board.object_points)))
    return pose if seen.mean() >= _FEATURES_SEEN else None


def _in_front(pose: Pose, scenario: Scenario) -> bool:
    """Whether all of the paper is in front of the camera, no part of it nearer than a tenth of its distance."""
    left, top, right, bottom = scenario.board.pattern.extent_m
    corners = pose.apply([[left, top, 0], [right, top, 0], [right, bottom, 0], [left, bottom, 0]])
    return bool(corners[:, 2].min() >= _NEAREST_SHARE * np.linalg.norm(corners.mean(axis=0)))


def _solve(scenario: Scenario, wish: _Wish, *, stay_inside: bool) -> tuple[Pose, float] | None:
    """Find the pose and the distance in metres at which a board has its fill, by fixed-point iteration.

    With `stay_inside` the print keeps within the image and goes to its anchor; without, it is centred. None if there is
    no such pose.
    """
    camera = scenario.camera
    size = np.array(camera.size, dtype=np.float64)
    outline = _print_outline(scenario)
    margin = _MARGIN * size.min()
    middle = (size - 1) / 2
    anchor = np.array(wish.anchor) if stay_inside else np.array([0.5, 0.5])
    pixel, distance = middle, camera.K[0, 0] * np.ptp(outline, axis=0).max() / (wish.fill * size[0])
    for _ in range(_STEPS):
        pose = _stand(camera, outline.mean(axis=0), wish, pixel, distance)
        seen = np.full((1, 2), np.nan) if pose is None else camera.project(pose.apply(outline))
        if pose is None or not np.isfinite(seen).all():
            # Past the fold of the lens or behind the camera: step back, and towards the middle.
            pixel, distance = 0.5 * (pixel + middle), 1.2 * distance
            continue
        span = np.ptp(seen, axis=0)
        excess = (span / size).max() / wish.fill
        free = size - 2 * margin - span
        shift = margin - 0.5 + anchor * free - seen.min(axis=0)
        if abs(excess - 1) < _FILL_TOLERANCE and np.abs(shift).max() < _SHIFT_TOLERANCE * margin:
            return (pose, distance) if not stay_inside or free.min() >= 0 else None
        pixel, distance = pixel + shift, distance * excess
    return None


def _stand(camera: Camera, centre_board: FloatArray, wish: _Wish, pixel: FloatArray, distance_m: float) -> Pose | None:
    """Pose whose board centre is seen at a pixel from a distance; None where the lens sees nothing."""
    ray = camera.unproject(pixel)
    if not np.isfinite(ray).all():
        return None
    forward = ray / np.linalg.norm(ray)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    sight = np.column_stack([right, np.cross(forward, right), forward])
    axis = [np.cos(wish.azimuth_rad), np.sin(wish.azimuth_rad), 0.0]
    R = sight @ rotation_from_rvec(wish.tilt_rad * np.array(axis)) @ rotation_from_rvec([0, 0, wish.roll_rad])
    return Pose(R, distance_m * forward - R @ centre_board)


def _print_outline(scenario: Scenario) -> FloatArray:
    """Points along the outline of all that is printed black, board frame: shape (N, 3)."""
    pattern = scenario.board.pattern
    columns, rows = np.flatnonzero(pattern.ink.any(axis=0)), np.flatnonzero(pattern.ink.any(axis=1))
    left, right = pattern.x_edges_m[columns[0]], pattern.x_edges_m[columns[-1] + 1]
    top, bottom = pattern.y_edges_m[rows[0]], pattern.y_edges_m[rows[-1] + 1]
    t = np.linspace(0, 1, _POINTS_PER_SIDE)[:-1, None]
    corners = np.array([[left, top, 0], [right, top, 0], [right, bottom, 0], [left, bottom, 0]])
    return np.concatenate([a + t * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
