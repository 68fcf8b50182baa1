"""How far two cameras disagree: in pixels over the image, per parameter, and per view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from camcal.boards.base import Board
from camcal.errors import InputError
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose, rotate_with_jacobian
from camcal.observations import Detection, Intrinsics

_GRID_COLUMNS = 64
_ROTATION_STEPS = 20


@dataclass(frozen=True, slots=True, eq=False)
class ProjectionDifference:
    """Where two cameras see the same far points, after the rotation between them is fitted and removed.

    Attributes
    ----------
    pixels : ndarray of shape (M, 2)
        Where the reference camera sees each point: a regular grid over its image.
    difference_px : ndarray of shape (M, 2)
        Where the other camera sees it, minus that; NaN where either camera has no valid answer.
    rvec : ndarray of shape (3,)
        The implied rotation, axis times angle in radians.
    lost_share : float
        Share of the reference's valid pixels for which the other camera has no valid answer (its lens has turned back).
    """

    pixels: FloatArray
    difference_px: FloatArray
    rvec: FloatArray
    lost_share: float

    @property
    def length_px(self) -> FloatArray:
        """Lengths of the differences that are defined, in pixels."""
        length: FloatArray = np.linalg.norm(self.difference_px, axis=1)
        finite: FloatArray = length[np.isfinite(length)]
        return finite

    @property
    def mean_px(self) -> float:
        """Mean length in pixels."""
        return float(self.length_px.mean())

    @property
    def p95_px(self) -> float:
        """The length that 95 % of the image stays below, in pixels."""
        return float(np.percentile(self.length_px, 95))

    @property
    def max_px(self) -> float:
        """Largest length in pixels."""
        return float(self.length_px.max())

    @property
    def compared_share(self) -> float:
        """Share of the image over which both cameras have an answer."""
        return float(np.isfinite(self.difference_px[:, 0]).mean())


def projection_difference(reference: Camera, other: Camera) -> ProjectionDifference:
    """Compare two cameras over the image.

    Points at infinity are sent through both. A calibration cannot tell a small turn of the camera from a shift of the
    principal point, so the rotation between the two that makes them agree best (least squares) is taken out first.

    Parameters
    ----------
    reference, other : Camera
        Cameras of the same image size.

    Returns
    -------
    ProjectionDifference

    Raises
    ------
    InputError
        If the image sizes differ, or the cameras have nothing valid in common.
    """
    if reference.size != other.size:
        got, expected = ("{}x{}".format(*camera.size) for camera in (other, reference))
        raise InputError(
            f"verify: cameras of different image sizes (got {got}, expected {expected}). Compare cameras of one size."
        )
    pixels = _image_grid(reference.size)
    rays = reference.unproject(pixels)
    rvec = _fit_rotation(rays, pixels, other)
    seen = other.project(rotate_with_jacobian(rvec, rays)[0])
    seeing = np.isfinite(rays[:, 0])
    lost = float(np.isnan(seen[seeing, 0]).mean()) if seeing.any() else 0.0
    difference = ProjectionDifference(pixels, seen - pixels, rvec, lost)
    if difference.length_px.size == 0:
        raise InputError("verify: the two cameras have no valid pixel in common. Check that both files are of the same camera.")
    return difference


def _image_grid(size: tuple[int, int]) -> FloatArray:
    """Regular grid of pixels (M, 2) from image edge to image edge, with roughly square cells."""
    width, height = size
    rows = max(2, round(_GRID_COLUMNS * height / width))
    u, v = np.meshgrid(np.linspace(0, width - 1, _GRID_COLUMNS), np.linspace(0, height - 1, rows))
    return np.stack([u.ravel(), v.ravel()], axis=-1)


def _fit_rotation(rays: FloatArray, pixels: FloatArray, other: Camera) -> FloatArray:
    """Rotation vector that brings `other.project(R rays)` closest to `pixels`, by Gauss-Newton."""
    rvec = np.zeros(3)
    for _ in range(_ROTATION_STEPS):
        turned, d_rvec = rotate_with_jacobian(rvec, rays)
        seen, d_point, _ = other.project_with_jacobians(turned)
        valid = np.isfinite(other.project(turned)).all(axis=1)
        J = (d_point[valid] @ d_rvec[valid]).reshape(-1, 3)
        step, *_ = np.linalg.lstsq(J, (pixels[valid] - seen[valid]).ravel(), rcond=None)
        rvec = rvec + step
        if np.abs(step).max(initial=0) < 1e-14:
            break
    return rvec


@dataclass(frozen=True, slots=True)
class ParameterError:
    """One intrinsic against its truth.

    Attributes
    ----------
    name : str
    truth, estimate : float
        In the parameter's unit (pixels, or dimensionless for the lens).
    sigma : float
        Standard deviation of the difference: the estimate's, together with the other's if that is an estimate as well;
        NaN if the parameter was not solved for.
    """

    name: str
    truth: float
    estimate: float
    sigma: float

    @property
    def error(self) -> float:
        """Estimate minus truth."""
        return self.estimate - self.truth

    @property
    def error_in_sigma(self) -> float:
        """Error over its standard deviation; NaN where that is not known."""
        return self.error / self.sigma if self.sigma > 0 else float("nan")


def parameter_errors(truth: Intrinsics, estimate: Intrinsics) -> tuple[ParameterError, ...]:
    """Compare every intrinsic that is free in the estimate or not zero in either camera."""
    other = truth.sigma
    sigma = {name: float(np.hypot(value, other.get(name, 0.0))) for name, value in estimate.sigma.items()}
    names = estimate.camera.intrinsic_names
    rows = zip(names, truth.camera.intrinsics.tolist(), estimate.camera.intrinsics.tolist(), strict=True)
    return tuple(
        ParameterError(name, true, value, sigma.get(name, float("nan")))
        for name, true, value in rows
        if name in sigma or true or value
    )


@dataclass(frozen=True, slots=True)
class ViewErrors:
    """How far the views of an estimate are from the truth.

    Attributes
    ----------
    views, corners : int
        How many were in both.
    corner_rms_px : float
        Root mean square of the corner errors per axis, pixels; NaN without corners in common.
    corner_bias_px : tuple of float
        Mean corner error in x and y, pixels.
    corner_max_px : float
        Largest corner error (length), pixels.
    rotation_deg : float
        Root mean square angle between the boards' orientations; NaN without poses in common.
    translation_m : float
        Root mean square distance between the boards' origins.
    """

    views: int
    corners: int
    corner_rms_px: float
    corner_bias_px: tuple[float, float]
    corner_max_px: float
    rotation_deg: float
    translation_m: float


@dataclass(frozen=True, slots=True, eq=False)
class PosedView:
    """A view as far as a comparison needs it: its corners, and its pose where that is known."""

    detection: Detection
    T_cam_board: Pose | None


def view_errors(truth: Mapping[str, PosedView], estimate: Mapping[str, PosedView], board: Board) -> ViewErrors | None:
    """Compare corners and poses of the views that both have, by name; None if there are none.

    A board that looks the same after a turn is compared with the turn that fits best.
    """
    corner_errors, turns, shifts = [], [], []
    common = sorted(truth.keys() & estimate.keys())
    for name in common:
        errors, motion = _closest(truth[name], estimate[name], board)
        corner_errors.append(errors)
        if motion is not None:
            turns.append(motion[0])
            shifts.append(motion[1])
    if not common:
        return None
    every = np.concatenate(corner_errors)
    some = every.shape[0] > 0
    bias = every.mean(axis=0) if some else np.full(2, np.nan)
    return ViewErrors(
        views=len(common),
        corners=every.shape[0],
        corner_rms_px=float(np.sqrt((every**2).mean())) if some else float("nan"),
        corner_bias_px=(float(bias[0]), float(bias[1])),
        corner_max_px=float(np.linalg.norm(every, axis=1).max()) if some else float("nan"),
        rotation_deg=_root_mean_square(turns),
        translation_m=_root_mean_square(shifts),
    )


def _closest(truth: PosedView, estimate: PosedView, board: Board) -> tuple[FloatArray, tuple[float, float] | None]:
    """Corner errors (N, 2) and the pose's (angle in degrees, distance in metres), for the board's best-fitting turn."""
    turns: list[tuple[IntArray, Pose]] = [(np.arange(board.feature_count), Pose.identity())]
    turns += [(symmetry.ids, symmetry.T_board_board) for symmetry in board.symmetries]
    best_errors, best_turn = np.zeros((0, 2)), Pose.identity()
    best = float("inf")
    for permutation, T_board_board in turns:
        errors = _corner_errors(truth.detection, estimate.detection, permutation)
        size = float((errors**2).mean()) if errors.size else float("inf")
        if size < best:
            best_errors, best_turn, best = errors, T_board_board, size
    if truth.T_cam_board is None or estimate.T_cam_board is None:
        return best_errors, None
    # The estimate's feature i stands where the truth's feature ids[i] does.
    expected = truth.T_cam_board @ best_turn
    off = expected.inverse() @ estimate.T_cam_board
    return best_errors, (off.angle_deg, float(np.linalg.norm(estimate.T_cam_board.t - expected.t)))


def _corner_errors(truth: Detection, estimate: Detection, permutation: IntArray) -> FloatArray:
    """Estimate minus truth of the corners that both saw, shape (N, 2), with the estimate's ids permuted."""
    _, in_truth, in_estimate = np.intersect1d(truth.ids, permutation[estimate.ids], return_indices=True)
    errors: FloatArray = estimate.corners_px[in_estimate] - truth.corners_px[in_truth]
    return errors


def _root_mean_square(values: Sequence[float]) -> float:
    """Root mean square; NaN of nothing."""
    return float(np.sqrt(np.mean(np.square(values)))) if values else float("nan")
