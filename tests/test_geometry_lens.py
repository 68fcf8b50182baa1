"""The lens: exact up to its fold, NaN past it, Jacobians that are derivatives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.distortion import BrownConrady, Lens

EPS = np.finfo(np.float64).eps
# (1 - r²) (1 - r² / 4): it turns back at 1 and forwards again at 2, where its values look plausible once more.
TWICE = [-1.25 / 3, 0.05]
LENSES = {
    "strong barrel": [-0.38],
    "webcam": [-0.28, 0.09, 0, 0, -0.012],
    "wide": [-0.25, 0.06, 0, 0, -0.006],
    "pincushion": [0.2, 0.05, 0, 0, 0.01],
    "mustache": [-0.3, 0.2, 0, 0, -0.03],
    "turns twice": TWICE,
    "tangential": [-0.28, 0.09, 1e-3, -2e-3, -0.012],
    "strongly tangential": [-0.3, 0.1, 0.03, -0.02, -0.01],
    "turns twice, tangential": [*TWICE, 1e-3, 2e-3],
    "only tangential": [0, 0, 0.02, 0.01],
    "rational": [0.5, -0.2, 0, 0, 0.01, 0.8, -0.1, 0.02],
    "rational, tangential": [0.5, -0.2, 1e-4, 2e-4, 0.01, 0.8, -0.1, 0.02],
    "rational with a pole": [0, 0, 0, 0, 0, -0.25],
    "phone": [0.09, -0.25, 2e-4, -3e-4, 0.2],
}
each_lens = pytest.mark.parametrize("dist", LENSES.values(), ids=LENSES.keys())


def determinant(lens: Lens, points: FloatArray) -> FloatArray:
    """Determinant of the lens's Jacobian."""
    return np.linalg.det(lens.jacobian_points(points))


def camera_with(dist: list[float]) -> Camera:
    """A 1280 x 960 camera with a field of view that reaches past most folds."""
    return Camera((1280, 960), [[700, 0, 655], [0, 690, 470], [0, 0, 1]], dist)


def edge_of_validity(lens: BrownConrady, directions: FloatArray, beyond: float) -> FloatArray:
    """Largest radius in each direction (N, 2) at which `is_valid` says yes, found by bisection below `beyond`."""
    low, high = np.zeros(len(directions)), np.full(len(directions), beyond)
    for _ in range(60):
        middle = (low + high) / 2
        valid = lens.is_valid(middle[:, None] * directions)
        low, high = np.where(valid, middle, low), np.where(valid, high, middle)
    return low


@each_lens
def test_every_pixel_comes_back_or_is_nan(dist: list[float]) -> None:
    """|project(unproject(q)) - q| is below 1e-9 px over the image and around it, and NaN at the same places."""
    camera = camera_with(dist)
    pixels = np.stack(np.meshgrid(np.linspace(-700, 2000, 271), np.linspace(-700, 1700, 241)), axis=-1)
    rays = camera.unproject(pixels)
    again = camera.project(rays)
    known = np.isfinite(rays).all(axis=-1)
    assert known[np.linalg.norm(pixels - camera.K[:2, 2], axis=-1) < 300].all()
    assert (rays[known][:, 2] == 1).all()
    assert np.isnan(rays[~known]).all()
    assert np.isnan(again[~known]).all()
    assert np.abs(again - pixels)[known].max() <= 1e-9


@each_lens
def test_undistort_reaches_every_valid_point_up_to_the_fold(dist: list[float]) -> None:
    """Points at relative distances of 0.1 to 1e-14 from the fold are found again: to 1e-12 in the image."""
    lens = BrownConrady(dist)
    turn = np.linspace(0, 2 * np.pi, 360, endpoint=False) + 0.003
    directions = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    edge = np.minimum(edge_of_validity(lens, directions, 50.0), 3.0)
    for distance in (0.5, 0.1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14):
        goal = lens.distort((edge * (1 - distance))[:, None] * directions)
        reachable = np.abs(goal).max(axis=1) < 500  # hard by a pole rounding alone exceeds any promise
        assert reachable.any() or distance < 1e-2
        again = lens.distort(lens.undistort(goal[reachable]))
        np.testing.assert_allclose(again, goal[reachable], rtol=0, atol=1e-12 * max(1, np.abs(goal[reachable]).max(initial=0)))


