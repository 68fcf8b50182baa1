"""What is kept of a calibration: a camera and how well it is known, its board's shape, and its views one by one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from camcal.geometry.arrays import FloatArray, frozen_floats
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.verdict import Verdict


@dataclass(frozen=True, slots=True, eq=False)
class BoardShape:
    """How a real board was found to differ from a flat and true print.

    Attributes
    ----------
    names : tuple of str
        What was solved for: `bow_x`, `bow_y` (height in metres of the bow in the middle of the board, along x and along y,
        positive into the board) and `stretch` (of y against x, dimensionless).
    values : ndarray of shape (S,)
    covariance : ndarray of shape (S, S)
    """

    names: tuple[str, ...] = ()
    values: FloatArray = field(default_factory=lambda: np.zeros(0))
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        count = len(self.names)
        object.__setattr__(self, "values", frozen_floats(self.values, (count,), "values"))
        object.__setattr__(self, "covariance", frozen_floats(self.covariance, (count, count), "covariance"))

    @property
    def sigma(self) -> FloatArray:
        """Standard deviation of each value, shape (S,)."""
        sigma: FloatArray = np.sqrt(np.diag(self.covariance))
        return sigma


@dataclass(frozen=True, slots=True)
class ImageSigma:
    """Standard deviation of the projection over an image, in pixels along its worst direction; NaN where there is no ray.

    Attributes
    ----------
    centre_px : float
    edges_px : tuple of float
        At the middle of the top, right, bottom and left edge.
    corners_px : tuple of float
        At the top-left, top-right, bottom-right and bottom-left corner.
    shares : tuple of float
        Share of the image where it is below 0.1, 0.5 and 1 px.
    """

    centre_px: float
    edges_px: tuple[float, float, float, float]
    corners_px: tuple[float, float, float, float]
    shares: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """How well a calibration knows where a point is seen.

    Attributes
    ----------
    range_m : float
        Distance at which the boards stood (median).
    at_range, at_infinity : ImageSigma
        For points as far away as the boards, and infinitely far ones.
    """

    range_m: float
    at_range: ImageSigma
    at_infinity: ImageSigma


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
    shape : BoardShape
        What was found about the board's own shape.
    uncertainty : Uncertainty or None
        None for a truth.
    cross_validation : float
        Difference of halves of the views over its prediction, about 1 if the uncertainty is honest; NaN where unknown.
    verdict : Verdict or None
        None if nobody judged it.
    cautions : tuple of str
        What the file that it was read from says and a camera cannot hold, for whoever uses it; nothing that is saved.
    """

    camera: Camera
    name: str = "camera"
    board: str = ""
    free: tuple[str, ...] = ()
    covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    rms_px: float = float("nan")
    views: int = 0
    corners: int = 0
    shape: BoardShape = field(default_factory=BoardShape)
    uncertainty: Uncertainty | None = None
    cross_validation: float = float("nan")
    verdict: Verdict | None = None
    cautions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.free)
        object.__setattr__(self, "covariance", frozen_floats(self.covariance, (count, count), "covariance", finite=False))

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviation of each free intrinsic, in its unit, by name."""
        return dict(zip(self.free, np.sqrt(np.diag(self.covariance)).tolist(), strict=True))

    @property
    def problems(self) -> tuple[str, ...]:
        """Why it must not be trusted, in order of weight; empty unless it was rejected."""
        return () if self.verdict is None else self.verdict.problems


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
    path : str
        Where its image is, with forward slashes, relative to the folder of the views file; empty if that is not known.
    """

    source: str
    reason: str = ""
    T_cam_board: Pose | None = None
    rms_px: float = float("nan")
    corners: int = 0
    notes: tuple[str, ...] = ()
    path: str = ""

    @property
    def used(self) -> bool:
        """Whether the view went into the solve."""
        return not self.reason
