"""Our forward model against OpenCV's: two implementations that share nothing."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.homography import apply_homography, homography_from_points
from camcal.geometry.pose import Pose, rotate_with_jacobian, rotation_from_rvec, rvec_from_rotation

EPS = np.finfo(np.float64).eps


def random_lens(rng: np.random.Generator, kind: int) -> FloatArray:
    """A lens with k1; k1..k3; with the tangential pair; or all eight coefficients."""
    radial = rng.uniform(-1, 1, 3) * [0.3, 0.05, 0.005]
    tangential = rng.uniform(-1, 1, 2) * 0.01
    denominator = rng.uniform(-0.2, 1, 3) * [0.3, 0.05, 0.005]
    dist = np.array([*radial[:2], *tangential, radial[2], *denominator])
    dist[{0: slice(1, 8), 1: [2, 3, 5, 6, 7], 2: slice(5, 8), 3: slice(8, 8)}[kind]] = 0
    return dist


def scenes(count: int, points: int, reach: float) -> Iterator[tuple[Camera, FloatArray, FloatArray, FloatArray]]:
    """Cameras with a rotation vector, a translation and board points (N, 3) that lie in front of them within `reach`."""
    rng = np.random.default_rng(20)
    for index in range(count):
        fx, fy = rng.uniform(400, 1600, 2)
        K = [[fx, 0, rng.uniform(300, 900)], [0, fy, rng.uniform(200, 700)], [0, 0, 1]]
        camera = Camera((1280, 960), K, random_lens(rng, index % 4))
        axis = rng.normal(size=3)
        rvec = axis / np.linalg.norm(axis) * rng.uniform(0, np.pi)
        tvec = rng.uniform(-1, 1, 3)
        depth = rng.uniform(0.3, 5, (points, 1))
        cam = np.hstack([rng.uniform(-reach, reach, (points, 2)) * depth, depth])
        yield camera, rvec, tvec, Pose.from_rvec(rvec, tvec).inverse().apply(cam)


def test_project_agrees_within_1e_9_px() -> None:
    """10,000 points with |x|, |y| up to 2, 200 poses and lenses, wherever camcal has an answer."""
    compared, refused = 0, 0
    for camera, rvec, tvec, board in scenes(count=200, points=50, reach=2.0):
        ours = camera.project(Pose.from_rvec(rvec, tvec).apply(board))
        theirs = cv2.projectPoints(board, rvec, tvec, camera.K, camera.dist)[0].reshape(-1, 2)
        known = np.isfinite(ours).all(axis=1)
        assert np.abs(ours - theirs)[known].max(initial=0) <= 1e-9
        compared += int(known.sum())
        refused += int((~known).sum())
        if camera.lens.valid_radius == np.inf:
            assert known.all()
    assert compared + refused == 10_000
    assert compared > 5_000
    assert refused > 1_000


def test_unproject_agrees_with_undistort_points() -> None:
    """Pixels of real points within 80 % of the fold; OpenCV iterates to 1e-12 normalised, far from any fold's edge."""
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-14)
    for camera, rvec, tvec, board in scenes(count=60, points=50, reach=0.5):
        cam = Pose.from_rvec(rvec, tvec).apply(board)
        ideal = cam[:, :2] / cam[:, 2:]
        inner = np.linalg.norm(ideal, axis=1) < 0.5 * camera.lens.valid_radius
        pixels = camera.project(cam[inner])
        theirs = cv2.undistortPoints(pixels, camera.K, camera.dist, criteria=criteria).reshape(-1, 2)
        np.testing.assert_allclose(camera.unproject(pixels)[:, :2], theirs, rtol=0, atol=1e-10)


