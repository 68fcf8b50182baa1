"""The Cramér-Rao bound of a rendered corner."""

from __future__ import annotations

import numpy as np
import pytest
from corner_scenes import scene
from scenes import BOARD, CAMERA

from camcal.boards.checkerboard import Checkerboard
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.synthesis.bound import corner_bound
from camcal.synthesis.scenario import Light


def test_the_bound_of_an_upright_corner_is_the_textbook_one():
    """Two blurred edges in a disc, with the integrals done by hand.

    For a contrast of 2 k and a blur s an edge gives 2 k² / (√π s) per px, and the crossing costs 4 s / √π px of it. A
    shift along x brightens above and darkens below (or the reverse): 4 (R² - s²)² / (π R⁴ / 4) of that, in units of k²,
    cannot be told from a slope of the light along y.
    """
    camera = Camera((201, 201), [[4000, 0, 100.3], [0, 4000, 100.2], [0, 0, 1]])
    board = Checkerboard(3, 3, 0.05)
    pose = Pose(np.eye(3), [-0.05, -0.05, 4.0])
    blur, R, noise = 1.2, 20.0, 2.0
    s, k = np.sqrt(blur**2 + 1 / 12), 0.5 * (0.8 - 0.2) * 255
    edges = 2 / (np.sqrt(np.pi) * s) * (2 * R - 4 * s / np.sqrt(np.pi))
    slope = 4 * (R**2 - s**2) ** 2 / (np.pi * R**4 / 4)
    light = Light(white=0.8, black=0.2)
    bound = corner_bound(camera, board, pose, light, blur_sigma_px=blur, noise_levels=noise, radius_px=R)
    # The rim of the disc cuts each end of an edge up to half a pixel early or late: 1 px of 40.
    assert bound[4] == pytest.approx(noise / (k * np.sqrt(edges - slope)), rel=0.025)


def test_the_bound_scales():
    """Linear in the noise, and smaller for a larger patch and for less blur."""
    view = scene(0)

    def bound(blur=0.7, noise=2.0, radius=8.0):
        return corner_bound(CAMERA, BOARD, view.pose, blur_sigma_px=blur, noise_levels=noise, radius_px=radius)

    assert bound(noise=4.0) == pytest.approx(2 * bound())
    assert (bound(radius=11.0) < bound()).all()
    assert (bound(blur=0.5) < bound()).all()


def test_corners_at_the_border_have_no_bound():
    """A disc that leaves the image gives NaN, and only that."""
    view = scene(0)
    inside = view.corners_px[:, 0] < view.corners_px[:, 0].mean()
    room = np.minimum(view.corners_px, np.array(CAMERA.size) - 1 - view.corners_px).min(axis=1)
    radius = np.where(inside, 8.0, room + 2)
    bound = corner_bound(CAMERA, BOARD, view.pose, blur_sigma_px=0.7, noise_levels=2, radius_px=np.minimum(radius, 400))
    small = np.minimum(radius, 400) < room - 1
    assert np.array_equal(np.isfinite(bound).all(axis=1), small)
