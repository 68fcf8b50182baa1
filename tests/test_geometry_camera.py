"""The camera and the homography: derivatives, shapes, NaN, and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from camcal.geometry.arrays import FloatArray, frozen_floats, frozen_ints
from camcal.geometry.camera import Camera
from camcal.geometry.distortion import BrownConrady
from camcal.geometry.homography import apply_homography, homography_from_points, plane_homography
from camcal.geometry.pose import Pose, rotate_with_jacobian

EPS = np.finfo(np.float64).eps
K = [[900, 7, 655], [0, 850, 470], [0, 0, 1]]
DIST = [-0.28, 0.09, 1e-3, -2e-3, -0.012, 0.05, -0.01, 0.003]


def central_difference(function: Callable[[float], FloatArray], unit: float) -> tuple[FloatArray, FloatArray]:
    """Derivative at 0 and the most it may be off: its change when the step doubles bounds the truncation error."""
    h = EPS ** (1 / 3) * unit
    fine = (function(h) - function(-h)) / (2 * h)
    coarse = (function(2 * h) - function(-2 * h)) / (4 * h)
    return fine, np.abs(fine - coarse) + 32 * EPS * np.abs(function(0.0)).max() / h


def points_in_front() -> FloatArray:
    """Fifty points in front of the camera."""
    return np.random.default_rng(30).uniform([-1, -1, 1.5], [1, 1, 4], (50, 3))


def test_jacobian_by_the_point() -> None:
    """Pixels per metre of X, Y and Z, with skew and all eight coefficients, against central differences."""
    camera, points = Camera((1280, 960), K, DIST), points_in_front()
    pixels, d_point, _ = camera.project_with_jacobians(points)
    np.testing.assert_array_equal(pixels, camera.project(points))
    for axis in range(3):
        step = np.eye(3)[axis]
        value, error = central_difference(lambda h, step=step: camera.project_with_jacobians(points + h * step)[0], 1.0)
        assert (np.abs(value - d_point[..., axis]) <= error).all()


def test_jacobian_by_every_intrinsic() -> None:
    """Fx, fy, cx, cy, skew and all eight coefficients, each stepped on its own scale."""
    camera, points = Camera((1280, 960), K, DIST), points_in_front()
    _, _, d_intrinsics = camera.project_with_jacobians(points)
    assert d_intrinsics.shape == (50, 2, len(camera.intrinsic_names))
    for index, name in enumerate(camera.intrinsic_names):
        step = np.eye(13)[index]
        value, error = central_difference(
            lambda h, step=step: camera.with_intrinsics(camera.intrinsics + h * step).project_with_jacobians(points)[0],
            100.0 if index < 5 else 0.1,
        )
        assert (np.abs(value - d_intrinsics[..., index]) <= error).all(), name
        assert np.abs(d_intrinsics[..., index]).max() > 0


@pytest.mark.parametrize("angle", [0.0, 1e-6, 0.3, 2.0, 3.1])
def test_jacobian_by_the_pose(angle: float) -> None:
    """Pixels per radian of the rotation vector and per metre of t, chained, at small and large turns."""
    camera = Camera((1280, 960), K, DIST)
    rvec, t = angle * np.array([0.6, -0.48, 0.64]), np.array([0.1, -0.2, 3.0])
    board = np.random.default_rng(31).uniform(-0.5, 0.5, (20, 3))

    def project(rvec: FloatArray, t: FloatArray) -> FloatArray:
        return camera.project_with_jacobians(Pose.from_rvec(rvec, t).apply(board))[0]

    rotated, d_rotation = rotate_with_jacobian(rvec, board)
    _, d_point, _ = camera.project_with_jacobians(rotated + t)
    d_rvec = d_point @ d_rotation
    for axis in range(3):
        step = np.eye(3)[axis]
        value, error = central_difference(lambda h, step=step: project(rvec + h * step, t), 1.0)
        assert (np.abs(value - d_rvec[..., axis]) <= error).all()
        value, error = central_difference(lambda h, step=step: project(rvec, t + h * step), 1.0)
        assert (np.abs(value - d_point[..., axis]) <= error).all()


def test_rotations_of_many_views_at_once() -> None:
    """Rotation vectors (V, 3) and points (V, N, 3) give what each view gives on its own."""
    rng = np.random.default_rng(32)
    rvecs, points = rng.normal(size=(4, 3)), rng.normal(size=(4, 6, 3))
    rotated, jacobian = rotate_with_jacobian(rvecs, points)
    for view in range(4):
        alone, alone_jacobian = rotate_with_jacobian(rvecs[view], points[view])
        np.testing.assert_allclose(rotated[view], alone, rtol=0, atol=8 * EPS * 4)
        np.testing.assert_allclose(jacobian[view], alone_jacobian, rtol=0, atol=8 * EPS * 4)
    assert rotate_with_jacobian(rvecs, np.zeros((4, 0, 3)))[1].shape == (4, 0, 3, 3)


@pytest.mark.parametrize("dist", [[], [-0.2], DIST])
def test_points_behind_the_camera_are_nan(dist: list[float]) -> None:
    """Z < 0, Z = 0 and NaN: NaN everywhere, in the Jacobians too; the neighbour in front is untouched."""
    camera = Camera((1280, 960), K, dist)
    points = [[0.1, 0.1, -1], [0.1, 0.1, 0], [0, 0, 0], [0.1, np.nan, 1], [0.1, 0.1, np.nan], [0, 0, 1]]
    pixels = camera.project(points)
    assert np.isnan(pixels[:3]).all()
    assert np.isnan(pixels[3:5]).any(axis=1).all()
    assert pixels[5].tolist() == [655, 470]
    values, d_point, d_intrinsics = camera.project_with_jacobians(points)
    for array in (values, d_point, d_intrinsics):
        assert np.isnan(array[:3]).all()
        assert np.isfinite(array[5]).all()


@pytest.mark.parametrize("dist", [[], DIST])
def test_shapes_are_kept(dist: list[float]) -> None:
    """One point, none, a grid."""
    camera = Camera((1280, 960), K, dist)
    for shape in [(), (0,), (5,), (3, 0), (2, 3, 4)]:
        assert camera.project(np.ones((*shape, 3))).shape == (*shape, 2)
        assert camera.unproject(np.full((*shape, 2), 500.0)).shape == (*shape, 3)
        assert camera.contains(np.ones((*shape, 2))).shape == shape
        pixels, d_point, d_intrinsics = camera.project_with_jacobians(np.ones((*shape, 3)))
        assert (pixels.shape, d_point.shape, d_intrinsics.shape) == ((*shape, 2), (*shape, 2, 3), (*shape, 2, 13))
    assert np.isnan(camera.unproject([np.nan, 3])).any()


def test_points_hard_by_the_camera_plane_raise_no_warning() -> None:
    """Z = 1e-320 overflows X / Z: not an ordinary pixel."""
    for dist in ([], DIST):
        assert not np.isfinite(Camera((1280, 960), K, dist).project([1, 1, 1e-320])).any()


def test_every_pixel_of_the_valid_circle_has_a_ray_with_skew() -> None:
    """With a skew of 300 px the fold is a slanted ellipse; the reported radius is still the largest circle inside."""
    camera = Camera((1280, 960), [[900, 300, 600], [0, 500, 400], [0, 0, 1]], [-0.38])
    angle = np.linspace(0, 2 * np.pi, 3600)
    ring = camera.valid_radius_px * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    assert np.isfinite(camera.unproject([600, 400] + ring * (1 - 1e-9))).all()
    assert np.isnan(camera.unproject([600, 400] + ring * (1 + 1e-5))).any()


@pytest.mark.parametrize(
    ("size", "matrix", "message"),
    [
        ((0, 480), K, "size"),
        ((640, -1), K, "size"),
        ((640.5, 480), K, "size"),
        ((640, 480), np.eye(4), "K: wrong shape"),
        ((640, 480), [[-900, 0, 1], [0, 900, 1], [0, 0, 1]], "K: not an intrinsic matrix"),
        ((640, 480), [[900, 0, 1], [0, 0, 1], [0, 0, 1]], "K: not an intrinsic matrix"),
        ((640, 480), [[900, 0, 1], [1, 900, 1], [0, 0, 1]], "K: not an intrinsic matrix"),
        ((640, 480), [[900, 0, 1], [0, 900, 1], [0, 0, 2]], "K: not an intrinsic matrix"),
        ((640, 480), [[np.nan, 0, 1], [0, 900, 1], [0, 0, 1]], "K: every value must be finite"),
    ],
)
def test_cameras_that_make_no_sense_are_refused(size: tuple[int, int], matrix: object, message: str) -> None:
    """Sizes that are not whole and positive, matrices that are no K."""
    with pytest.raises(ValueError, match=message):
        Camera(size, matrix)


def test_a_camera_takes_a_lens_or_its_coefficients_and_nothing_else() -> None:
    """Either gives the same camera; a string is an error; K is copied and read-only."""
    matrix = np.array(K, dtype=float)
    camera = Camera((1280, 960), matrix, BrownConrady(DIST))
    matrix[0, 0] = 1
    assert camera.K[0, 0] == 900
    assert camera.dist.tolist() == Camera((1280, 960), K, DIST).dist.tolist()
    assert repr(Camera((4, 3), K, [-0.1])) == "Camera(4x3, fx=900, fy=850, cx=655, cy=470, skew=7, k1=-0.1)"
    with pytest.raises(ValueError, match="not a lens"):
        Camera((1280, 960), K, "k1")
    with pytest.raises(ValueError, match="read-only"):
        camera.K[0, 0] = 1


def test_plane_homography_is_projection_of_the_plane() -> None:
    """Mapping (x, y) by the homography is projecting (x, y, 0) through the pose without a lens."""
    pose = Pose.from_rvec([0.3, -0.5, 0.2], [0.1, 0.2, 2])
    xy = np.random.default_rng(33).uniform(-0.5, 0.5, (40, 2))
    expected = Camera((1280, 960), K).project(pose.apply(np.column_stack([xy, np.zeros(40)])))
    np.testing.assert_allclose(apply_homography(plane_homography(K, pose), xy), expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    "source",
    [
        [[0, 0], [1, 0], [0, 1]],
        [[0, 0], [1, 1], [2, 2], [3, 3], [4, 4]],
        [[0, 0], [1, 1], [2, 2], [3, 0]],
        [[1, 1]] * 5,
        [[0, 0], [1, 0], [0, 1], [np.nan, 1]],
        np.zeros((0, 2)),
    ],
)
def test_degenerate_correspondences_give_nan(source: FloatArray) -> None:
    """Too few, on a line, three of four on a line, all the same, NaN, none."""
    H = homography_from_points(source, source)
    assert H.shape == (3, 3)
    assert np.isnan(H).all()


def test_homography_of_a_sliver_keeps_its_digits() -> None:
    """A strip a thousand times longer than high, mapped onto itself: squaring the system would cost half the digits."""
    strip = [[0, 0], [1000, 0], [1000, 1], [0, 1]]
    H = homography_from_points(strip, strip)
    np.testing.assert_allclose(H / H[2, 2], np.eye(3), rtol=0, atol=1e-9)


def test_a_homography_faces_its_points() -> None:
    """The sign is the one that maps the source to the front, so applying it never gives NaN for them."""
    rng = np.random.default_rng(34)
    source, target = (
        rng.uniform(0, 1, (4, 2)) + np.array([[0, 0], [3, 0], [3, 3], [0, 3]]),
        np.array([[9, 9], [0, 9], [0, 0], [9, 0]]),
    )
    np.testing.assert_allclose(apply_homography(homography_from_points(source, target), source), target, rtol=0, atol=1e-12)


def test_frozen_arrays_say_what_is_wrong() -> None:
    """Shape, finiteness and whole numbers are checked by name."""
    assert frozen_floats([1, 2], (None,), "a").tolist() == [1, 2]
    assert frozen_ints([1.0, 2.0], (2,), "a").dtype == np.int64
    with pytest.raises(ValueError, match=r"a: wrong shape \(got \(2,\), expected \(N, 2\)\)"):
        frozen_floats([1, 2], (None, 2), "a")
    with pytest.raises(ValueError, match="a: every value must be finite"):
        frozen_floats([np.inf], (1,), "a")
    with pytest.raises(ValueError, match="a: every value must be a whole number"):
        frozen_ints([1.5], (1,), "a")
    assert np.isnan(frozen_floats([np.nan], (1,), "a", finite=False)[0])


@pytest.mark.parametrize(
    "R", [2 * np.eye(3), np.diag([1, 1, -1]), np.full((3, 3), np.nan), np.eye(2), np.eye(3) + 1e-4 * np.ones((3, 3))]
)
def test_matrices_that_are_no_rotation_are_refused(R: FloatArray) -> None:
    """Scaled, mirrored, NaN, misshapen and skewed matrices."""
    with pytest.raises(ValueError, match="R: "):
        Pose(R, [0, 0, 0])