def test_jacobians_agree_with_opencv() -> None:
    """By rotation vector, translation, focal lengths, principal point and all eight coefficients: 1e-11 relative."""
    for camera, rvec, tvec, board in scenes(count=40, points=30, reach=1.0):
        theirs = cv2.projectPoints(board, rvec, tvec, camera.K, camera.dist)[1].reshape(-1, 2, 18)
        rotated, d_rotation = rotate_with_jacobian(rvec, board)
        _, d_point, d_intrinsics = camera.project_with_jacobians(rotated + tvec)
        ours = np.concatenate([d_point @ d_rotation, d_point, d_intrinsics[..., :4], d_intrinsics[..., 5:]], axis=-1)
        scale = np.abs(theirs).max(axis=(0, 1))
        assert (np.abs(ours - theirs).max(axis=(0, 1)) <= 1e-11 * scale).all()


@pytest.mark.parametrize(
    "angle", [0, 1e-12, 1e-8, 1e-5, 1e-3, 0.04999, 0.05001, 1, 3, np.pi - 1e-3, np.pi - 1e-6, np.pi - 1e-9, np.pi]
)
def test_rotation_vectors_agree_with_rodrigues(angle: float) -> None:
    """Near no turn and near half a turn too: R to rounding, and the vector back (at π either axis is the same turn)."""
    rng = np.random.default_rng(21)
    axes = np.vstack([np.eye(3), -np.eye(3), rng.normal(size=(30, 3))])
    for axis in axes:
        rvec = axis / np.linalg.norm(axis) * angle
        R = rotation_from_rvec(rvec)
        np.testing.assert_allclose(R, cv2.Rodrigues(rvec)[0], rtol=0, atol=8 * EPS)
        back = rvec_from_rotation(R)
        # Within rounding of half a turn the sign of the axis is rounding too; the other one is 2 (π - angle) shorter.
        flipped = angle > np.pi - 1e-8 and back @ rvec < 0
        np.testing.assert_allclose(-back if flipped else back, rvec, rtol=0, atol=8 * EPS + 2 * flipped * (np.pi - angle))


def test_rotation_vector_of_opencv_rotations() -> None:
    """Random rotations over all angles: cv2.Rodrigues both ways, its own accuracy near π being 1e-8."""
    rng = np.random.default_rng(22)
    for _ in range(300):
        axis = rng.normal(size=3)
        rvec = axis / np.linalg.norm(axis) * rng.uniform(0, np.pi - 1e-3)
        R = cv2.Rodrigues(rvec)[0]
        np.testing.assert_allclose(rvec_from_rotation(R), cv2.Rodrigues(R)[0].ravel(), rtol=0, atol=1e-11)


def test_rotation_jacobian_agrees_with_rodrigues() -> None:
    """d(R X) / d rvec from OpenCV's 3 x 9 derivative of R."""
    rng = np.random.default_rng(23)
    X = rng.normal(size=(5, 3))
    for angle in (1e-9, 1e-4, 0.049, 0.051, 1.0, 3.0, np.pi - 1e-6):
        axis = rng.normal(size=3)
        rvec = axis / np.linalg.norm(axis) * angle
        d_R = cv2.Rodrigues(rvec)[1].reshape(3, 3, 3)
        theirs = np.einsum("kij,nj->nik", d_R, X)
        np.testing.assert_allclose(rotate_with_jacobian(rvec, X)[1], theirs, rtol=0, atol=1e-7 if angle < 1e-3 else 1e-12)


def test_homography_agrees_with_find_homography() -> None:
    """100 exact correspondences through a random perspective map."""
    rng = np.random.default_rng(24)
    H = np.array([[1.1, 0.2, 30], [-0.1, 0.9, 50], [1e-4, 2e-4, 1]])
    source = rng.uniform(0, 1000, (100, 2))
    mapped = np.column_stack([source, np.ones(100)]) @ H.T
    target = mapped[:, :2] / mapped[:, 2:]
    ours = homography_from_points(source, target)
    theirs, _ = cv2.findHomography(source, target)
    # OpenCV works on float32 coordinates here.
    rounding = np.finfo(np.float32).eps * 1000
    np.testing.assert_allclose(apply_homography(ours, source), apply_homography(theirs, source), rtol=0, atol=rounding)
    np.testing.assert_allclose(ours / ours[2, 2], H, rtol=1e-11, atol=1e-14)
