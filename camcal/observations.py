"""What passes between the stages: a detected view, a rejected one, a rendered one, and a finished calibration."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import FloatArray, IntArray, frozen_floats, frozen_ints
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose

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
        Standard deviation of each corner per axis in pixels; NaN where it is not known.
    notes : tuple of str
        What a person should know about the view ("blurred: ..."), each a short clause.
    edge_width_px : float
        Typical width of the pattern's edges in pixels, to tell blurred views from the others; NaN where it is not known.
    """

    source: str
    size: tuple[int, int]
    ids: IntArray
    corners_px: FloatArray
    sigma_px: FloatArray
    notes: tuple[str, ...] = ()
    edge_width_px: float = float("nan")

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", frozen_ints(self.ids, (None,), "ids"))
        count = self.ids.size
        object.__setattr__(self, "corners_px", frozen_floats(self.corners_px, (count, 2), "corners_px"))
        object.__setattr__(self, "sigma_px", frozen_floats(self.sigma_px, (count,), "sigma_px", finite=False))
        if (np.diff(self.ids) <= 0).any():
            raise ValueError(f"ids: must increase (got {self.ids.tolist()})")

    def __len__(self) -> int:
        """Return the number of corners."""
        return int(self.ids.size)


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


@dataclass(frozen=True, slots=True, eq=False)
class Intrinsics:
    """A camera and how well it is known: what a camera file holds, be it the truth or an estimate.

    Attributes
    ----------
    camera : Camera
    name : str
        Name of the camera or the scenario.
    board : str
        SPEC of the board it was calibrated with; empty if none is known.
    free : tuple of str
        Names of the intrinsics that were solved for (a subset of `camera.intrinsic_names`, in that order); empty for a truth.
    covariance : ndarray of shape (F, F)
        Covariance of the free intrinsics, in the squares of their units; shape (0, 0) for a truth.
    rms_px : float
        Root mean square of the 2-D residual length per corner in pixels; NaN for a truth.
    views, corners : int
        How many went into the solve.
    problems : tuple of str
        Why the result must not be trusted, in order of weight; empty if no gate failed.
    """

    camera: Camera
    name: str = "camera"
    board: str = ""
    free: tuple[str, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    rms_px: float = float("nan")
    views: int = 0
    corners: int = 0
    problems: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.free)
        object.__setattr__(self, "covariance", frozen_floats(self.covariance, (count, count), "covariance", finite=False))

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviation of each free intrinsic, in its unit, by name."""
        return dict(zip(self.free, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class ViewRecord:
    """One view as a views file holds it.

    Attributes
    ----------
    source : str
        Name of the image.
    reason : str
        Why the view was rejected; empty for a used one.
    T_cam_board : Pose or None
        Board to camera; None for a rejected view.
    rms_px : float
        The view's own RMS in pixels; NaN for a truth or a rejected view.
    corners : int
        Number of features seen.
    notes : tuple of str
        Notes of its detection.
    """

    source: str
    reason: str = ""
    T_cam_board: Pose | None = None
    rms_px: float = float("nan")
    corners: int = 0
    notes: tuple[str, ...] = ()

    @property
    def used(self) -> bool:
        """Whether the view went into the solve."""
        return not self.reason


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """A solved camera with everything that led to it.

    Attributes
    ----------
    camera : Camera
    free : tuple of str
        Names of the intrinsics that were solved for, in the order of `camera.intrinsic_names`.
    covariance : ndarray of shape (F, F)
        Covariance of the free intrinsics, in the squares of their units.
    detections : tuple of Detection
        The views that were used, sorted by source.
    poses : tuple of Pose
        T_cam_board of each of them.
    pose_sigmas : ndarray of shape (V, 6)
        Standard deviations of each view's rvec (radians) and t (metres).
    residuals_px : tuple of ndarray
        Seen minus projected corner of each view, shape (N, 2), pixels.
    rejected : tuple of Rejected
        The images that gave no view.
    """

    camera: Camera
    free: tuple[str, ...]
    covariance: FloatArray
    detections: tuple[Detection, ...]
    poses: tuple[Pose, ...]
    pose_sigmas: FloatArray
    residuals_px: tuple[FloatArray, ...]
    rejected: tuple[Rejected, ...] = ()

    def __post_init__(self) -> None:
        free, views = len(self.free), len(self.detections)
        object.__setattr__(self, "covariance", frozen_floats(self.covariance, (free, free), "covariance"))
        object.__setattr__(self, "pose_sigmas", frozen_floats(self.pose_sigmas, (views, 6), "pose_sigmas"))
        residuals = tuple(
            frozen_floats(residual, (len(detection), 2), "residuals_px")
            for residual, detection in zip(self.residuals_px, self.detections, strict=True)
        )
        object.__setattr__(self, "residuals_px", residuals)

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
