"""The corner model: its special functions, its derivatives, and that it looks like a rendered corner."""

from __future__ import annotations

from math import asin, erf, pi, sqrt

import numpy as np
import pytest

from camcal.boards.checkerboard import Checkerboard
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.refinement.blurred_steps import normal_step, product_excess, product_excess_slopes
from camcal.refinement.corner_model import (
    ALL_FREE,
    ANGLE_1,
    ANGLE_2,
    GAIN,
    LOG_BLUR,
    OFFSET,
    SHAPE_KNOWN,
    Corners,
    jacobian_and_residual,
    sample_patches,
)
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light

STEPS = [3e-3, 3e-3, 3e-3, 1, 1, 1e-4, 1e-4, 1e-2, 1e-2, 3e-3, 1e-3, 1e-3, 1e-4, 1e-4]


def disc(radius):
    """Offsets of the pixels of a disc's square, nearest first."""
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    order = np.argsort((x * x + y * y).ravel(), kind="stable")
    return x.ravel()[order], y.ravel()[order]


def test_the_step_is_the_error_function():
    """Both sides of zero, against math.erf; half a millionth is what 32 bits leave."""
    a = np.linspace(-7, 7, 2001, dtype=np.float32)
    step, density = normal_step(a)
    exact = np.array([erf(v / sqrt(2)) for v in a.tolist()])
    assert np.abs(step - exact).max() < 1e-6
    assert np.abs(density - np.exp(-(a.astype(float) ** 2) / 2) / sqrt(2 * pi)).max() < 1e-6


@pytest.mark.parametrize("rho", [-0.8, -0.3, 0.0, 0.5, 0.8])
def test_the_product_at_the_corner_follows_the_arcsine_law(rho):
    """At the corner itself the mean product of the two signs is (2 / π) asin ρ (Sheppard 1899)."""
    zero = np.zeros((1, 1), dtype=np.float32)
    assert product_excess(zero, zero, np.array([rho]))[0, 0] == pytest.approx(2 / pi * asin(rho), abs=2e-6)


def test_the_product_agrees_with_sampled_signs():
    """Away from the corner, against the mean product of signs on a fine grid of the bivariate normal."""
    rho, a, b = 0.6, 0.7, -0.4
    u = np.linspace(-6, 6, 1201)
    x, z = np.meshgrid(u, u, indexing="ij")
    y = rho * x + sqrt(1 - rho**2) * z
    weight = np.exp(-(x**2 + z**2) / 2)
    mean = (np.sign(a - x) * np.sign(b - y) * weight).sum() / weight.sum()
    one, other = np.float32([[a]]), np.float32([[b]])
    ours = erf(a / sqrt(2)) * erf(b / sqrt(2)) + product_excess(one, other, np.array([rho]))[0, 0]
    assert ours == pytest.approx(mean, abs=5e-3)  # the grid cuts its cells at the edges: half a step of 0.01 in density 0.4


def test_the_slopes_of_the_product():
    """Against differences of the product itself."""
    rng = np.random.default_rng(0)
    a, b = (rng.normal(size=(3, 40)).astype(np.float32) for _ in range(2))
    rho, h = np.array([-0.6, 0.2, 0.7]), np.float32(1e-2)
    by_a, by_b = product_excess_slopes(a, b, rho)
    assert np.abs((product_excess(a + h, b, rho) - product_excess(a - h, b, rho)) / (2 * h) - by_a).max() < 2e-4
    assert np.abs((product_excess(a, b + h, rho) - product_excess(a, b - h, rho)) / (2 * h) - by_b).max() < 2e-4


def test_the_jacobian_agrees_with_differences():
    """Saddles and an L-corner, bent, sharpened, gamma; the angles' effect on the correlation is left out on purpose."""
    x, y = disc(9)
    gray = np.random.default_rng(0).integers(0, 255, (50, 60)).astype(np.uint8)
    centre = np.array([[20, 20], [25, 22], [30, 30]])
    patches = sample_patches(gray, centre, x, y, np.ones((3, x.size), np.float32))
    params = np.array(
        [
            [0.1, 0.2, np.log(0.8), 100, 80, 0.002, 0.001, 0.03, 0.02, 0.1, 0.2, 1.9, 0.001, -0.001],
            [0.4, -0.2, np.log(1.2), 100, 80, 0.002, 0.001, -0.3, 0.2, -0.2, 0.8, 2.0, 0.001, -0.001],
            [0.3, 0.2, np.log(0.5), 90, 60, 0, 0, -0.7, -0.2, 0.3, 0.3, 1.57, 0, 0],
        ]
    )
    mix = np.array([[0, 0, 1, 0], [0.5, -0.5, 0.5, 0.5], [0, 0, -1, 0]])

    def at(values):
        corners = Corners(values, np.full((3, 2), 1e-5), np.full((3, 2), 1e-6), mix)
        return jacobian_and_residual(patches, corners, ALL_FREE).astype(float)

    J = at(params)
    for column, h in enumerate(STEPS):
        shift = np.zeros(ALL_FREE)
        shift[column] = h
        numeric = (at(params - shift)[:, -1] - at(params + shift)[:, -1]) / (2 * h)
        off = np.abs(numeric - J[:, column]).max(axis=1) / np.abs(J[:, column]).max(axis=1)
        assert (off < (0.1 if column in (ANGLE_1, ANGLE_2) else 0.01)).all(), column


@pytest.mark.parametrize(("blur", "tolerance"), [(0.5, 2e-3), (0.7, 5e-4), (1.5, 2e-4)])
def test_the_model_looks_like_a_rendered_corner(blur, tolerance):
    """A tilted pinhole view of a corner, rendered by tracing outlines: gain 1 apart, no level differs by more than this."""
    camera = Camera((81, 81), [[2000, 0, 40.3], [0, 2000, 39.8], [0, 0, 1]])
    board = Checkerboard(3, 3, 0.05)
    pose = Pose.from_rvec([0.5, 0.3, 0.4], [0, 0, 2.0]) @ Pose(np.eye(3), [-0.05, -0.05, 0])
    image = render_ideal(camera, board, pose, Light(white=1, black=-1), blur_sigma_px=blur)
    X = pose.apply(board.object_points[4])
    corner, d_point, _ = camera.project_with_jacobians(X)
    tangents = d_point @ pose.R[:, :2]
    x, y = disc(10)
    centre = np.rint(corner).astype(int)[None]
    patches = sample_patches(image, centre, x, y, np.ones((1, x.size), np.float32))
    params = np.zeros((1, ALL_FREE))
    params[0, :2] = corner - centre[0]
    params[0, LOG_BLUR], params[0, OFFSET], params[0, GAIN] = 0.5 * np.log(blur**2 + 1 / 12), 0, 1
    params[0, ANGLE_1 : ANGLE_2 + 1] = np.arctan2(tangents[1], tangents[0])
    straight = np.zeros((1, 2))
    best = min(
        np.abs(
            jacobian_and_residual(patches, Corners(params, straight, straight, np.array([[0, 0, sign, 0]])), SHAPE_KNOWN)[0, -1]
        ).max()
        for sign in (1.0, -1.0)
    )
    # Twice the tolerance: the levels run from -1 to 1.
    assert best < 2 * tolerance