@each_lens
def test_undistort_finds_the_very_point_away_from_the_fold(dist: list[float]) -> None:
    """Within 0.8 of the fold the point itself comes back, to rounding times the conditioning of the inverse."""
    lens = BrownConrady(dist)
    rng = np.random.default_rng(1)
    direction = rng.uniform(0, 2 * np.pi, 2000)
    radius = rng.uniform(0, 0.8, 2000) * min(lens.valid_radius, 3)
    points = np.stack([radius * np.cos(direction), radius * np.sin(direction)], axis=-1)
    found = lens.undistort(lens.distort(points))
    weakest = np.abs(np.linalg.eigvalsh(lens.jacobian_points(points))).min(axis=1, keepdims=True)
    assert (np.abs(found - points) <= 1e-13 * (1 + np.abs(points).max()) / weakest).all()


@each_lens
def test_valid_means_a_positive_determinant_all_the_way(dist: list[float]) -> None:
    """`is_valid` agrees with following the determinant's sign along the ray in 2000 steps, which no table knows of."""
    lens = BrownConrady(dist)
    rng = np.random.default_rng(2)
    points = rng.uniform(-4, 4, (1000, 2))
    steps = np.linspace(0, 1, 2001)[1:, None, None]
    along = steps * points
    s = (along**2).sum(axis=-1)
    _, _, _, _, _, k4, k5, k6 = lens.coefficients
    positive = (determinant(lens, along) > 0) & (1 + s * (k4 + s * (k5 + s * k6)) > 0)
    expected = positive.all(axis=0)
    assert (lens.is_valid(points) == expected).all()
    assert (np.isfinite(lens.distort(points)).all(axis=-1) == expected).all()
    assert np.isnan(lens.distort(points)[~expected]).all()


@each_lens
def test_the_fold_is_where_the_determinant_changes_sign(dist: list[float]) -> None:
    """Just inside the edge of validity the determinant is positive, just outside it is not (or the pole is crossed)."""
    lens = BrownConrady(dist)
    turn = np.linspace(0, 2 * np.pi, 1000, endpoint=False) + 1e-3
    directions = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    edge = edge_of_validity(lens, directions, 50.0)
    assert edge.min() >= min(lens.valid_radius * (1 - 1e-9), 49.9)
    folded = edge < 49
    assert folded.any() == (lens.valid_radius < 49)
    inner = (edge * (1 - 1e-9))[folded, None] * directions[folded]
    outer = (edge * (1 + 1e-9))[folded, None] * directions[folded]
    assert (determinant(lens, inner) > 0).all()
    assert (determinant(lens, outer) < 0).all()


def test_past_a_second_turn_nothing_plausible_comes_out() -> None:
    """Between and beyond the two turns at 1 and 2 the bare formula gives ordinary values; the lens says NaN."""
    for dist in (TWICE, [*TWICE, 1e-6, 0], [*TWICE, 1e-3, 2e-3]):
        lens = BrownConrady(dist)
        past = np.array([[1.1, 0], [0, 1.5], [-2.5, 0], [0, -3.0], [2.0, 2.0]])
        assert np.abs(lens.distort_unchecked(past)).max() < 5
        assert np.isnan(lens.distort(past)).all()
        # The largest value before the turn is 0.633; everything farther out has no ray, though r = 2.5..3 maps there.
        assert np.isnan(lens.undistort([[0.66, 0], [0, -0.8], [3.9, 0]])).all()
        assert np.isfinite(lens.undistort([[0.62, 0], [0, -0.62]])).all()


@pytest.mark.parametrize("tangential", [(0, 0), (1e-6, 0), (1e-5, -2e-5)])
def test_two_turns_close_together_are_told_apart(tangential: tuple[float, float]) -> None:
    """(1 - r²) (1 - r² / 1.05) turns at 1 and at 1.0247: what lies up to 10 % beyond is past the fold all the same."""
    lens = BrownConrady([-(1 + 1 / 1.05) / 3, 1 / 1.05 / 5, *tangential])
    angle = np.linspace(0, 2 * np.pi, 100)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    assert np.isfinite(lens.distort(0.99 * ring)).all()
    for radius in (1.01, 1.02, 1.026, 1.04, 1.1):
        assert np.isnan(lens.distort(radius * ring)).all()


