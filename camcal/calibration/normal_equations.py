"""The sparse normal equations of a calibration: one small block for what all views share, one 6x6 block for each view.

What they share are the camera's intrinsics and, where it is solved for, the board's shape. Eliminating the poses leaves a
system as small as that (the Schur complement; Triggs et al. 2000, "Bundle adjustment: a modern synthesis", section 6.1),
so cost and memory grow linearly with the number of corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose, cross_matrix, left_jacobian, rotate_with_jacobian, rotation_from_rvec
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
    shape_basis : ndarray of shape (M, 3, S)
        By how much each feature moves per unit of each parameter of the board's shape; S is 0 for a flat, true board.
    """

    points_board: FloatArray
    corners_px: FloatArray
    weights: FloatArray
    view: IntArray
    starts: IntArray
    shape_basis: FloatArray

    @classmethod
    def gather(cls, detections: Sequence[Detection], object_points: FloatArray) -> Observations:
        """Flatten detections of a flat, true board; every corner weighs the same."""
        counts = np.array([len(d) for d in detections])
        return cls(
            points_board=np.concatenate([object_points[d.ids] for d in detections]),
            corners_px=np.concatenate([d.corners_px for d in detections]),
            weights=np.ones(counts.sum()),
            view=np.repeat(np.arange(counts.size), counts),
            starts=np.concatenate([[0], np.cumsum(counts)[:-1]]),
            shape_basis=np.zeros((counts.sum(), 3, 0)),
        )

    def shaped(self, detections: Sequence[Detection], basis: FloatArray) -> Observations:
        """Return the same corners of a board whose shape has parameters: `basis` is (N, 3, S), by feature id."""
        return replace(self, shape_basis=np.concatenate([basis[d.ids] for d in detections]))

    def only(self, keep: BoolArray) -> Observations:
        """Return some of the corners, shape (M,); views without any are no longer counted."""
        _, starts, view = np.unique(self.view[keep], return_index=True, return_inverse=True)
        return Observations(
            points_board=self.points_board[keep],
            corners_px=self.corners_px[keep],
            weights=self.weights[keep],
            view=view,
            starts=starts,
            shape_basis=self.shape_basis[keep],
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
    shape : ndarray of shape (S,)
        Parameters of the board's shape, as many as the observations' `shape_basis` has.
    """

    camera: Camera
    rvecs: FloatArray
    ts: FloatArray
    shape: FloatArray = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, camera: Camera, poses: Sequence[Pose]) -> State:
        """Take the state of a flat, true board apart from a camera and poses."""
        return cls(camera, np.array([p.rvec for p in poses]), np.array([p.t for p in poses]))

    @property
    def poses(self) -> tuple[Pose, ...]:
        """T_cam_board of each view."""
        return tuple(Pose.from_rvec(rvec, t) for rvec, t in zip(self.rvecs, self.ts, strict=True))

    @property
    def shared(self) -> FloatArray:
        """What all views share: the camera's intrinsics, then the board's shape."""
        return np.concatenate([self.camera.intrinsics, self.shape])

    def moved(self, columns: IntArray, d_shared: FloatArray, d_poses: FloatArray) -> State:
        """Return the state after a step in free shared parameters (F,), at `columns` of `shared`, and in the poses (V, 6)."""
        values = self.shared
        values[columns] += d_shared
        count = values.size - self.shape.size
        camera = self.camera.with_intrinsics(values[:count])
        return State(camera, self.rvecs + d_poses[:, :3], self.ts + d_poses[:, 3:], values[count:])

    def of_views(self, views: IntArray) -> State:
        """Return the state with some of the views only."""
        return replace(self, rvecs=self.rvecs[views], ts=self.ts[views])


def shaped_points(state: State, seen: Observations) -> FloatArray:
    """Features as the state's board has them: (M, 3) metres, board frame."""
    return seen.points_board + seen.shape_basis @ state.shape if state.shape.size else seen.points_board


def residuals(state: State, seen: Observations) -> FloatArray:
    """Seen minus projected corners: (M, 2) pixels, unweighted; NaN for a point behind the camera."""
    R = rotation_from_rvec(state.rvecs)[seen.view]
    points_cam = (R @ shaped_points(state, seen)[..., None])[..., 0] + state.ts[seen.view]
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
class Covariances:
    """What the corners leave undetermined, to first order.

    Attributes
    ----------
    shared : ndarray of shape (F, F)
        Covariance of the free shared parameters.
    joint : ndarray of shape (F + 6, F + 6)
        The same together with the boards' mean motion in the camera frame: rotation vector (radians), translation (metres).
    pose_sigmas : ndarray of shape (V, 6)
        Standard deviations of rvec (radians) and t (metres).
    condition : float
        Condition number of the scaled shared system; inf if it is singular.
    """

    shared: FloatArray
    joint: FloatArray
    pose_sigmas: FloatArray
    condition: float


@dataclass(frozen=True, slots=True, eq=False)
class NormalEquations:
    """JᵀJ and Jᵀr of the weighted residuals, in blocks of each view, every parameter scaled.

    Attributes
    ----------
    A : ndarray of shape (V, F, F)
        Shared block of each view; their sum has a unit diagonal.
    B : ndarray of shape (V, F, 6)
        Shared parameters against each view's (rvec, t).
    C : ndarray of shape (V, 6, 6)
        Pose blocks, of unit diagonal.
    a : ndarray of shape (V, F)
        Each view's part of the right-hand side of the shared parameters.
    c : ndarray of shape (V, 6)
        Right-hand side of the poses.
    scale : ndarray of shape (F,)
        Scaled parameter = parameter x scale.
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
        """Linearise the weighted residuals at a state; `columns` are the free parameters' places in `State.shared`."""
        rotated, d_rvec = rotate_with_jacobian(state.rvecs[seen.view], shaped_points(state, seen)[:, None])
        points_cam = rotated[:, 0] + state.ts[seen.view]
        pixels, d_point, d_shared = state.camera.project_with_jacobians(points_cam)
        if state.shape.size:
            R = rotation_from_rvec(state.rvecs)[seen.view]
            d_shared = np.concatenate([d_shared, d_point @ R @ seen.shape_basis], axis=-1)
        free = columns.size
        # One matrix of derivatives and residuals: its products, view by view, hold every block.
        rows = np.concatenate(
            [d_shared[..., columns], d_point @ d_rvec[:, 0], d_point, (seen.corners_px - pixels)[..., None]], axis=-1
        )
        rows *= seen.weights[:, None, None]
        views = np.split(rows.reshape(-1, free + 7), 2 * seen.starts[1:])
        blocks = np.stack([view.T @ view for view in views])
        A, B, a = blocks[:, :free, :free], blocks[:, :free, free:-1], blocks[:, :free, -1]
        C, c = blocks[:, free:-1, free:-1], blocks[:, free:-1, -1]
        scale = np.sqrt(np.diag(A.sum(axis=0)))
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
        d_shared : ndarray of shape (F,)
        d_poses : ndarray of shape (V, 6)
        decrease : float
            By how much the sum of squares should fall, px².

        Raises
        ------
        numpy.linalg.LinAlgError
            If the system is singular.
        """
        Ci_Bt, Ci_c = self._eliminate(self.C + damping * np.eye(6))
        eye = np.eye(self.scale.size)
        a = self.a.sum(axis=0)
        S = self.A.sum(axis=0) + damping * eye - np.tensordot(self.B, Ci_Bt, axes=((0, 2), (0, 1)))
        y = np.linalg.solve(S, a - np.tensordot(self.B, Ci_c, axes=((0, 2), (0, 1))))
        z = Ci_c - Ci_Bt @ y
        decrease = float(y @ a + (z * self.c).sum() + damping * (y @ y + (z * z).sum()))
        return y / self.scale, z / self.pose_scale, decrease

    def view_information(self) -> tuple[FloatArray, FloatArray]:
        """What each view says about the shared parameters once its pose is eliminated.

        Returns
        -------
        information : ndarray of shape (V, F, F)
            Their sum is the inverse covariance, up to the variance of the residuals.
        gradient : ndarray of shape (V, F)
            Where each view would push the parameters; at the minimum they cancel. Both in unscaled parameters.
        """
        Ci_Bt, Ci_c = self._eliminate(self.C)
        information = (self.A - self.B @ Ci_Bt) * np.outer(self.scale, self.scale)
        gradient = (self.a - (self.B @ Ci_c[..., None])[..., 0]) * self.scale
        return information, gradient

    def covariances(self, state: State, variance_px2: float) -> Covariances:
        """Covariances at the minimum.

        The mean motion m = Σ T_v dp_v / V turns what is unsure about the poses into one rotation and translation of the
        camera frame: a point X moves by d(R p + t) = -[X]x w + v, with w = Jl(rvec) d rvec and v = d t + [t]x w.

        Parameters
        ----------
        state : State
            Where the equations were built.
        variance_px2 : float
            Variance of the weighted residuals per axis.
        """
        Ci_Bt, _ = self._eliminate(self.C)
        S = self.A.sum(axis=0) - np.tensordot(self.B, Ci_Bt, axes=((0, 2), (0, 1)))
        inverse = np.linalg.inv(S)
        # The inverse of a symmetric matrix comes out symmetric only up to the last bits.
        inverse = (inverse + inverse.T) / 2
        C_inverse = np.linalg.inv(self.C)
        pose_variance = np.diagonal(C_inverse, axis1=1, axis2=2) + ((Ci_Bt @ inverse) * Ci_Bt).sum(axis=-1)
        motion = _motions(state) / self.pose_scale[:, None, :]
        coupling = -(motion @ Ci_Bt).mean(axis=0)
        own = (motion @ C_inverse @ np.swapaxes(motion, -1, -2)).sum(axis=0) / len(motion) ** 2
        across = inverse @ coupling.T
        joint = np.block([[inverse, across], [across.T, own + coupling @ across]])
        units = np.concatenate([self.scale, np.ones(6)])
        joint = variance_px2 * (joint + joint.T) / 2 / np.outer(units, units)
        free = self.scale.size
        return Covariances(
            shared=joint[:free, :free],
            joint=joint,
            pose_sigmas=np.sqrt(variance_px2 * np.maximum(pose_variance, 0)) / self.pose_scale,
            condition=float(np.linalg.cond(S)),
        )

    def _eliminate(self, C: FloatArray) -> tuple[FloatArray, FloatArray]:
        """C⁻¹ Bᵀ of shape (V, 6, F) and C⁻¹ c of shape (V, 6)."""
        right = np.concatenate([np.swapaxes(self.B, -1, -2), self.c[..., None]], axis=-1)
        solved = np.linalg.solve(C, right)
        return solved[..., :-1], solved[..., -1]


def _motions(state: State) -> FloatArray:
    """From each view's (d rvec, d t) to the motion (w, v) of the camera frame: (V, 6, 6)."""
    turn = left_jacobian(state.rvecs)
    motion = np.zeros((len(turn), 6, 6))
    motion[:, :3, :3] = turn
    motion[:, 3:, :3] = cross_matrix(state.ts) @ turn
    motion[:, 3:, 3:] = np.eye(3)
    return motion
