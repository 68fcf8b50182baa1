"""The sparse normal equations of a calibration: one small block for the intrinsics, one 6x6 block for each view.

Eliminating the poses leaves a system as small as the number of free intrinsics (the Schur complement; Triggs et al. 2000,
"Bundle adjustment: a modern synthesis", section 6.1), so cost and memory grow linearly with the number of corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from camcal.geometry.arrays import FloatArray, IntArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose, rotate_with_jacobian, rotation_from_rvec
from camcal.observations import Detection

# No corner is a hundred times better than the median one, whatever its sigma says: the lens model and the flatness of
# the board are not. One that is a hundred times worse has no say either way, and more would only cost digits.
_WEIGHT_RANGE = 100.0


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """All corners of all views as flat arrays, in the order of the views.

    Attributes
    ----------
    points_board : ndarray of shape (M, 3)
        Features in metres, board frame.
    corners_px : ndarray of shape (M, 2)
    weights : ndarray of shape (M,)
        Factor on each residual: one over its standard deviation, relative to the median corner's; from 1/100 to 100.
    view : ndarray of shape (M,)
        Index of each corner's view.
    starts : ndarray of shape (V,)
        Index of each view's first corner.
    """

    points_board: FloatArray
    corners_px: FloatArray
    weights: FloatArray
    view: IntArray
    starts: IntArray

    @classmethod
    def gather(cls, detections: Sequence[Detection], object_points: FloatArray) -> Observations:
        """Flatten detections; every corner weighs the same."""
        counts = np.array([len(d) for d in detections])
        return cls(
            points_board=np.concatenate([object_points[d.ids] for d in detections]),
            corners_px=np.concatenate([d.corners_px for d in detections]),
            weights=np.ones(counts.sum()),
            view=np.repeat(np.arange(counts.size), counts),
            starts=np.concatenate([[0], np.cumsum(counts)[:-1]]),
        )

    def weighted(self, sigma_px: FloatArray) -> Observations:
        """Return the same corners, each weighed by its standard deviation, shape (M,), finite and positive."""
        # Logarithms, because the ratio of two floats may be none.
        log_sigma = np.log(sigma_px)
        finer = np.clip(np.median(log_sigma) - log_sigma, -np.log(_WEIGHT_RANGE), np.log(_WEIGHT_RANGE))
        return replace(self, weights=np.exp(finer))


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """One guess at everything that is solved for.

    Attributes
    ----------
    camera : Camera
    rvecs, ts : ndarray of shape (V, 3)
        T_cam_board of each view: rotation vectors (radians) and translations (metres).
    """

    camera: Camera
    rvecs: FloatArray
    ts: FloatArray

    @classmethod
    def of(cls, camera: Camera, poses: Sequence[Pose]) -> State:
        """Take the state apart from a camera and poses."""
        return cls(camera, np.array([p.rvec for p in poses]), np.array([p.t for p in poses]))

    @property
    def poses(self) -> tuple[Pose, ...]:
        """T_cam_board of each view."""
        return tuple(Pose.from_rvec(rvec, t) for rvec, t in zip(self.rvecs, self.ts, strict=True))

    def moved(self, columns: IntArray, d_intrinsics: FloatArray, d_poses: FloatArray) -> State:
        """Return the state after a step in the free intrinsics (F,) and in the poses (V, 6)."""
        values = self.camera.intrinsics.copy()
        values[columns] += d_intrinsics
        return State(self.camera.with_intrinsics(values), self.rvecs + d_poses[:, :3], self.ts + d_poses[:, 3:])


def residuals(state: State, seen: Observations) -> FloatArray:
    """Seen minus projected corners: (M, 2) pixels, unweighted; NaN for a point behind the camera."""
    R = rotation_from_rvec(state.rvecs)[seen.view]
    points_cam = (R @ seen.points_board[..., None])[..., 0] + state.ts[seen.view]
    distorted = state.camera.lens.distort_unchecked(
        points_cam[:, :2] / np.where(points_cam[:, 2:] > 0, points_cam[:, 2:], np.nan)
    )
    return seen.corners_px - state.camera.pixels_from_normalised(distorted)


def view_costs(state: State, seen: Observations) -> FloatArray:
    """Weighted sum of squared residuals of each view: (V,) px²; inf for a view with a point behind the camera."""
    squares = ((residuals(state, seen) * seen.weights[:, None]) ** 2).sum(axis=1)
    return np.add.reduceat(np.where(np.isfinite(squares), squares, np.inf), seen.starts)


def view_rms(state: State, seen: Observations) -> FloatArray:
    """Weighted RMS residual length of each view, shape (V,), pixels; inf where a point falls behind the camera."""
    counts = np.diff(np.append(seen.starts, seen.view.size))
    rms: FloatArray = np.sqrt(view_costs(state, seen) / counts)
    return rms


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """JᵀJ and Jᵀr of the weighted residuals, in blocks, every parameter scaled to a unit diagonal.

    Attributes
    ----------
    A : ndarray of shape (F, F)
        Intrinsics block.
    B : ndarray of shape (V, F, 6)
        Intrinsics against each view's (rvec, t).
    C : ndarray of shape (V, 6, 6)
        Pose blocks.
    a : ndarray of shape (F,)
        Right-hand side of the intrinsics.
    c : ndarray of shape (V, 6)
        Right-hand side of the poses.
    scale : ndarray of shape (F,)
        Scaled intrinsic = intrinsic x scale.
    pose_scale : ndarray of shape (V, 6)
        The same for the poses.
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    a: FloatArray
    c: FloatArray
    scale: FloatArray
    pose_scale: FloatArray

    @classmethod
    def build(cls, state: State, seen: Observations, columns: IntArray) -> NormalEquations:
        """Linearise the weighted residuals at a state; `columns` are the free intrinsics' places."""
        rotated, d_rvec = rotate_with_jacobian(state.rvecs[seen.view], seen.points_board[:, None])
        points_cam = rotated[:, 0] + state.ts[seen.view]
        pixels, d_point, d_intrinsics = state.camera.project_with_jacobians(points_cam)
        w = seen.weights[:, None]
        r = (seen.corners_px - pixels) * w
        J = d_intrinsics[..., columns] * w[..., None]
        P = np.concatenate([d_point @ d_rvec[:, 0], d_point], axis=-1) * w[..., None]
        A, a = np.tensordot(J, J, axes=((0, 1), (0, 1))), np.tensordot(J, r, axes=((0, 1), (0, 1)))
        Jt, Pt = np.swapaxes(J, -1, -2), np.swapaxes(P, -1, -2)
        B, C = np.add.reduceat(Jt @ P, seen.starts), np.add.reduceat(Pt @ P, seen.starts)
        c = np.add.reduceat((Pt @ r[..., None])[..., 0], seen.starts)
        scale = np.sqrt(np.diag(A))
        pose_scale = np.sqrt(np.diagonal(C, axis1=1, axis2=2))
        return cls(
            A=A / np.outer(scale, scale),
            B=B / (scale[:, None] * pose_scale[:, None, :]),
            C=C / (pose_scale[:, :, None] * pose_scale[:, None, :]),
            a=a / scale,
            c=c / pose_scale,
            scale=scale,
            pose_scale=pose_scale,
        )

    def solve(self, damping: float) -> tuple[FloatArray, FloatArray, float]:
        """Solve for the step.

        Parameters
        ----------
        damping : float
            Added to the unit diagonal (Levenberg-Marquardt); 0 is Gauss-Newton.

        Returns
        -------
        d_intrinsics : ndarray of shape (F,)
        d_poses : ndarray of shape (V, 6)
        decrease : float
            By how much the sum of squares should fall, px².

        Raises
        ------
        numpy.linalg.LinAlgError
            If the system is singular.
        """
        eye = np.eye(self.A.shape[0])
        C = self.C + damping * np.eye(6)
        Ci_Bt, Ci_c = self._eliminate(C)
        S = self.A + damping * eye - np.tensordot(self.B, Ci_Bt, axes=((0, 2), (0, 1)))
        y = np.linalg.solve(S, self.a - np.tensordot(self.B, Ci_c, axes=((0, 2), (0, 1))))
        z = Ci_c - Ci_Bt @ y
        decrease = float(y @ self.a + (z * self.c).sum() + damping * (y @ y + (z * z).sum()))
        return y / self.scale, z / self.pose_scale, decrease

    def covariances(self, variance_px2: float) -> tuple[FloatArray, FloatArray, float]:
        """Covariances at the minimum, for a residual variance per axis of `variance_px2`.

        Returns
        -------
        covariance : ndarray of shape (F, F)
            Of the free intrinsics.
        pose_sigmas : ndarray of shape (V, 6)
            Standard deviations of rvec (radians) and t (metres).
        condition : float
            Condition number of the scaled intrinsics' system; inf if it is singular.
        """
        Ci_Bt, _ = self._eliminate(self.C)
        S = self.A - np.tensordot(self.B, Ci_Bt, axes=((0, 2), (0, 1)))
        condition = float(np.linalg.cond(S))
        inverse = np.linalg.inv(S)
        pose_variance = np.diagonal(np.linalg.inv(self.C), axis1=1, axis2=2) + ((Ci_Bt @ inverse) * Ci_Bt).sum(axis=-1)
        # The inverse of a symmetric matrix comes out symmetric only up to the last bits.
        covariance: FloatArray = variance_px2 * (inverse + inverse.T) / 2 / np.outer(self.scale, self.scale)
        return covariance, np.sqrt(variance_px2 * np.maximum(pose_variance, 0)) / self.pose_scale, condition

    def _eliminate(self, C: FloatArray) -> tuple[FloatArray, FloatArray]:
        """C⁻¹ Bᵀ of shape (V, 6, F) and C⁻¹ c of shape (V, 6)."""
        right = np.concatenate([np.swapaxes(self.B, -1, -2), self.c[..., None]], axis=-1)
        solved = np.linalg.solve(C, right)
        return solved[..., :-1], solved[..., -1]
