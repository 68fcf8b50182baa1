"""Captures whose boards were held in the wrong places, all alike, or too few times."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from broken_captures import ANY_WORD, COUNT, Capture, Case, case
from capture_scenes import BOARD, ordinary_poses, placed_poses, see

from camcal.geometry.pose import Pose

CASES: dict[str, Case] = {}


@case(CASES, "central_only")
def boards_in_the_middle_only(seed: int) -> Capture:
    """No board leaves the middle third of the image's width and height."""
    return Capture(see(placed_poses(COUNT, seed, x=(0.3, 0.7), y=(0.3, 0.7), distance_m=(0.5, 1.0)), seed))


@case(CASES, refused="Tilt the board")
def fronto_parallel(seed: int) -> Capture:
    """No board is tilted at all."""
    return Capture(see(placed_poses(COUNT, seed, tilt_deg=(0, 0)), seed))


@case(CASES, "fronto_parallel", refused="Tilt the board")
def hardly_tilted(seed: int) -> Capture:
    """Every board is within 4 degrees of fronto-parallel."""
    return Capture(see(placed_poses(COUNT, seed, tilt_deg=(0, 4)), seed))


@case(CASES, "one_orientation", refused="in different directions")
def all_tilted_alike(seed: int) -> Capture:
    """The board stands still, tilted by 30 degrees, while the camera slides: every view has the same orientation."""
    rng = np.random.default_rng((seed, 5))
    turn = Pose.from_rvec([np.radians(30), 0, 0], [0, 0, 0])
    centre = BOARD.object_points.mean(axis=0)
    shifts = rng.uniform([-0.1, -0.07, 0.32], [0.1, 0.07, 0.45], (COUNT, 3))
    return Capture(see([Pose(turn.R, shift - turn.R @ centre) for shift in shifts], seed))


@case(CASES, "uncovered")
def one_side_only(seed: int) -> Capture:
    """Every board is in the left half of the image."""
    return Capture(see(placed_poses(COUNT, seed, x=(0.0, 0.5), distance_m=(0.35, 0.6)), seed))


@case(CASES, "uncovered")
def never_at_the_bottom(seed: int) -> Capture:
    """No board reaches the lower 45 % of the image."""
    return Capture(see(placed_poses(COUNT, seed, y=(0.0, 0.55), distance_m=(0.3, 0.6)), seed))


@case(CASES, "small_boards", "uncertain")
def far_away_and_small(seed: int) -> Capture:
    """Boards of 60 pixels, two in each of twenty parts of the image."""
    parts = [((column / 5, (column + 1) / 5), (row / 4, (row + 1) / 4)) for row in range(4) for column in range(5)]
    placed = [placed_poses(2, seed + part, x=x, y=y, distance_m=(2.5, 3.5)) for part, (x, y) in enumerate(parts)]
    return Capture(see([pose for pair in placed for pose in pair], seed))


@case(CASES, "one_distance", words=ANY_WORD)
def one_distance(seed: int) -> Capture:
    """Every board is 0.40 m away, within 2 mm."""
    return Capture(see(placed_poses(2 * COUNT, seed, distance_m=(0.40, 0.402)), seed))


@case(CASES, refused="too few usable views .got 2")
def two_views(seed: int) -> Capture:
    """Two views."""
    return Capture(see(ordinary_poses(2, seed), seed))


@case(CASES, "few_views")
def three_views(seed: int) -> Capture:
    """Three views."""
    return Capture(see(ordinary_poses(3, seed), seed))


@case(CASES, "few_views")
def four_views(seed: int) -> Capture:
    """Four views."""
    return Capture(see(ordinary_poses(4, seed), seed))


@case(CASES, refused="the same view as")
def copies_of_two_views(seed: int) -> Capture:
    """Two views, each stored eight times under other names."""
    views = see(ordinary_poses(2, seed), seed)
    return Capture([replace(views[index % 2], source=f"copy_{index:02d}.png") for index in range(COUNT)])


@case(CASES, "repeated_views", refused="same|alike|repeat")
def one_view_again_and_again(seed: int) -> Capture:
    """Sixteen photographs of a board and a camera that stand still: nothing but the noise changes."""
    return Capture(see(ordinary_poses(1, seed) * COUNT, seed))


@case(CASES, "repeated_views", refused="same|alike|repeat")
def a_video_of_a_board_held_still(seed: int) -> Capture:
    """Thirty frames in which a hand trembles by half a millimetre and a tenth of a degree."""
    (pose,) = ordinary_poses(1, seed)
    rng = np.random.default_rng((seed, 5))
    tremble = [Pose.from_rvec(rng.normal(size=3) * 0.0017, rng.normal(size=3) * 0.0005) for _ in range(30)]
    return Capture(see([motion @ pose for motion in tremble], seed))


@case(CASES, "repeated_views", "few_views")
def three_views_again_and_again(seed: int) -> Capture:
    """Three places of the board, five photographs of each."""
    return Capture(see(ordinary_poses(3, seed) * 5, seed))
