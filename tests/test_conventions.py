"""The conventions, pinned by numbers worked out by hand (fx != fy, cx != cy throughout where it matters)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from camcal.geometry.camera import Camera
from camcal.geometry.distortion import BrownConrady
from camcal.geometry.homography import (
    apply_homography,
    field_of_view_deg,
    homography_from_points,
    horizon,
    plane_homography,
    vanishing_point,
)
from camcal.geometry.pose import Pose, cross_matrix, rotate_with_jacobian, rotation_from_rvec, rvec_from_rotation

K = [[100, 0, 10], [0, 200, 20], [0, 0, 1]]
# 90 degrees about the optical axis and about the camera's x axis.
QUARTER_Z = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
QUARTER_X = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
# The roundings of a handful of products of numbers up to 1000.
ROUNDING = 1e-12


def same(actual: object, expected: object) -> None:
    """Assert equality up to the roundings of a few operations."""
    np.testing.assert_allclose(actual, expected, rtol=1e-13, atol=ROUNDING)


@pytest.mark.parametrize(("point", "pixel"), [([2, 3, 10], [700, 800]), ([2, 3, 5], [900, 1100]), ([0, 0, 1], [500, 500])])
def test_project_is_focal_length_times_slope_plus_principal_point(point: list[float], pixel: list[float]) -> None:
    """1000 x 2 / 10 + 500 = 700 and 1000 x 3 / 10 + 500 = 800; at half the depth twice as far out."""
    assert Camera((1000, 1000), [[1000, 0, 500], [0, 1000, 500], [0, 0, 1]]).project(point).tolist() == pixel


def test_project_puts_a_square_where_similar_triangles_do() -> None:
    """A square of side 2 at Z = 5 with f = 800 spans 800 x 2 / 5 = 320 px about the principal point, in order."""
    camera = Camera((640, 480), [[800, 0, 320], [0, 800, 240], [0, 0, 1]])
    square = [[-1, -1, 5], [1, -1, 5], [1, 1, 5], [-1, 1, 5]]
    assert camera.project(square).tolist() == [[160, 80], [480, 80], [480, 400], [160, 400]]


def test_x_is_right_and_y_is_down_and_the_axes_keep_their_own_scale() -> None:
    """100 x 1 + 10 = 110 across and 200 x 2 + 20 = 420 down; the pixel's ray is the point at unit depth."""
    camera = Camera((400, 600), K)
    assert camera.project([1, 2, 1]).tolist() == [110, 420]
    assert camera.unproject([110, 420]).tolist() == [1, 2, 1]


def test_identity_shows_the_board_upright_and_unmirrored() -> None:
    """With R = I a board's x grows to the right of the image, its y grows downwards."""
    board = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    origin, along_x, along_y = Camera((400, 600), K).project(Pose(np.eye(3), [0, 0, 2]).apply(board))
    assert origin.tolist() == [10, 20]
    assert along_x.tolist() == [60, 20]
    assert along_y.tolist() == [10, 120]


def test_skew_moves_x_by_y() -> None:
    """X = 100 x 1 + 5 x 2 + 10 = 120, while y stays 200 x 2 + 20 = 420; and back."""
    camera = Camera((400, 600), [[100, 5, 10], [0, 200, 20], [0, 0, 1]])
    assert camera.project([1, 2, 1]).tolist() == [120, 420]
    assert camera.unproject([120, 420]).tolist() == [1, 2, 1]


def test_scaling_keeps_pixel_centres_at_whole_numbers() -> None:
    """Half size: c' = (c + 0.5) / 2 - 0.5, so 319.5 -> 159.5 and 200 -> 99.75; and the lens stays."""
    camera = Camera((640, 480), [[600, 4, 319.5], [0, 500, 200], [0, 0, 1]], [-0.1]).scaled((320, 240))
    assert camera.size == (320, 240)
    assert camera.K.tolist() == [[300, 2, 159.5], [0, 250, 99.75], [0, 0, 1]]
    assert camera.dist[0] == -0.1


def test_scaling_each_axis_on_its_own() -> None:
    """Doubling the width alone scales fx, skew and cx: (9.5 + 0.5) x 2 - 0.5 = 19.5."""
    camera = Camera((20, 10), [[100, 3, 9.5], [0, 200, 4.5], [0, 0, 1]]).scaled((40, 10))
    assert camera.K.tolist() == [[200, 6, 19.5], [0, 200, 4.5], [0, 0, 1]]