def test_the_fold_itself_comes_back() -> None:
    """A goal exactly at the farthest reach, in any direction, has its ray, and the ray lands where it came from."""
    for k1 in np.linspace(-0.6, -0.05, 50):
        lens = BrownConrady([k1])
        angle = np.linspace(0, 2 * np.pi, 300)
        goal = lens.valid_radius_distorted * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        np.testing.assert_allclose(lens.distort(lens.undistort(goal)), goal, rtol=0, atol=1e-14 * (1 + lens.valid_radius))


def test_the_far_side_of_a_pole_is_nan() -> None:
    """With r / (1 - r² / 4) values come back from minus infinity past r = 2; every pixel has a ray before it."""
    lens = BrownConrady([0, 0, 0, 0, 0, -0.25])
    assert np.isnan(lens.distort([[2.5, 0], [0, 3]])).all()
    # 100 (1 - r² / 4) = r: r = (-1 + sqrt(1 + 100²)) / 50
    found = lens.undistort([100.0, 0])
    assert found[0] == pytest.approx((-1 + np.sqrt(10001)) / 50, rel=1e-13)


def test_a_lens_that_turns_back_inside_the_image_says_so() -> None:
    """k1 = -0.38 turns at 0.624 normalised, 431 px of 690: inside, rays; outside, NaN; the corner sees nothing."""
    camera = camera_with([-0.38])
    assert camera.valid_radius_px == pytest.approx(690 * 2 / 3 / np.sqrt(1.14), rel=1e-13)
    angle = np.linspace(0, 2 * np.pi, 100)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    assert np.isfinite(camera.unproject(camera.K[:2, 2] + (camera.valid_radius_px - 1e-6) * ring)).all()
    assert np.isnan(camera.unproject([[0, 0], [1279, 959]])).all()
    assert np.isnan(camera.field_of_view_deg[2])


@pytest.mark.parametrize("dist", [[0, 0, 0.02, 0.01], [-0.3, 0.1, 0.03, -0.02, -0.01], [-0.38, 0, 0.01, 0.02]])
def test_every_point_within_the_distorted_valid_radius_has_a_ray(dist: list[float]) -> None:
    """The reported radius is the largest such circle, with tangential terms too: 0.1 % more is too much."""
    lens = BrownConrady(dist)
    angle = np.linspace(0, 2 * np.pi, 3601)
    ring = lens.valid_radius_distorted * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    assert np.isfinite(lens.undistort(ring * (1 - 1e-5))).all()
    assert np.isnan(lens.undistort(ring * 1.001)).any()


@each_lens
def test_jacobian_by_the_point_is_the_derivative(dist: list[float]) -> None:
    """Against central differences, within their own error."""
    lens = BrownConrady(dist)
    points = np.random.default_rng(3).uniform(-0.7, 0.7, (50, 2))
    jacobian = lens.jacobian_points(points)
    for axis in range(2):
        step = np.eye(2)[axis]
        assert_derivative(lambda h, step=step: lens.distort_unchecked(points + h * step), jacobian[..., axis])
    np.testing.assert_array_equal(jacobian[..., 0, 1], jacobian[..., 1, 0])


@each_lens
def test_jacobian_by_the_coefficients_is_the_derivative(dist: list[float]) -> None:
    """Each of the eight against central differences, within their own error."""
    lens = BrownConrady(dist)
    points = np.random.default_rng(4).uniform(-0.7, 0.7, (50, 2))
    jacobian = lens.jacobian_coefficients(points)
    for index in range(8):
        step = np.eye(8)[index]
        assert_derivative(
            lambda h, step=step: lens.with_coefficients(lens.coefficients + h * step).distort_unchecked(points),
            jacobian[..., index],
        )


def assert_derivative(function: Callable[[float], FloatArray], derivative: FloatArray) -> None:
    """Compare with central differences: their truncation error is a third of how much they change when h doubles."""
    h = EPS ** (1 / 3)
    fine = (function(h) - function(-h)) / (2 * h)
    coarse = (function(2 * h) - function(-2 * h)) / (4 * h)
    rounding = 32 * EPS * np.abs(function(0.0)).max() / h
    assert (np.abs(fine - derivative) <= np.abs(fine - coarse) + rounding).all()


