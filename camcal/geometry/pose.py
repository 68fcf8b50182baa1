"""Rigid motions: rotation and translation between two frames, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import FloatArray, frozen_floats

_ORTHONORMAL_TOLERANCE = 1e-6
# Here the series' first neglected term and the cancellation it avoids are both below 1e-13.
_SERIES_BELOW_RAD = 0.05


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Pose:
    """A rigid motion X_to = R X_from + t.

    Attributes
    ----------
    R : ndarray of shape (3, 3)
        Rotation matrix (orthonormal, determinant +1).
    t : ndarray of shape (3,)
        Translation in metres, in the target frame.

    Raises
    ------
    ValueError
        If a shape is wrong, a value is not finite, or R is not a rotation.

    Examples
    --------
    >>> T_cam_board = Pose.from_rvec([0, 0, np.pi / 2], [0, 0, 2])
    >>> T_cam_board.apply([1, 0, 0]).round(12).tolist()
    [0.0, 1.0, 2.0]
    """

    R: FloatArray
    t: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "R", frozen_floats(self.R, (3, 3), "R"))
        object.__setattr__(self, "t", frozen_floats(self.t, (3,), "t"))
        off = np.abs(self.R @ self.R.T - np.eye(3)).max()
        if off > _ORTHONORMAL_TOLERANCE or np.linalg.det(self.R) < 0:
            det = np.linalg.det(self.R)
            raise ValueError(f"R: not a rotation matrix (|R Rᵀ - I| = {off:.2g}, det = {det:.3g}, expected 0 and 1)")

    def __repr__(self) -> str:
        """One line: the rotation vector in degrees and the translation in metres."""
        rvec = ", ".join(f"{v:.3f}" for v in np.degrees(self.rvec))
        t = ", ".join(f"{v:.4f}" for v in self.t)
        return f"Pose(rvec=[{rvec}] deg, t=[{t}] m)"

    @classmethod
    def identity(cls) -> Pose:
        """Return the motion that moves nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_rvec(cls, rvec: npt.ArrayLike, t: npt.ArrayLike) -> Pose:
        """Build a pose from a rotation vector (axis times angle in radians) of shape (3,) and a translation in metres."""
        return cls(rotation_from_rvec(rvec), np.asarray(t, dtype=np.float64))

    @property
    def rvec(self) -> FloatArray:
        """Rotation vector of shape (3,): axis times angle in radians, angle within [0, π]."""
        return rvec_from_rotation(self.R)

    def apply(self, points: npt.ArrayLike) -> FloatArray:
        """Map points of shape (..., 3), in metres, from the source to the target frame."""
        moved: FloatArray = np.asarray(points, dtype=np.float64) @ self.R.T + self.t
        return moved

    def inverse(self) -> Pose:
        """Return the motion back: X_from = Rᵀ (X_to - t)."""
        return Pose(self.R.T, -self.R.T @ self.t)

    def __matmul__(self, other: Pose) -> Pose:
        """Compose: `T_a_b @ T_b_c` is `T_a_c`."""
        return Pose(self.R @ other.R, self.R @ other.t + self.t)

    @property
    def angle_deg(self) -> float:
        """The rotation's angle in degrees, within [0, 180]."""
        return float(np.degrees(np.linalg.norm(self.rvec)))


def rotation_from_rvec(rvec: npt.ArrayLike) -> FloatArray:
    """Rotation matrices of rotation vectors (Rodrigues' formula).

    Parameters
    ----------
    rvec : array_like of shape (..., 3)
        Axis times angle, radians.

    Returns
    -------
    ndarray of shape (..., 3, 3)
    """
    v = np.asarray(rvec, dtype=np.float64)
    theta = np.linalg.norm(v, axis=-1)[..., None, None]
    V = cross_matrix(v)
    rotation: FloatArray = np.eye(3) + _sinc(theta) * V + 0.5 * _sinc(theta / 2) ** 2 * (V @ V)
    return rotation