def test_image_reaches_half_a_pixel_beyond_the_outer_centres() -> None:
    """The centre of the top-left pixel is (0, 0), so a 4 x 3 image spans -0.5..3.5 by -0.5..2.5."""
    camera = Camera((4, 3), K)
    points = [[0, 0], [-0.5, -0.5], [3.5, 2.5], [-0.6, 0], [3.6, 0], [0, 2.6], [math.nan, 0]]
    assert camera.contains(points).tolist() == [True, True, True, False, False, False, False]
    assert camera.contains([[0.4, 1], [0.5, 1]], margin_px=1).tolist() == [False, True]


def test_distortion_formula() -> None:
    """At (1, 2), r² = 5: gain 1 + .5 + .25 + .125 = 1.875; tangential (.04 + .14, .13 + .08) = (.18, .21)."""
    lens = BrownConrady([0.1, 0.01, 0.01, 0.02, 0.001])
    same(lens.distort([1, 2]), [1.875 + 0.18, 3.75 + 0.21])
    same(lens.undistort([2.055, 3.96]), [1, 2])
    same(lens.distort_unchecked([1, 2]), [2.055, 3.96])
    camera = Camera((400, 900), [[100, 10, 10], [0, 200, 20], [0, 0, 1]], lens)
    same(camera.project([2, 4, 2]), [205.5 + 39.6 + 10, 792 + 20])


def test_rational_distortion_formula() -> None:
    """The denominator 1 + .5 + .5 + .5 = 2.5 divides the radial gain only: 1.875 / 2.5 = .75."""
    lens = BrownConrady([0.1, 0.01, 0.01, 0.02, 0.001, 0.1, 0.02, 0.004])
    same(lens.distort_unchecked([1, 2]), [0.75 + 0.18, 1.5 + 0.21])


@pytest.mark.parametrize(
    ("index", "name", "expected"),
    [
        (0, "k1", [1 + 0.005, 2 + 0.010]),
        (1, "k2", [1 + 0.025, 2 + 0.050]),
        (2, "p1", [1 + 0.004, 2 + 0.013]),
        (3, "p2", [1 + 0.007, 2 + 0.004]),
        (4, "k3", [1 + 0.125, 2 + 0.250]),
        (5, "k4", [1 / 1.005, 2 / 1.005]),
        (6, "k5", [1 / 1.025, 2 / 1.025]),
        (7, "k6", [1 / 1.125, 2 / 1.125]),
    ],
)
def test_coefficients_are_stored_in_opencv_order(index: int, name: str, expected: list[float]) -> None:
    """Each coefficient alone, .001 at (1, 2) with r² = 5; k3 comes fifth, after the tangential pair."""
    dist = np.zeros(8)
    dist[index] = 0.001
    lens = BrownConrady(dist)
    assert lens.coefficient_names[index] == name
    same(lens.distort_unchecked([1, 2]), expected)


