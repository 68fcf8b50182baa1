"""What passes between the stages: a detected view, a rejected one, a rendered one, and a finished calibration."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import BoolArray, FloatArray, IntArray, frozen_floats, frozen_ints
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.records import BoardShape

Image = npt.NDArray[Any]
"""An image of shape (height, width) or (height, width, channels), uint8, uint16 or float32."""


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """The features of one board seen in one image: any subset of them.

    Attributes
    ----------
    source : str
        Name of the image.
    size : tuple of int
        Image (width, height) in pixels.
    ids : ndarray of shape (N,)
        Feature ids, int64, increasing, each at most once.
    corners_px : ndarray of shape (N, 2)
        Where each feature was seen, in pixels.
    sigma_px : ndarray of shape (N,)
        Standard deviation of each corner per axis in pixels, or one number for all; NaN, the default, where it is not known.
    notes : tuple of str
        What a person should know about the view ("blurred: ..."), each a short clause.
    edge_width_px : float
        Typical width of the pattern's edges in pixels, to tell blurred views from the others; NaN where it is not known.
    """

    source: str
    size: tuple[int, int]
    ids: IntArray
    corners_px: FloatArray
    sigma_px: FloatArray = field(default_factory=lambda: np.array(np.nan))
    notes: tuple[str, ...] = ()
    edge_width_px: float = float("nan")

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", frozen_ints(self.ids, (None,), "ids"))
        count = self.ids.size
        object.__setattr__(self, "corners_px", frozen_floats(self.corners_px, (count, 2), "corners_px"))
        sigma_px = np.full(count, self.sigma_px) if np.ndim(self.sigma_px) == 0 else self.sigma_px
        object.__setattr__(self, "sigma_px", frozen_floats(sigma_px, (count,), "sigma_px", finite=False))
        if (np.diff(self.ids) <= 0).any():
            raise ValueError(f"ids: must increase (got {self.ids.tolist()})")

    def __len__(self) -> int:
        """Return the number of corners."""
        return int(self.ids.size)

    def take(self, keep: BoolArray) -> Detection:
        """Return the same view with some of its corners, shape (N,)."""
        return replace(self, ids=self.ids[keep], corners_px=self.corners_px[keep], sigma_px=self.sigma_px[keep])


@dataclass(frozen=True, slots=True)
class Rejected:
    """An image that gave no usable view.

    Attributes
    ----------
    source : str
        Name of the image.
    reason : str
        Why, as a clause that a person can act on.
    """

    source: str
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A rendered image and its truth.

    Attributes
    ----------
    image : ndarray of shape (height, width)
        uint8 or uint16.
    T_cam_board : Pose
        Where the board stands.
    detection : Detection
        Every feature whose true position lies inside the image.
    """

    image: Image
    T_cam_board: Pose
    detection: Detection


@dataclass(frozen=True, slots=True)
class Outlier:
    """A corner that was seen but left out of the solve.

    Attributes
    ----------
    source : str
        Name of the image.
    id : int
        Feature id.
    corner_px : tuple of float
        Where it was seen.
    sigma_px : float
        Its standard deviation per axis as the refinement gave it, pixels; NaN where it is not known.
    residual_px : tuple of float
        Seen minus projected, pixels.
    reason : str
        Why, as a clause.
    """

    source: str
    id: int
    corner_px: tuple[float, float]
    sigma_px: float
    residual_px: tuple[float, float]
    reason: str


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """A solved camera with everything that led to it.

    Attributes
    ----------
    camera : Camera
    free : tuple of str
        Names of the intrinsics that were solved for, in the order of `camera.intrinsic_names`.
    joint_covariance : ndarray of shape (F + 6, F + 6)
        Covariance of the free intrinsics and of the boards' mean motion in the camera frame: a rotation vector (radians)
        and a translation (metres) about the camera's centre. The two go together: a calibration cannot tell a small turn
        of the camera from a shift of its principal point.
    detections : tuple of Detection
        The views that were used, with the corners that were used, sorted by source.
    poses : tuple of Pose
        T_cam_board of each of them.
    pose_sigmas : ndarray of shape (V, 6)
        Standard deviations of each view's rvec (radians) and t (metres).
    residuals_px : tuple of ndarray
        Seen minus projected corner of each view, shape (N, 2), pixels.
    shape : BoardShape
        What was solved for of the board's own shape.
    outliers : tuple of Outlier
        Corners that were left out: single ones of used views, and all of views that do not fit the others.
    rejected : tuple of Rejected
        The images that gave no view.
    """

    camera: Camera
    free: tuple[str, ...]
    joint_covariance: FloatArray
    detections: tuple[Detection, ...]
    poses: tuple[Pose, ...]
    pose_sigmas: FloatArray
    residuals_px: tuple[FloatArray, ...]
    shape: BoardShape = field(default_factory=BoardShape)
    outliers: tuple[Outlier, ...] = ()
    rejected: tuple[Rejected, ...] = ()

    def __post_init__(self) -> None:
        joint, views = len(self.free) + 6, len(self.detections)
        object.__setattr__(self, "joint_covariance", frozen_floats(self.joint_covariance, (joint, joint), "joint_covariance"))
        object.__setattr__(self, "pose_sigmas", frozen_floats(self.pose_sigmas, (views, 6), "pose_sigmas"))
        residuals = tuple(
            frozen_floats(residual, (len(detection), 2), "residuals_px")
            for residual, detection in zip(self.residuals_px, self.detections, strict=True)
        )
        object.__setattr__(self, "residuals_px", residuals)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the free intrinsics, shape (F, F), in the squares of their units."""
        return self.joint_covariance[: len(self.free), : len(self.free)]

    @property
    def rms_px(self) -> float:
        """Root mean square of the 2-D residual length over all corners, pixels (OpenCV's figure)."""
        return _rms(np.concatenate(self.residuals_px))

    @property
    def view_rms_px(self) -> tuple[float, ...]:
        """The same for each view."""
        return tuple(_rms(residual) for residual in self.residuals_px)

    @property
    def corner_count(self) -> int:
        """Number of corners in the solve."""
        return sum(len(detection) for detection in self.detections)


def _rms(residual_px: FloatArray) -> float:
    """Root mean square length of the rows of (N, 2)."""
    return float(np.sqrt((residual_px**2).sum(axis=1).mean()))
