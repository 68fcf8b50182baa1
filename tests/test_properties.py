"""Laws that hold for every input hypothesis can think of."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from camcal.geometry.camera import Camera
from camcal.geometry.distortion import BrownConrady
from camcal.geometry.homography import apply_homography, homography_from_points
from camcal.geometry.pose import Pose, rotation_from_rvec, rvec_from_rotation

EPS = np.finfo(np.float64).eps
repeatable = settings(deadline=None, derandomize=True, max_examples=200)


def between(low: float, high: float) -> st.SearchStrategy[float]:
    """Floats of an interval."""
    return st.floats(low, high, allow_nan=False, allow_subnormal=False)


def removable_pole(lens: BrownConrady) -> bool:
    """Whether numerator and denominator vanish together: a lens only on paper, which hypothesis likes to draw."""
    k1, k2, _, _, k3, k4, k5, k6 = lens.coefficients
    s = lens.valid_radius**2 if lens.valid_radius < 1e6 else 0.0
    return abs(1 + s * (k1 + s * (k2 + s * k3))) < 1e-6 and abs(1 + s * (k4 + s * (k5 + s * k6))) < 1e-6


vectors = st.tuples(between(-1, 1), between(-1, 1), between(-1, 1)).map(np.array)
translations = vectors.map(lambda v: 10 * v)
rvecs = st.builds(
    lambda v, angle: v / np.linalg.norm(v) * angle, vectors.filter(lambda v: np.linalg.norm(v) > 1e-3), between(0, np.pi)
)
poses = st.builds(Pose.from_rvec, rvecs, translations)
radial = st.tuples(between(-0.6, 0.6), between(-0.4, 0.4), between(-0.2, 0.2))
lenses = st.builds(
    lambda k, p, d: BrownConrady([k[0], k[1], p[0], p[1], k[2], *d]),
    radial,
    st.one_of(st.just((0.0, 0.0)), st.tuples(between(-0.02, 0.02), between(-0.02, 0.02))),
    st.one_of(st.just((0.0, 0.0, 0.0)), st.tuples(between(-0.3, 0.5), between(-0.1, 0.2), between(-0.05, 0.1))),
).filter(lambda lens: not removable_pole(lens))
cameras = st.builds(
    lambda fx, fy, cx, cy, skew, lens: Camera((1280, 960), [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], lens),
    between(400, 2500),
    between(400, 2500),
    between(0, 1280),
    between(0, 960),
    between(-50, 50),
    lenses,
)
pixels = st.tuples(between(-500, 1800), between(-500, 1500)).map(np.array)


@repeatable
@given(cameras, pixels)
def test_a_pixel_with_a_ray_is_where_the_ray_lands(camera: Camera, pixel: np.ndarray) -> None:
    """project(unproject(q)) = q to 1e-9 px, or NaN both ways; within the valid radius always the former."""
    ray = camera.unproject(pixel)
    again = camera.project(ray)
    assert np.isfinite(ray).all() == np.isfinite(again).all()
    if np.isfinite(ray).all():
        assert np.abs(again - pixel).max() <= 1e-9
    else:
        assert np.linalg.norm(pixel - camera.K[:2, 2]) >= camera.valid_radius_px * (1 - 1e-4)


@repeatable
@given(cameras, pixels, between(0.1, 100))
def test_depth_along_a_ray_does_not_matter(camera: Camera, pixel: np.ndarray, depth: float) -> None:
    """The same ray at any depth lands on the same pixel, but for the rounding of the division."""
    ray = camera.unproject(pixel)
    assume(np.isfinite(ray).all() and np.linalg.norm(ray[:2]) < 0.999 * camera.lens.valid_radius)
    steepest = np.linalg.norm(camera.project_with_jacobians(ray)[1], 2)
    moved = np.abs(camera.project(depth * ray) - pixel).max()
    assert moved <= 1e-9 + 4 * EPS * steepest * np.linalg.norm(ray)


@repeatable
@given(lenses, between(0, 2 * np.pi), between(0, 1))
def test_undistort_undoes_distort(lens: BrownConrady, direction: float, share: float) -> None:
    """A valid point comes back, to rounding over how hard the lens squeezes there; an invalid one has no image."""
    radius = share * min(1.2 * lens.valid_radius, 3.0)
    point = radius * np.array([np.cos(direction), np.sin(direction)])
    goal = lens.distort(point)
    assert np.isfinite(goal).all() == lens.is_valid(point)
    assume(np.isfinite(goal).all() and np.abs(goal).max() < 100)
    found = lens.undistort(goal)
    np.testing.assert_allclose(lens.distort(found), goal, rtol=0, atol=5e-13 * max(1, np.abs(goal).max()))
    weakest = np.abs(np.linalg.eigvalsh(lens.jacobian_points(point))).min()
    if weakest > 1e-3:
        # Two roots of the same goal lie farther apart than this: the quadratic term needs weakest / curvature to turn.
        np.testing.assert_allclose(found, point, rtol=0, atol=1e-12 * max(1, np.abs(goal).max()) / weakest)


@repeatable
@given(lenses, between(0, 2 * np.pi))
def test_the_valid_radius_is_valid(lens: BrownConrady, direction: float) -> None:
    """No direction folds before it, and the points just inside it distort and come back."""
    assume(lens.valid_radius < 1e6)
    point = lens.valid_radius * (1 - 1e-4) * np.array([np.cos(direction), np.sin(direction)])
    assert lens.is_valid(point)
    assert np.linalg.det(lens.jacobian_points(point)) > 0


@repeatable
@given(poses, vectors)
def test_a_pose_times_its_inverse_is_nothing(T: Pose, point: np.ndarray) -> None:
    """T T⁻¹ = T⁻¹ T = identity, to the rounding of entries up to 10."""
    for both in (T @ T.inverse(), T.inverse() @ T):
        np.testing.assert_allclose(both.R, np.eye(3), rtol=0, atol=16 * EPS)
        np.testing.assert_allclose(both.t, 0, rtol=0, atol=16 * EPS * 10 * 3)
    np.testing.assert_allclose(T.inverse().apply(T.apply(point)), point, rtol=0, atol=16 * EPS * 10 * 3)


@repeatable
@given(poses, poses, vectors)
def test_composing_is_applying_in_turn(T_a_b: Pose, T_b_c: Pose, point: np.ndarray) -> None:
    """(T_a_b T_b_c) X = T_a_b (T_b_c X)."""
    np.testing.assert_allclose((T_a_b @ T_b_c).apply(point), T_a_b.apply(T_b_c.apply(point)), rtol=0, atol=16 * EPS * 20 * 3)


@repeatable
@given(rvecs)
def test_rotation_vector_and_matrix_are_one(rvec: np.ndarray) -> None:
    """R is a rotation, and its vector gives R again whatever the angle."""
    R = rotation_from_rvec(rvec)
    np.testing.assert_allclose(R @ R.T, np.eye(3), rtol=0, atol=16 * EPS)
    again = rvec_from_rotation(R)
    assert np.linalg.norm(again) <= np.pi * (1 + EPS)
    np.testing.assert_allclose(rotation_from_rvec(again), R, rtol=0, atol=16 * EPS)
    if np.linalg.norm(rvec) < np.pi - 1e-6:
        np.testing.assert_allclose(again, rvec, rtol=0, atol=16 * EPS)


@repeatable
@given(cameras, st.integers(1, 4000), st.integers(1, 4000))
def test_scaling_there_and_back_is_nothing(camera: Camera, width: int, height: int) -> None:
    """Scaled to another size and back, K is the same to rounding at the larger of the two scales."""
    again = camera.scaled((width, height)).scaled(camera.size)
    assert again.size == camera.size
    magnification = max(1, camera.size[0] / width, camera.size[1] / height)
    np.testing.assert_allclose(again.K, camera.K, rtol=8 * EPS, atol=8 * EPS * magnification)


@repeatable
@given(cameras, st.integers(100, 4000), st.integers(100, 4000), pixels)
def test_scaling_moves_every_ray_with_its_pixel(camera: Camera, width: int, height: int, pixel: np.ndarray) -> None:
    """(q + 0.5) s - 0.5 in the scaled camera sees what q saw."""
    ray = camera.unproject(pixel)
    assume(np.isfinite(ray).all() and np.linalg.norm(ray[:2]) < 0.99 * camera.lens.valid_radius)
    s = np.array([width, height]) / camera.size
    np.testing.assert_allclose(
        camera.scaled((width, height)).project(ray), (pixel + 0.5) * s - 0.5, rtol=0, atol=1e-9 * max(1, *s)
    )


@repeatable
@given(st.tuples(*[between(-0.2, 0.2)] * 8))
def test_homography_from_points_finds_the_homography(bend: tuple[float, ...]) -> None:
    """A bent identity, from a 4 x 3 grid of its own images."""
    H = np.eye(3) + np.reshape([*bend, 0], (3, 3))
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 4), np.linspace(-1, 1, 3)), axis=-1).reshape(-1, 2)
    found = homography_from_points(grid, apply_homography(H, grid))
    np.testing.assert_allclose(found / found[2, 2], H, rtol=0, atol=1e-12)
