"""How far two cameras disagree over the image, and how far they should by their covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.errors import InputError
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import rotate_with_jacobian
from camcal.records import Intrinsics

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

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]])
    >>> longer = camcal.Camera((640, 480), [[525.2, 0, 322], [0, 528.23, 236], [0, 0, 1]])
    >>> round(camcal.projection_difference(camera, longer).max_px, 1)
    4.0
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


def predicted_difference_px(estimate: Intrinsics) -> FloatArray:
    """Predict how far an estimate's projection should be from the truth's, as `projection_difference` measures it.

    Parameters
    ----------
    estimate : Intrinsics
        With its covariance.

    Returns
    -------
    ndarray of shape (M,)
        Root mean square length of the difference at each pixel of the grid, in pixels; NaN where the lens has no answer.
    """
    camera = estimate.camera
    return predicted_length_px(camera, estimate.free, estimate.covariance, _image_grid(camera.size))


def predicted_length_px(camera: Camera, free: tuple[str, ...], covariance: FloatArray, pixels: FloatArray) -> FloatArray:
    """Predict how far apart two cameras see the same far points, after the rotation between them is fitted.

    The covariance is carried through the projection to first order, with the rotation that fits best projected out.

    Parameters
    ----------
    camera : Camera
    free : tuple of str
        Names of the intrinsics that differ.
    covariance : ndarray of shape (F, F)
        Of their differences.
    pixels : ndarray of shape (M, 2)
        Where; the rotation is the one that fits best there.

    Returns
    -------
    ndarray of shape (M,)
        Root mean square length of the difference at each pixel; NaN where the lens has no answer.
    """
    # Columns are scaled so that a covariance of very different units has a square root to full precision.
    sigma = np.sqrt(np.diag(covariance))
    scale = np.where(sigma > 0, sigma, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0))
    shifts = projection_shifts(camera, free, root.T, pixels)
    length: FloatArray = np.sqrt((shifts**2).sum(axis=(0, 2)))
    return length


def projection_shifts(camera: Camera, free: tuple[str, ...], changes: FloatArray, pixels: FloatArray) -> FloatArray:
    """Where far points move if intrinsics change a little, after the rotation that undoes most of it.

    Parameters
    ----------
    camera : Camera
    free : tuple of str
        Names of the intrinsics that change.
    changes : ndarray of shape (K, F)
        Changes of them, each row by itself.
    pixels : ndarray of shape (M, 2)
        Where the points are seen before; the rotation is the one that fits best there.

    Returns
    -------
    ndarray of shape (K, M, 2)
        To first order, in pixels; NaN where the lens has no answer.
    """
    rays = camera.unproject(pixels)
    valid = np.isfinite(rays[:, 0])
    turned, d_rvec = rotate_with_jacobian(np.zeros(3), rays[valid])
    _, d_point, d_intrinsics = camera.project_with_jacobians(turned)
    columns = [camera.intrinsic_names.index(name) for name in free]
    moved = d_intrinsics[..., columns].reshape(-1, len(columns)) @ changes.T
    basis, _ = np.linalg.qr((d_point @ d_rvec).reshape(-1, 3))
    moved -= basis @ (basis.T @ moved)
    shifts = np.full((len(changes), len(pixels), 2), np.nan)
    shifts[:, valid] = moved.T.reshape(len(changes), -1, 2)
    return shifts


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
