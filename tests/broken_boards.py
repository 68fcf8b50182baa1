"""Captures of boards that are bent, stretched, or not what the SPEC says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from broken_captures import COUNT, Capture, Case, case
from capture_scenes import BOARD, GRID, ordinary_poses, see

CASES: dict[str, Case] = {}


def bowed(height_m: float, along: int = 0) -> np.ndarray:
    """Features of the board with a parabola of a given height in the middle, along x (0) or y (1)."""
    points = np.array(BOARD.object_points)
    share = points[:, along] / points[:, along].max()
    points[:, 2] += height_m * 4 * share * (1 - share)
    return points


@case(CASES, "bent_board")
def bent_board(seed: int) -> Capture:
    """A sheet that stands 1 mm off the table in its middle, over 20 cm."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=bowed(0.001)))


@case(CASES, "bent_board")
def slightly_bent_board(seed: int) -> Capture:
    """Half a millimetre, the other way round and along the short side."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=bowed(-0.0005, along=1)))


@case(CASES, "bent_board")
def curled_paper(seed: int) -> Capture:
    """Loose paper that stands up by 4 mm."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=bowed(0.004)))


@case(CASES, "structured_residuals", "inconsistent", "bent_board")
def twisted_board(seed: int) -> Capture:
    """A board whose corners stand 1 mm up and down in turn."""
    u, v = (BOARD.object_points[:, :2] / BOARD.object_points[:, :2].max(axis=0)).T
    twist = np.stack([0 * u, 0 * u, 0.001 * (2 * u - 1) * (2 * v - 1)], axis=1)
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=BOARD.object_points + twist))


@case(CASES, "stretched_print")
def stretched_print(seed: int) -> Capture:
    """A printer that stretches the paper by 0.5 % as it pulls it through."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=BOARD.object_points * [1, 1.005, 1]))


@case(CASES, "wrong_spacing")
def wrong_spacing(seed: int) -> Capture:
    """An AprilGrid whose gaps are .25 of a tag is given as one of .3."""
    printed = replace(GRID, gap_m=0.0075)
    return Capture(see(ordinary_poses(COUNT, seed, board=printed), seed, board=printed), board=GRID.spec)


@case(CASES, "wrong_spacing", "structured_residuals")
def slightly_wrong_spacing(seed: int) -> Capture:
    """The gaps were measured as 9 mm and are 9.2 mm."""
    printed = replace(GRID, gap_m=0.0092)
    return Capture(see(ordinary_poses(COUNT, seed, board=printed), seed, board=printed), board=GRID.spec)


@case(CASES, "wrong_spacing", "structured_residuals")
def two_grids_mixed(seed: int) -> Capture:
    """Every other view shows another AprilGrid, with gaps of .4 of a tag instead of .3."""
    other = replace(GRID, gap_m=0.012)
    first, second = (see(ordinary_poses(COUNT, seed, board=board), seed, board=board) for board in (GRID, other))
    return Capture([(first, second)[index % 2][index] for index in range(COUNT)], board=GRID.spec)
