"""How well a calibration knows where a point is seen: the covariance of its projection, carried to any pixel.

A calibration cannot tell a small turn of the camera from a shift of its principal point: the poses of the boards make up for
one with the other. So a pixel's point is moved along with the boards, by the motion that their poses share, before it is
projected with the other camera: without that compensation the figure would say nothing about measuring with the camera.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import FloatArray
from camcal.geometry.pose import cross_matrix
from camcal.observations import Calibration
from camcal.records import ImageSigma, Uncertainty

SHARE_LIMITS_PX = (0.1, 0.5, 1.0)
"""The image's share below each of these is reported."""

_GRID_COLUMNS = 40


def projection_covariance(calibration: Calibration, pixels: npt.ArrayLike, range_m: float) -> FloatArray:
    """Covariance of where the points behind some pixels are seen.

    To first order q = π(k, p) moves by dπ/dk dk + dπ/dp (-[p]x w + v), where (w, v) is the boards' mean motion.

    Parameters
    ----------
    calibration : Calibration
    pixels : array_like of shape (M, 2)
    range_m : float
        Distance of the points from the camera in metres; inf is allowed.

    Returns
    -------
    ndarray of shape (M, 2, 2)
        px²; NaN where no ray reaches the pixel.
    """
    camera = calibration.camera
    rays = camera.unproject(pixels)
    rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    # At infinity a direction stands for the point: it turns, and no translation moves it.
    points = rays if np.isinf(range_m) else rays * range_m
    _, d_point, d_intrinsics = camera.project_with_jacobians(points)
    columns = [camera.intrinsic_names.index(name) for name in calibration.free]
    d_shift = np.zeros_like(d_point) if np.isinf(range_m) else d_point
    J = np.concatenate([d_intrinsics[..., columns], -d_point @ cross_matrix(points), d_shift], axis=-1)
    # Scaled, because the units of focal lengths, coefficients and angles lie many orders of magnitude apart.
    sigma = np.sqrt(np.diag(calibration.joint_covariance))
    scale = np.where(sigma > 0, sigma, 1.0)
    correlation = calibration.joint_covariance / np.outer(scale, scale)
    J = J * scale
    covariance: FloatArray = J @ correlation @ np.swapaxes(J, -1, -2)
    return covariance


def projection_sigma(calibration: Calibration, pixels: npt.ArrayLike, range_m: float) -> FloatArray:
    """Standard deviation of where the points behind some pixels are seen, along the worst direction.

    Parameters
    ----------
    calibration : Calibration
        Of a run of `calibrate`: a camera file does not hold all that this takes, its corners.csv does.
    pixels : array_like of shape (M, 2)
    range_m : float
        Distance of the points from the camera in metres; inf is allowed.

    Returns
    -------
    ndarray of shape (M,)
        Square root of the largest eigenvalue of `projection_covariance`, px; NaN where no ray reaches the pixel.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> turns = [(0.5, 0, 0), (-0.5, 0, 0), (0, 0.5, 0), (0, -0.5, 0), (0.4, 0.4, 0), (-0.4, 0.3, 0.1)]
    >>> poses = [camcal.Pose.from_rvec(turn, (-0.06, -0.05, 0.25)) for turn in turns]
    >>> images = [camcal.render(camera, "checkerboard:7x6:20mm", pose) for pose in poses]
    >>> run = camcal.calibrate(images, "checkerboard:7x6:20mm", distortion="k1,k2")
    >>> middle, corner = camcal.projection_sigma(run.calibration, [[320, 240], [0, 0]], range_m=0.3)
    >>> bool(10 * middle < corner)
    True
    """
    covariance = projection_covariance(calibration, pixels, range_m)
    a, b, c = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    sigma: FloatArray = np.sqrt((a + c) / 2 + np.hypot((a - c) / 2, b))
    return sigma


def board_range_m(calibration: Calibration, object_points: FloatArray) -> float:
    """Median distance of the boards' centres from the camera, metres."""
    centre = (object_points.min(axis=0) + object_points.max(axis=0)) / 2
    return float(np.median([np.linalg.norm(pose.apply(centre)) for pose in calibration.poses]))


def uncertainty(calibration: Calibration, object_points: FloatArray) -> Uncertainty:
    """Describe the projection's standard deviation over the image, at the boards' range and at infinity.

    Parameters
    ----------
    calibration : Calibration
    object_points : ndarray of shape (N, 3)
        The board's features in metres.
    """
    range_m = board_range_m(calibration, object_points)
    return Uncertainty(range_m, _over_image(calibration, range_m), _over_image(calibration, float("inf")))


def image_grid(size: tuple[int, int], columns: int = _GRID_COLUMNS) -> FloatArray:
    """Regular grid of pixels (M, 2): the centres of cells of roughly square shape that tile an image (width, height)."""
    width, height = size
    rows = max(1, round(columns * height / width))
    u, v = np.meshgrid((np.arange(columns) + 0.5) / columns * width - 0.5, (np.arange(rows) + 0.5) / rows * height - 0.5)
    return np.stack([u.ravel(), v.ravel()], axis=-1)


def _over_image(calibration: Calibration, range_m: float) -> ImageSigma:
    """Standard deviations at the places that are reported, and shares of the image."""
    width, height = calibration.camera.size
    right, bottom = width - 1.0, height - 1.0
    middle, centre = right / 2, bottom / 2
    places = [(middle, centre), (middle, 0), (right, centre), (middle, bottom), (0, centre)]
    places += [(0, 0), (right, 0), (right, bottom), (0, bottom)]
    at = projection_sigma(calibration, np.array(places), range_m).tolist()
    everywhere = projection_sigma(calibration, image_grid(calibration.camera.size), range_m)
    with np.errstate(invalid="ignore"):
        below = [float((everywhere < limit).mean()) for limit in SHARE_LIMITS_PX]
    return ImageSigma(
        centre_px=at[0],
        edges_px=(at[1], at[2], at[3], at[4]),
        corners_px=(at[5], at[6], at[7], at[8]),
        shares=(below[0], below[1], below[2]),
    )
