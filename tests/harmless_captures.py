"""Captures that look broken and are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from broken_cameras import decentred_lens, pixels_far_from_square
from broken_captures import COUNT, TRUSTED, WIDE, Capture, Case, case, renumbered, with_gross_errors
from capture_scenes import BOARD, CAMERA, GRID, ordinary_poses, see

from camcal.geometry.camera import Camera

CASES: dict[str, Case] = {}


@case(CASES, words=TRUSTED)
def half_turns(seed: int) -> Capture:
    """Every other view is numbered from the opposite corner: the same board, held upside down."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([renumbered(view, np.s_[::-1, ::-1]) if index % 2 else view for index, view in enumerate(views)])


@case(CASES, words=TRUSTED)
def two_sizes_of_squares(seed: int) -> Capture:
    """Every other view shows a board with squares of 30 mm instead of 25: farther away, but the same camera."""
    large = BOARD.object_points * 1.2
    first, second = (see(ordinary_poses(COUNT, seed), seed, points=points) for points in (None, large))
    return Capture([(first, second)[index % 2][index] for index in range(COUNT)])


@case(CASES, words=TRUSTED)
def a_hundredth_of_the_corners_wrong(seed: int) -> Capture:
    """One corner in a hundred lies half a pixel to 100 pixels from its place."""
    return Capture(with_gross_errors(see(ordinary_poses(COUNT, seed), seed), seed, share=0.01, low_px=0.5, high_px=100)[0])


@case(CASES, words=TRUSTED)
def a_few_noisier_views(seed: int) -> Capture:
    """Three views have four times the noise of the others."""
    poses = ordinary_poses(COUNT, seed)
    return Capture([*see(poses, seed)[:-3], *see(poses, seed, noise_px=0.2)[-3:]])


@case(CASES, words=TRUSTED)
def one_copy(seed: int) -> Capture:
    """One view is there twice."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([*views, replace(views[3], source="copy.png")])


@case(CASES, words=TRUSTED)
def announced_anamorphic(seed: int) -> Capture:
    """Pixels twice as high as wide, with --anamorphic."""
    return replace(pixels_far_from_square(seed), options={"anamorphic": True})


@case(CASES, words=TRUSTED)
def decentred_lens_with_p1_p2(seed: int) -> Capture:
    """A decentred lens, and the coefficients to describe it."""
    return replace(decentred_lens(seed), options={"distortion": "k1,k2,p1,p2,k3"})


@case(CASES, words=TRUSTED)
def a_lens_of_two_coefficients(seed: int) -> Capture:
    """k1 and k2 for a lens that they describe."""
    camera = Camera(CAMERA.size, CAMERA.K, [-0.21, 0.07])
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera), options={"distortion": "k1,k2"})


@case(CASES, words=TRUSTED)
def a_wide_lens(seed: int) -> Capture:
    """A lens of 113 degrees with k1..k3."""
    return Capture(see(ordinary_poses(20, seed, WIDE), seed, WIDE))


@case(CASES, words=TRUSTED)
def an_aprilgrid_seen_in_parts(seed: int) -> Capture:
    """A grid so near that parts of it leave the frame in every view."""
    poses = ordinary_poses(COUNT, seed, board=GRID, partial=True, fill=(0.8, 1.4), tilt_deg=(0.0, 45.0))
    return Capture(see(poses, seed, board=GRID), board=GRID.spec)


@case(CASES, words=TRUSTED)
def eight_careful_views(seed: int) -> Capture:
    """Few views, but well chosen."""
    return Capture(see(ordinary_poses(8, seed), seed))
