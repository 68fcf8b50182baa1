"""Captures whose corners are wrong: numbered in another order, off, or found badly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from broken_captures import COUNT, Capture, Case, case, renumbered, shifted, with_gross_errors
from capture_scenes import BOARD, GRID, ordinary_poses, see

from camcal.boards.checkerboard import Checkerboard

CASES: dict[str, Case] = {}
SWAPPED = "rows and columns are swapped"


@case(CASES, "rows_columns_swapped", refused=SWAPPED)
def rows_for_columns(seed: int) -> Capture:
    """Corners of a 6x9 board, numbered along its rows of 6, are given as those of a 9x6 board."""
    other = Checkerboard(6, 9, BOARD.square_m)
    return Capture(see(ordinary_poses(10, seed, board=other), seed, board=other))


@case(CASES, "rows_columns_swapped", refused=SWAPPED)
def rows_for_columns_of_an_aprilgrid(seed: int) -> Capture:
    """A corner file of a grid of 6x5 tags is solved as one of 5x6."""
    return Capture(see(ordinary_poses(8, seed, board=GRID), seed, board=GRID), board=replace(GRID, columns=5, rows=6).spec)


@case(CASES, "large_rms", refused=r"SPEC")
def squares_for_corners_in_a_corner_file(seed: int) -> Capture:
    """54 corners of a 9x6 board are numbered through, and the SPEC counts its 10x7 squares."""
    return Capture(see(ordinary_poses(10, seed), seed), board="checkerboard:10x7:25mm")


@case(CASES, refused="mirrored")
def numbered_from_the_wrong_side(seed: int) -> Capture:
    """All rows of all views are numbered from right to left: the board is seen from behind."""
    return Capture([renumbered(view, np.s_[:, ::-1]) for view in see(ordinary_poses(COUNT, seed), seed)])


@case(CASES, "seen_from_behind", "bad_view")
def one_view_mirrored(seed: int) -> Capture:
    """The rows of a single view are numbered from right to left."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([*views[:4], renumbered(views[4], np.s_[:, ::-1]), *views[5:]])


@case(CASES, "bad_view")
def one_view_shifted(seed: int) -> Capture:
    """In one view the detector missed the first four corners, and every other has the id of the one before."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([*views[:6], shifted(views[6], 4), *views[7:]])


@case(CASES, "bad_view")
def one_view_of_another_board(seed: int) -> Capture:
    """One view shows a board of the same size whose rectangles are not square."""
    views = see(ordinary_poses(COUNT, seed), seed)
    other = BOARD.object_points * [1.0, 1.2, 1.0]
    return Capture([*views[:9], see(ordinary_poses(COUNT, seed), seed, points=other)[9], *views[10:]])


@case(CASES, "outliers")
def a_tenth_of_the_corners_wrong(seed: int) -> Capture:
    """One corner in ten lies 1 to 50 pixels from its place."""
    return Capture(with_gross_errors(see(ordinary_poses(COUNT, seed), seed), seed, share=0.1, low_px=1.0, high_px=50.0)[0])


@case(CASES, "coarse_corners")
def whole_pixels(seed: int) -> Capture:
    """Somebody rounded the corners to whole pixels."""
    views = see(ordinary_poses(10, seed), seed)
    return Capture([replace(view, corners_px=np.rint(view.corners_px)) for view in views])


@case(CASES, "uncertain", "unsupported_coefficient")
def corners_by_hand(seed: int) -> Capture:
    """Corners clicked with a mouse: a pixel of noise."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, noise_px=1.0))
