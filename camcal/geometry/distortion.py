"""The Brown-Conrady lens: radial (plumb bob or rational) and tangential distortion, as OpenCV names and orders it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from camcal.geometry import formula
from camcal.geometry.arrays import BoolArray, FloatArray, frozen_floats
from camcal.geometry.fold import find_fold, inside_fold
from camcal.geometry.inversion import invert
from camcal.geometry.lens import Lens

__all__ = ["BrownConrady", "Lens"]

# Points are worked through in blocks that fit a core's cache: faster, and 12 million of them need no gigabytes.
_BLOCK = 1 << 16
_LARGEST_COEFFICIENT = 1e15


@dataclass(frozen=True, slots=True, eq=False)
class BrownConrady:
    """Radial (rational), tangential lens: x_d = x N(r²) / D(r²) + tangential.

    N = 1 + k1 r² + k2 r⁴ + k3 r⁶, D = 1 + k4 r² + k5 r⁴ + k6 r⁶; the tangential terms are
    (2 p1 x y + p2 (r² + 2 x²), p1 (r² + 2 y²) + 2 p2 x y).

    Attributes
    ----------
    coefficients : ndarray of shape (8,)
        (k1, k2, p1, p2, k3, k4, k5, k6), OpenCV's order, dimensionless. Fewer values are filled up with zeros.

    Raises
    ------
    ValueError
        If there are more than 8 coefficients, or one is not finite or absurdly large (above 1e15).

    Examples
    --------
    >>> barrel = BrownConrady([-0.1, 0.0])
    >>> barrel.distort([0.5, 0.0]).tolist()
    [0.4875, 0.0]
    >>> round(barrel.valid_radius, 6)  # 1 - 0.3 r² = 0
    1.825742
    """

    coefficients: FloatArray

    def __post_init__(self) -> None:
        given = np.asarray(self.coefficients, dtype=np.float64).ravel()
        if given.size > 8:
            raise ValueError(f"dist: too many coefficients (got {given.size}, expected at most 8: k1 k2 p1 p2 k3 k4 k5 k6)")
        full = frozen_floats(np.pad(given, (0, 8 - given.size)), (8,), "dist")
        if np.abs(full).max() > _LARGEST_COEFFICIENT:
            raise ValueError(f"dist: not a lens (got a coefficient of {full[np.abs(full).argmax()]:g})")
        object.__setattr__(self, "coefficients", full)

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """Names of the eight coefficients, in OpenCV's order."""
        return ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")

    def with_coefficients(self, coefficients: npt.ArrayLike) -> BrownConrady:
        """Return a Brown-Conrady lens with other coefficients."""
        return BrownConrady(np.asarray(coefficients, dtype=np.float64))

    @property
    def is_identity(self) -> bool:
        """Whether the lens changes nothing."""
        return not self.coefficients.any()

    @property
    def valid_radius(self) -> float:
        """Smallest undistorted radius at which the Jacobian's determinant turns zero; inf if it never does."""
        return find_fold(tuple(self.coefficients.tolist())).radius

    @property
    def valid_radius_distorted(self) -> float:
        """Distorted radius up to which every point has an undistorted one; inf if the lens never turns back."""
        return find_fold(tuple(self.coefficients.tolist())).radius_distorted

    def distort(self, points: npt.ArrayLike) -> FloatArray:
        """Distort points.

        Parameters
        ----------
        points : array_like of shape (..., 2)
            Ideal normalised coordinates.

        Returns
        -------
        ndarray of shape (..., 2)
            Distorted normalised coordinates; NaN past the fold, that is wherever the Jacobian's determinant is not
            positive all the way from the centre to the point.
        """
        xy = np.asarray(points, dtype=np.float64)
        return xy.copy() if self.is_identity else _in_blocks(self._distort, xy)

    def is_valid(self, points: npt.ArrayLike) -> BoolArray:
        """Tell for undistorted points of shape (..., 2) whether they lie inside the fold (NaN does not): shape (...)."""
        xy = np.asarray(points, dtype=np.float64)
        with np.errstate(all="ignore"):
            inside = inside_fold(self.coefficients, xy[..., 0].ravel(), xy[..., 1].ravel())
        return inside.reshape(xy.shape[:-1])

    def undistort(self, points: npt.ArrayLike) -> FloatArray:
        """Invert the lens, to the last bits.

        Parameters
        ----------
        points : array_like of shape (..., 2)
            Distorted normalised coordinates.

        Returns
        -------
        ndarray of shape (..., 2)
            Ideal normalised coordinates inside the fold; NaN where no such point maps to the given one.
        """
        xy_d = np.asarray(points, dtype=np.float64)
        return xy_d.copy() if self.is_identity else _in_blocks(lambda block: invert(self.coefficients, block), xy_d)

    def distort_unchecked(self, points: npt.ArrayLike) -> FloatArray:
        """Evaluate the bare formula for points of shape (..., 2), past the fold too."""
        xy = np.asarray(points, dtype=np.float64)
        return np.stack(formula.distorted(self.coefficients, xy[..., 0], xy[..., 1]), axis=-1)

    def jacobian_points(self, points: npt.ArrayLike) -> FloatArray:
        """Differentiate the bare formula by the point, for points of shape (..., 2): shape (..., 2, 2), symmetric."""
        xy = np.asarray(points, dtype=np.float64)
        out = np.empty((*xy.shape, 2))
        out[..., 0, 0], out[..., 0, 1], out[..., 1, 1] = formula.jacobian(self.coefficients, xy[..., 0], xy[..., 1])
        out[..., 1, 0] = out[..., 0, 1]
        return out

    def jacobian_coefficients(self, points: npt.ArrayLike) -> FloatArray:
        """Differentiate the bare formula by (k1, k2, p1, p2, k3, k4, k5, k6): shape (..., 2, 8) for points (..., 2)."""
        xy = np.asarray(points, dtype=np.float64)
        x, y = xy[..., 0], xy[..., 1]
        s = x * x + y * y
        N, D = formula.numerator_and_denominator(self.coefficients, s)
        out = np.empty((*xy.shape, 8))
        power = xy / D[..., None]
        for numerator, denominator in ((0, 5), (1, 6), (4, 7)):
            power = power * s[..., None]
            out[..., numerator] = power
            out[..., denominator] = -power * (N / D)[..., None]
        out[..., 0, 2] = out[..., 1, 3] = 2 * x * y
        out[..., 0, 3] = s + 2 * x * x
        out[..., 1, 2] = s + 2 * y * y
        return out

    def _distort(self, block: FloatArray) -> FloatArray:
        """Distort points (N, 2); NaN past the fold."""
        x, y = block.T.copy()
        out = np.stack(formula.distorted(self.coefficients, x, y), axis=-1)
        out[~inside_fold(self.coefficients, x, y)] = np.nan
        return out


def _in_blocks(function: Callable[[FloatArray], FloatArray], points: FloatArray) -> FloatArray:
    """Apply a function of points (N, 2) to points (..., 2), block by block.

    Overflow and division by zero are silent: they end in NaN, which is the answer there.
    """
    flat = points.reshape(-1, 2)
    out = np.empty_like(flat)
    with np.errstate(all="ignore"):
        for start in range(0, len(flat), _BLOCK):
            out[start : start + _BLOCK] = function(flat[start : start + _BLOCK])
    return out.reshape(points.shape)
