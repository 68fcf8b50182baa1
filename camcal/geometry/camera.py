"""The camera: image size, intrinsic matrix K and lens; points in front of it to pixels and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import BoolArray, FloatArray, frozen_floats
from camcal.geometry.distortion import BrownConrady
from camcal.geometry.lens import Lens

PINHOLE_NAMES = ("fx", "fy", "cx", "cy", "skew")
"""Names of the intrinsics that K holds, in the order of `Camera.intrinsics`."""


@dataclass(frozen=True, slots=True, eq=False, repr=False, init=False)
class Camera:
    """A pinhole camera behind a lens.

    Attributes
    ----------
    size : tuple of int
        Image (width, height) in pixels.
    K : ndarray of shape (3, 3)
        [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] in pixels; the centre of the top-left pixel is (0, 0).
    lens : Lens
        The distortion.

    Raises
    ------
    ValueError
        If the size is not positive and whole, or K is not upper triangular with positive focal lengths and a last row of 0 0 1.

    Examples
    --------
    >>> camera = Camera((1000, 1000), [[1000, 0, 500], [0, 1000, 500], [0, 0, 1]])
    >>> camera.project([2, 3, 10]).tolist()
    [700.0, 800.0]
    """

    size: tuple[int, int]
    K: FloatArray
    lens: Lens

    def __init__(self, size: tuple[int, int], K: npt.ArrayLike, dist: npt.ArrayLike | Lens = ()) -> None:
        width, height = (int(n) for n in size)
        if width < 1 or height < 1 or (width, height) != tuple(size):
            raise ValueError(f"size: not an image size (got {size[0]} x {size[1]}, expected whole positive width and height)")
        matrix = frozen_floats(K, (3, 3), "K")
        if matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or matrix[1, 0] != 0 or matrix[2].tolist() != [0, 0, 1]:
            raise ValueError(
                f"K: not an intrinsic matrix (got {matrix.tolist()}, expected [[fx, s, cx], [0, fy, cy], [0, 0, 1]])"
            )
        lens = BrownConrady(np.asarray(dist)) if isinstance(dist, (np.ndarray, list, tuple)) else dist
        if not hasattr(lens, "distort"):
            raise ValueError(f"dist: not a lens (got {type(dist).__name__}, expected coefficients or a lens)")
        object.__setattr__(self, "size", (width, height))
        object.__setattr__(self, "K", matrix)
        object.__setattr__(self, "lens", lens)

    def __repr__(self) -> str:
        """One line: size, K's entries and every coefficient that is not zero."""
        values = dict(zip(self.intrinsic_names, self.intrinsics.tolist(), strict=True))
        shown = ", ".join(f"{name}={value:.6g}" for name, value in values.items() if value != 0)
        return f"Camera({self.size[0]}x{self.size[1]}, {shown})"

    @property
    def dist(self) -> FloatArray:
        """The lens coefficients as cv2 takes them: shape (8,), (k1, k2, p1, p2, k3, k4, k5, k6)."""
        return self.lens.coefficients

    @property
    def intrinsic_names(self) -> tuple[str, ...]:
        """Names of `intrinsics`: fx, fy, cx, cy, skew, then the lens's coefficients."""
        return PINHOLE_NAMES + self.lens.coefficient_names

    @property
    def intrinsics(self) -> FloatArray:
        """Every intrinsic as one vector of shape (5 + C,), in the order of `intrinsic_names`."""
        K = self.K
        return np.concatenate([[K[0, 0], K[1, 1], K[0, 2], K[1, 2], K[0, 1]], self.lens.coefficients])

    def with_intrinsics(self, values: npt.ArrayLike) -> Camera:
        """Return the camera of the same size and kind of lens with other `intrinsics`, shape (5 + C,)."""
        fx, fy, cx, cy, skew, *coefficients = np.asarray(values, dtype=np.float64).tolist()
        return Camera(self.size, [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], self.lens.with_coefficients(coefficients))

    def project(self, points_cam: npt.ArrayLike) -> FloatArray:
        """Project points to pixels.

        Parameters
        ----------
        points_cam : array_like of shape (..., 3)
            Points in the camera frame, metres.

        Returns
        -------
        ndarray of shape (..., 2)
            Pixels; NaN for a point on or behind the camera plane (Z <= 0) or past the fold of the lens.
        """
        return self.pixels_from_normalised(self.lens.distort(_normalised(points_cam)))

    def unproject(self, pixels: npt.ArrayLike) -> FloatArray:
        """Turn pixels into viewing rays.

        Parameters
        ----------
        pixels : array_like of shape (..., 2)

        Returns
        -------
        ndarray of shape (..., 3)
            Rays in the camera frame with z = 1; NaN where the lens lets nothing valid reach the pixel.
        """
        ideal = self.lens.undistort(self.normalised_from_pixels(pixels))
        rays = np.empty((*ideal.shape[:-1], 3))
        rays[..., :2] = ideal
        rays[..., 2] = np.where(np.isnan(ideal[..., 0]), np.nan, 1.0)
        return rays

    def project_with_jacobians(self, points_cam: npt.ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Project points and differentiate the pixels; the lens's formula is used past its fold too.

        Parameters
        ----------
        points_cam : array_like of shape (..., 3)
            Points in the camera frame, metres.

        Returns
        -------
        pixels : ndarray of shape (..., 2)
            NaN for Z <= 0.
        d_point : ndarray of shape (..., 2, 3)
            Pixels per metre of the point; NaN for Z <= 0.
        d_intrinsics : ndarray of shape (..., 2, 5 + C)
            Pixels per unit of each of `intrinsics`; NaN for Z <= 0.
        """
        points = np.asarray(points_cam, dtype=np.float64)
        ideal = _normalised(points)
        distorted = self.lens.distort_unchecked(ideal)
        z = np.where(points[..., 2] > 0, points[..., 2], np.nan)
        d_point = np.empty((*z.shape, 2, 3))
        d_point[..., :2] = self._pixels_per(self.lens.jacobian_points(ideal)) / z[..., None, None]
        d_point[..., 2] = -(d_point[..., :2] * ideal[..., None, :]).sum(axis=-1)
        d_intrinsics = np.zeros((*z.shape, 2, len(self.intrinsic_names)))
        d_intrinsics[..., 0, 0] = distorted[..., 0]
        d_intrinsics[..., 0, 4] = d_intrinsics[..., 1, 1] = distorted[..., 1]
        d_intrinsics[..., 0, 2] = d_intrinsics[..., 1, 3] = 1
        d_intrinsics[..., len(PINHOLE_NAMES) :] = self._pixels_per(self.lens.jacobian_coefficients(ideal))
        d_intrinsics[np.isnan(z)] = np.nan
        return self.pixels_from_normalised(distorted), d_point, d_intrinsics

    def _pixels_per(self, d_distorted: FloatArray) -> FloatArray:
        """Apply the linear part of K to derivatives (..., 2, M) of distorted normalised coordinates, in place."""
        d_distorted[..., 0, :] *= self.K[0, 0]
        if self.K[0, 1] != 0:
            d_distorted[..., 0, :] += self.K[0, 1] * d_distorted[..., 1, :]
        d_distorted[..., 1, :] *= self.K[1, 1]
        return d_distorted

    def pixels_from_normalised(self, distorted: npt.ArrayLike) -> FloatArray:
        """Apply K to distorted normalised coordinates of shape (..., 2)."""
        xy = np.asarray(distorted, dtype=np.float64)
        out = np.empty_like(xy)
        out[..., 0] = self.K[0, 0] * xy[..., 0] + self.K[0, 1] * xy[..., 1] + self.K[0, 2]
        out[..., 1] = self.K[1, 1] * xy[..., 1] + self.K[1, 2]
        return out

    def normalised_from_pixels(self, pixels: npt.ArrayLike) -> FloatArray:
        """Apply the inverse of K to pixels of shape (..., 2): distorted normalised coordinates."""
        uv = np.asarray(pixels, dtype=np.float64)
        out = np.empty_like(uv)
        out[..., 1] = (uv[..., 1] - self.K[1, 2]) / self.K[1, 1]
        out[..., 0] = (uv[..., 0] - self.K[0, 2] - self.K[0, 1] * out[..., 1]) / self.K[0, 0]
        return out

    def scaled(self, size: tuple[int, int]) -> Camera:
        """Return the camera of the same image resampled to another (width, height).

        The principal point moves as c' = (c + 0.5) s - 0.5, because pixel centres are whole numbers.
        """
        sx, sy = size[0] / self.size[0], size[1] / self.size[1]
        (fx, skew, cx), (_, fy, cy), _ = self.K.tolist()
        K = [[fx * sx, skew * sx, (cx + 0.5) * sx - 0.5], [0, fy * sy, (cy + 0.5) * sy - 0.5], [0, 0, 1]]
        return Camera(size, K, self.lens)

    def contains(self, pixels: npt.ArrayLike, margin_px: float = 0.0) -> BoolArray:
        """Tell which pixels of shape (..., 2) lie inside the image, at least `margin_px` from its outer edge."""
        uv = np.asarray(pixels, dtype=np.float64)
        low = -0.5 + margin_px
        high = np.array(self.size) - 0.5 - margin_px
        inside: BoolArray = np.all((uv >= low) & (uv <= high), axis=-1)
        return inside

    @property
    def valid_radius_px(self) -> float:
        """Distance in pixels from the principal point up to which every pixel has a ray; inf if the lens never turns back."""
        # K turns a circle into an ellipse; its half short axis is the smallest singular value.
        return self.lens.valid_radius_distorted * float(np.linalg.norm(self.K[:2, :2], -2))

    @property
    def field_of_view_deg(self) -> tuple[float, float, float]:
        """Horizontal, vertical and diagonal field of view in degrees, lens included; NaN where the lens has folded.

        Each is the angle between the rays of the outer image edges (corners for the diagonal) through the image centre.
        """
        width, height = self.size
        left, top, right, bottom = -0.5, -0.5, width - 0.5, height - 0.5
        middle_u, middle_v = (left + right) / 2, (top + bottom) / 2
        ends = np.array(
            [
                [[left, middle_v], [right, middle_v]],
                [[middle_u, top], [middle_u, bottom]],
                [[left, top], [right, bottom]],
            ]
        )
        rays = self.unproject(ends)
        rays = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        angle = np.degrees(2 * np.arcsin(np.linalg.norm(rays[:, 1] - rays[:, 0], axis=-1) / 2))
        return float(angle[0]), float(angle[1]), float(angle[2])


def _normalised(points_cam: npt.ArrayLike) -> FloatArray:
    """X / Z, Y / Z of points (..., 3); NaN where Z <= 0."""
    points = np.asarray(points_cam, dtype=np.float64)
    z = points[..., 2:]
    with np.errstate(over="ignore"):
        ideal: FloatArray = points[..., :2] / np.where(z > 0, z, np.nan)
    return ideal
