"""What a pinhole does to planes, directions and angles: plane homography, vanishing points, horizon, field of view.

Source of the formulas: Hartley and Zisserman 2004, "Multiple View Geometry", sections 8.1.1 and 8.6.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import FloatArray
from camcal.geometry.pose import Pose

# Ratio of singular values at which points count as degenerate: three of four within some 1e-4 px of a line.
_DEGENERATE = 1e-7


def plane_homography(K: npt.ArrayLike, T_cam_plane: Pose) -> FloatArray:
    """Homography from a plane's (x, y, 1), in metres on its z = 0, to pixels (before distortion): K [r1 r2 t].

    Parameters
    ----------
    K : array_like of shape (3, 3)
        Intrinsic matrix in pixels.
    T_cam_plane : Pose
        Maps points of the plane's frame to the camera.

    Returns
    -------
    ndarray of shape (3, 3)
    """
    H: FloatArray = np.asarray(K, dtype=np.float64) @ np.column_stack([T_cam_plane.R[:, 0], T_cam_plane.R[:, 1], T_cam_plane.t])
    return H


def apply_homography(H: npt.ArrayLike, points: npt.ArrayLike) -> FloatArray:
    """Map points of shape (..., 2) through homographies of shape (..., 3, 3) that broadcast against them.

    Points that land at infinity or on its far side (third coordinate <= 0) are NaN.
    """
    matrix = np.asarray(H, dtype=np.float64)
    xy = np.asarray(points, dtype=np.float64)
    mapped = (matrix[..., :2] @ xy[..., None])[..., 0] + matrix[..., 2]
    w = mapped[..., 2:]
    result: FloatArray = mapped[..., :2] / np.where(w > 0, w, np.nan)
    return result


def vanishing_point(K: npt.ArrayLike, direction_cam: npt.ArrayLike) -> FloatArray:
    """Pixel where parallel lines of a direction meet.

    Parameters
    ----------
    K : array_like of shape (3, 3)
    direction_cam : array_like of shape (3,)
        Direction in the camera frame; its sign and length do not matter.

    Returns
    -------
    ndarray of shape (2,)
        Pixel (before distortion); NaN when the direction is parallel to the image.
    """
    x, y, w = np.asarray(K, dtype=np.float64) @ np.asarray(direction_cam, dtype=np.float64)
    return np.array([x / w, y / w]) if w != 0 else np.full(2, np.nan)


def horizon(K: npt.ArrayLike, normal_cam: npt.ArrayLike) -> FloatArray:
    """Line on which every direction within a plane vanishes.

    Parameters
    ----------
    K : array_like of shape (3, 3)
    normal_cam : array_like of shape (3,)
        Normal of the plane in the camera frame; its sign and length do not matter.

    Returns
    -------
    ndarray of shape (3,)
        (a, b, c) with a u + b v + c = 0 for pixels (u, v) before distortion, a² + b² = 1; NaN when the plane is
        parallel to the image.
    """
    line = np.linalg.solve(np.asarray(K, dtype=np.float64).T, np.asarray(normal_cam, dtype=np.float64))
    length = np.hypot(line[0], line[1])
    result: FloatArray = line / length if length > 0 else np.full(3, np.nan)
    return result


def field_of_view_deg(extent: float, focal_length: float) -> float:
    """Angle in degrees that a sensor of `extent` sees, centred behind a lens of `focal_length` (the same unit).

    Examples
    --------
    >>> round(field_of_view_deg(36, 35), 1), round(field_of_view_deg(36, 70), 1)
    (54.4, 28.8)
    """
    return float(np.degrees(2 * np.arctan2(extent / 2, focal_length)))


def homography_from_points(source: npt.ArrayLike, target: npt.ArrayLike) -> FloatArray:
    """Homography that maps source points onto target points, by the normalised direct linear transform.

    Parameters
    ----------
    source, target : array_like of shape (N, 2)
        At least four correspondences, no three of four on a line.

    Returns
    -------
    ndarray of shape (3, 3)
        Signed so that source points map to a positive third coordinate; NaN when the points are degenerate, too few
        or not finite.

    Notes
    -----
    Hartley and Zisserman 2004, algorithm 4.2.
    """
    a, b = np.asarray(source, dtype=np.float64), np.asarray(target, dtype=np.float64)
    if len(a) < 4 or not (np.isfinite(a).all() and np.isfinite(b).all()):
        return np.full((3, 3), np.nan)
    Ta, Tb = _centring(a), _centring(b)
    x, y = (a @ Ta[:2, :2] + Ta[:2, 2]).T
    u, v = (b @ Tb[:2, :2] + Tb[:2, 2]).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    rows_u = np.stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u], axis=-1)
    rows_v = np.stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v], axis=-1)
    system = np.concatenate([rows_u, rows_v])
    if not np.isfinite(system).all():
        return np.full((3, 3), np.nan)
    # The triangular factor has the same right singular vectors and stays small however many points there are.
    _, singular, vectors = np.linalg.svd(np.linalg.qr(system, mode="r"))
    if singular[7] <= _DEGENERATE * singular[0]:
        return np.full((3, 3), np.nan)
    H: FloatArray = np.linalg.inv(Tb) @ vectors[-1].reshape(3, 3) @ Ta
    return -H if np.median(a @ H[2, :2] + H[2, 2]) < 0 else H


def _centring(points: FloatArray) -> FloatArray:
    """Similarity (3, 3) that moves points (N, 2) to mean zero and mean distance √2."""
    centre = points.mean(axis=0)
    spread = np.linalg.norm(points - centre, axis=1).mean()
    s = np.sqrt(2) / spread if spread > 0 else np.nan
    return np.array([[s, 0, -s * centre[0]], [0, s, -s * centre[1]], [0, 0, 1]])