def rvec_from_rotation(R: npt.ArrayLike) -> FloatArray:
    """Rotation vector of a rotation matrix, by way of the unit quaternion (accurate at every angle).

    Parameters
    ----------
    R : array_like of shape (3, 3)

    Returns
    -------
    ndarray of shape (3,)
        Axis times angle in radians; the angle lies within [0, π]. At π either of the two opposite axes is returned.

    Notes
    -----
    The quaternion is the largest of the four candidate rows (Shepperd 1978), so no division is by a small number.
    """
    m = np.asarray(R, dtype=np.float64)
    # Four times the outer product of the quaternion (w, x, y, z) with itself; its longest row is the quaternion, scaled.
    xy, xz, yz = m[1, 0] + m[0, 1], m[2, 0] + m[0, 2], m[2, 1] + m[1, 2]
    wx, wy, wz = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    dx, dy, dz = m[0, 0], m[1, 1], m[2, 2]
    outer = np.array(
        [
            [1 + dx + dy + dz, wx, wy, wz],
            [wx, 1 + dx - dy - dz, xy, xz],
            [wy, xy, 1 - dx + dy - dz, yz],
            [wz, xz, yz, 1 - dx - dy + dz],
        ]
    )
    q = outer[np.argmax(np.diag(outer))]
    q = q / np.linalg.norm(q)
    if q[0] < 0:
        q = -q
    sine = np.linalg.norm(q[1:])
    half = np.arctan2(sine, q[0])
    rvec: FloatArray = q[1:] * (2.0 if sine == 0 else 2 * half / sine)
    return rvec


def rotate_with_jacobian(rvec: npt.ArrayLike, points: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Rotate points and differentiate the result by the rotation vector.

    Parameters
    ----------
    rvec : array_like of shape (..., 3)
        Rotation vectors in radians; they broadcast against the leading axes of `points` without its last two.
    points : array_like of shape (..., N, 3)
        Points in metres.

    Returns
    -------
    rotated : ndarray of shape (..., N, 3)
        R(rvec) X.
    jacobian : ndarray of shape (..., N, 3, 3)
        d(R X) / d rvec = -[R X]x Jl, Jl the left Jacobian of SO(3).
    """
    v = np.asarray(rvec, dtype=np.float64)
    X = np.asarray(points, dtype=np.float64)
    R = rotation_from_rvec(v)
    rotated: FloatArray = X @ np.swapaxes(R, -1, -2)
    jacobian: FloatArray = -cross_matrix(rotated) @ left_jacobian(v)[..., None, :, :]
    return rotated, jacobian


def left_jacobian(rvec: npt.ArrayLike) -> FloatArray:
    """Left Jacobians of SO(3), shape (..., 3, 3), of rotation vectors (..., 3): R(v + dv) = R(Jl dv) R(v) to first order.

    Sola et al. 2018, "A micro Lie theory", eq. 145.
    """
    v = np.asarray(rvec, dtype=np.float64)
    theta = np.linalg.norm(v, axis=-1)[..., None, None]
    V = cross_matrix(v)
    left: FloatArray = np.eye(3) + 0.5 * _sinc(theta / 2) ** 2 * V + _cubic_remainder(theta) * (V @ V)
    return left


def cross_matrix(v: npt.ArrayLike) -> FloatArray:
    """Matrices [v]x of shape (..., 3, 3) with [v]x w = v x w, for vectors of shape (..., 3)."""
    a = np.asarray(v, dtype=np.float64)
    out = np.zeros((*a.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -a[..., 2], a[..., 1], -a[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = a[..., 2], -a[..., 1], a[..., 0]
    return out


def _sinc(theta: FloatArray) -> FloatArray:
    """sin(θ) / θ."""
    value: FloatArray = np.sinc(theta / np.pi)
    return value


def _cubic_remainder(theta: FloatArray) -> FloatArray:
    """(θ - sin θ) / θ³, by its series where the difference cancels."""
    small = theta < _SERIES_BELOW_RAD
    safe = np.where(small, 1.0, theta)
    series = 1 / 6 - theta**2 / 120 + theta**4 / 5040 - theta**6 / 362880
    value: FloatArray = np.where(small, series, (safe - np.sin(safe)) / safe**3)
    return value