@pytest.mark.parametrize("dist", [[], [-0.3, 0.1], [-0.3, 0.1, 1e-3, 1e-3], [0.5, 0, 1e-3, 0, 0, 0.4]])
def test_shapes_and_nan_are_kept(dist: list[float]) -> None:
    """One point, none at all, grids, NaN and infinite ones: shapes stay, only what is not finite is NaN."""
    lens = BrownConrady(dist)
    for function in (lens.distort, lens.undistort):
        assert function([0.1, 0.2]).shape == (2,)
        assert function(np.zeros((0, 2))).shape == (0, 2)
        assert function(np.zeros((3, 0, 2))).shape == (3, 0, 2)
        assert function(np.full((3, 4, 2), 0.1)).shape == (3, 4, 2)
        assert function([0, 0]).tolist() == [0, 0]
        mixed = function([[np.nan, 0.1], [0.1, 0.2]])
        assert np.isnan(mixed[0]).any()
        assert np.isfinite(mixed[1]).all()
        far = function([[np.inf, 0.0], [1e300, -1e300]])
        assert not dist or np.isnan(far).all()
    assert lens.is_valid([[np.nan, 0], [0.1, 0]]).tolist() == [False, True]
    assert lens.is_valid([0.1, 0]).shape == ()
    assert lens.jacobian_points(np.zeros((0, 2))).shape == (0, 2, 2)
    assert lens.jacobian_coefficients(np.zeros((0, 2))).shape == (0, 2, 8)


def test_many_points_are_the_same_as_few() -> None:
    """Blocks leave no seam: 200,000 points at once equal the same points one slice at a time."""
    lens = BrownConrady([-0.28, 0.09, 1e-3, -2e-3, -0.012])
    points = np.random.default_rng(5).uniform(-0.9, 0.9, (200_000, 2))
    whole = lens.undistort(lens.distort(points))
    parts = np.concatenate([lens.undistort(lens.distort(part)) for part in np.array_split(points, 7)])
    np.testing.assert_array_equal(whole, parts)
    np.testing.assert_array_equal(lens.distort(points), np.concatenate([lens.distort(p) for p in np.array_split(points, 7)]))


@pytest.mark.parametrize(
    "dist",
    [
        [1e15],
        [-1e15, 1e15, 1e15, 1e15, -1e15, 1e15, 1e15, -1e15],
        [1e-300],
        [-1e-12, 0, 1e-15, 0],
        [0.1, 0.1, 0, 0, 0.1, 0.1, 0.1, 0.1],
        [-0.1, 0.1, 1e-3, 0, 0.1, -0.1, 0.1, 0.1],
        [5, -3000, 0, 0, 1e6],
        [-10, 100, 1, 1, -1000, 10, -100, 1000],
    ],
)
def test_absurd_lenses_end_in_nan_or_the_truth(dist: list[float]) -> None:
    """No exception, no warning: what comes back finite maps onto its goal."""
    lens = BrownConrady(dist)
    goal = np.random.default_rng(6).uniform(-1, 1, (500, 2)) * min(1.0, 10 * lens.valid_radius)
    found = lens.undistort(goal)
    again = lens.distort(found)
    known = np.isfinite(found).all(axis=1)
    assert (np.isfinite(again).all(axis=1) == known).all()
    assert np.abs(again - goal)[known].max(initial=0) <= 1e-12
    assert lens.undistort([0, 0]).tolist() == [0, 0]


@pytest.mark.parametrize(
    ("dist", "message"),
    [
        ([0] * 9, "too many coefficients"),
        ([np.nan], "finite"),
        ([np.inf], "finite"),
        ([1e300], "not a lens"),
    ],
)
def test_bad_coefficients_are_refused(dist: list[float], message: str) -> None:
    """Nine of them, NaN, infinity and absurd sizes are errors that say which."""
    with pytest.raises(ValueError, match=message):
        BrownConrady(dist)


def test_coefficients_are_copied_and_read_only() -> None:
    """A lens cannot be changed from outside."""
    given = np.array([0.1, 0.2])
    lens = BrownConrady(given)
    given[0] = 9
    assert lens.coefficients.tolist() == [0.1, 0.2, 0, 0, 0, 0, 0, 0]
    with pytest.raises(ValueError, match="read-only"):
        lens.coefficients[0] = 1