def test_intrinsics_are_named_in_order() -> None:
    """fx, fy, cx, cy, skew, then the eight coefficients; a camera is rebuilt from them."""
    camera = Camera((40, 30), [[100, 5, 10], [0, 200, 20], [0, 0, 1]], [0.1, 0.2, 0.3, 0.4, 0.5])
    assert camera.intrinsic_names == ("fx", "fy", "cx", "cy", "skew", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    assert camera.intrinsics.tolist() == [100, 200, 10, 20, 5, 0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0]
    again = camera.with_intrinsics([101, 201, 11, 21, 6, *range(8)])
    assert again.K.tolist() == [[101, 6, 11], [0, 201, 21], [0, 0, 1]]
    assert again.dist.tolist() == list(range(8))


def test_pixels_and_normalised_coordinates() -> None:
    """K and its inverse: (0.5, 0.25) is 100 / 2 + 8 / 4 + 10 = 62 across and 200 / 4 + 20 = 70 down."""
    camera = Camera((400, 600), [[100, 8, 10], [0, 200, 20], [0, 0, 1]])
    assert camera.pixels_from_normalised([0.5, 0.25]).tolist() == [62, 70]
    assert camera.normalised_from_pixels([62, 70]).tolist() == [0.5, 0.25]


@pytest.mark.parametrize(("extent", "focal", "degrees"), [(36, 35, 54.4322), (36, 70, 28.8415), (2, 1, 90)])
def test_field_of_view_of_a_sensor(extent: float, focal: float, degrees: float) -> None:
    """A 36 mm sensor sees 2 atan(18 / 35) = 54.4 degrees behind 35 mm and 28.8 behind 70 mm."""
    assert field_of_view_deg(extent, focal) == pytest.approx(degrees, abs=5e-5)


def test_field_of_view_of_a_camera_counts_whole_pixels() -> None:
    """3600 x 2400 px behind f = 3500 px is the 36 x 24 mm sensor behind 35 mm: 54.43, 37.85 and 63.44 degrees."""
    camera = Camera((3600, 2400), [[3500, 0, 1799.5], [0, 3500, 1199.5], [0, 0, 1]])
    expected = [math.degrees(2 * math.atan(half / 35)) for half in (18, 12, math.hypot(18, 12))]
    assert camera.field_of_view_deg == pytest.approx(expected, rel=1e-12)
    assert camera.field_of_view_deg == pytest.approx([54.4322, 37.8493, 63.4400], abs=5e-5)


def test_field_of_view_with_a_lens() -> None:
    """Barrel k1 = -0.1 shows x = 0.5 at 0.4875, so an image that ends there sees 2 atan(0.5) across."""
    camera = Camera((975, 1), [[1000, 0, 487], [0, 1000, 0], [0, 0, 1]], [-0.1])
    assert camera.field_of_view_deg[0] == pytest.approx(math.degrees(2 * math.atan(0.5)), rel=1e-12)


def test_pose_maps_board_to_camera() -> None:
    """X_cam = R X + t: a quarter turn takes (1, 0, 0) to (0, 1, 0), then comes t; the way back is -Rᵀ t."""
    pose = Pose(QUARTER_Z, [1, 2, 3])
    assert pose.apply([1, 0, 0]).tolist() == [1, 3, 3]
    assert pose.inverse().t.tolist() == [-2, 1, -3]
    assert pose.inverse().apply([1, 3, 3]).tolist() == [1, 0, 0]
    assert pose.angle_deg == pytest.approx(90, abs=1e-12)


def test_poses_compose_like_their_names() -> None:
    """T_a_b @ T_b_c is T_a_c: (1, 0, 0) in c is (2, 0, 0) in b and (1, 4, 3) in a."""
    T_a_c = Pose(QUARTER_Z, [1, 2, 3]) @ Pose(np.eye(3), [1, 0, 0])
    assert T_a_c.apply([1, 0, 0]).tolist() == [1, 4, 3]
    assert Pose.identity().apply([1, 2, 3]).tolist() == [1, 2, 3]


def test_rotation_vectors_are_axis_times_radians() -> None:
    """A quarter turn about z and about x, both ways, and 120 degrees about (1, 1, 1), which permutes the axes."""
    same(rotation_from_rvec([0, 0, math.pi / 2]), QUARTER_Z)
    same(rotation_from_rvec([math.pi / 2, 0, 0]), QUARTER_X)
    same(rvec_from_rotation(QUARTER_X), [math.pi / 2, 0, 0])
    third = 2 * math.pi / 3 / math.sqrt(3)
    same(rotation_from_rvec([third] * 3), [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    same(Pose.from_rvec([third] * 3, [0, 0, 1]).rvec, [third] * 3)


def test_cross_matrix() -> None:
    """(1, 2, 3) x (4, 5, 6) = (-3, 6, -3)."""
    assert (cross_matrix([1, 2, 3]) @ [4, 5, 6]).tolist() == [-3, 6, -3]


def test_rotation_jacobian_at_rest_is_a_cross_product() -> None:
    """At rvec = 0 turning by w moves X by w x X: for X = (1, 2, 3) about x that is (0, -3, 2)."""
    rotated, jacobian = rotate_with_jacobian([0, 0, 0], [[1, 2, 3]])
    assert rotated.tolist() == [[1, 2, 3]]
    assert jacobian[0].tolist() == [[0, 3, -2], [-3, 0, 1], [2, -1, 0]]


def test_plane_homography_of_a_tilted_plane() -> None:
    """A quarter turn about x puts plane point (3, 4) at (3, 0, 4) + (0, 1, 2): u = 300 / 6 + 10, v = 200 / 6 + 20."""
    H = plane_homography(K, Pose(QUARTER_X, [0, 1, 2]))
    assert H.tolist() == [[100, 10, 20], [0, 20, 240], [0, 1, 2]]
    same(apply_homography(H, [3, 4]), [60, 20 + 100 / 3])


def test_apply_homography_refuses_what_is_behind() -> None:
    """With w = 2 + y the point y = -2 is at infinity and y = -3 behind: NaN, not a mirrored pixel."""
    H = [[1, 0, 0], [0, 1, 0], [0, 1, 2]]
    assert apply_homography(H, [2, 0]).tolist() == [1, 0]
    assert np.isnan(apply_homography(H, [[0, -2], [0, -3]])).all()


def test_vanishing_point() -> None:
    """Direction (1, 1, 2) vanishes at (100 / 2 + 10, 200 / 2 + 20); so does its opposite; (1, 0, 0) never does."""
    assert vanishing_point(K, [1, 1, 2]).tolist() == [60, 120]
    assert vanishing_point(K, [-2, -2, -4]).tolist() == [60, 120]
    assert np.isnan(vanishing_point(K, [1, 0, 0])).all()


def test_horizon_of_level_ground_runs_through_the_principal_point() -> None:
    """Ground with the normal (0, 1, 0) has its horizon at v = cy = 20, whatever fx and cx are."""
    line = horizon(K, [0, -2, 0])
    same(line / line[1], [0, 1, -20])
    assert math.hypot(line[0], line[1]) == pytest.approx(1)


def test_horizon_holds_the_vanishing_points_of_its_plane() -> None:
    """In the plane with normal (1, 1, 1), (-1, 0, 1) vanishes at (-90, 20) and (0, -1, 1) at (10, -180): slope -2."""
    line = horizon(K, [1, 1, 1])
    same(line / line[1], [2, 1, 160])
    assert np.isnan(horizon(K, [0, 0, 1])).all()


def test_homography_from_four_points() -> None:
    """The map u = x / (x + 1), v = y / (x + 1) takes the unit square to (0, 0), (1/2, 0), (0, 1), (1/2, 1/2)."""
    H = homography_from_points([[0, 0], [1, 0], [0, 1], [1, 1]], [[0, 0], [0.5, 0], [0, 1], [0.5, 0.5]])
    same(H / H[2, 2], [[1, 0, 0], [0, 1, 0], [1, 0, 1]])
    assert H[2, 2] > 0


@pytest.mark.parametrize(
    ("dist", "radius", "radius_distorted"),
    [
        ([], math.inf, math.inf),
        ([0.2, 0.1], math.inf, math.inf),
        # 1 + 3 k1 r² = 0, where x_d = (1 - 1/3) r
        ([-0.38], 1 / math.sqrt(1.14), 2 / 3 / math.sqrt(1.14)),
        # 1 + 5 k2 r⁴ = 0 at 1
        ([0, -0.2], 1, 0.8),
        # 1 + 7 k3 r⁶ = 0 at 1
        ([0, 0, 0, 0, -1 / 7], 1, 6 / 7),
        # r / (1 + r²) turns back at 1
        ([0, 0, 0, 0, 0, 1], 1, 0.5),
        # r / (1 - r² / 4) grows without bound towards its pole at 2
        ([0, 0, 0, 0, 0, -0.25], 2, math.inf),
        # (1 - r²) (1 - r² / 4) turns at 1 and back again at 2
        ([-1.25 / 3, 0.05], 1, 1 - 1.25 / 3 + 0.05),
        # y + 3 p1 y² turns at y = -1 / (6 p1), where it is half of that
        ([0, 0, 0.01, 0], 1 / 0.06, 0.5 / 0.06),
        ([0, 0, 0, -0.01], 1 / 0.06, 0.5 / 0.06),
        # along (p2, p1) = 0.05 (0.6, 0.8), the same
        ([0, 0, 0.04, 0.03], 1 / 0.3, 0.5 / 0.3),
    ],
)
def test_valid_radius(dist: list[float], radius: float, radius_distorted: float) -> None:
    """Where the lens turns back, in normalised units before and after it, solved by hand."""
    lens = BrownConrady(dist)
    assert lens.valid_radius == pytest.approx(radius, rel=1e-14)
    assert lens.valid_radius_distorted == pytest.approx(radius_distorted, rel=1e-14)


def test_valid_radius_in_pixels_is_along_the_shorter_focal_length() -> None:
    """0.8 normalised is 80 px across and 160 px down with f = (100, 200): the nearer one counts."""
    assert Camera((400, 600), K, [0, -0.2]).valid_radius_px == pytest.approx(80, rel=1e-13)
    assert Camera((400, 600), K).valid_radius_px == math.inf
