"""What the rest of camcal asks of a lens, whichever its model."""

from __future__ import annotations

from typing import Protocol

import numpy.typing as npt

from camcal.geometry.arrays import FloatArray


class Lens(Protocol):
    """A map from ideal normalised coordinates (X / Z, Y / Z) to distorted ones; all are dimensionless.

    It is one-to-one only up to where it turns back on itself (folds); past that it answers NaN, never nonsense.
    """

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """Names of the coefficients, in stored order."""
        ...

    @property
    def coefficients(self) -> FloatArray:
        """Coefficients of shape (C,), in stored order."""
        ...

    @property
    def valid_radius(self) -> float:
        """Smallest undistorted radius at which the lens turns back; inf if it never does."""
        ...

    @property
    def valid_radius_distorted(self) -> float:
        """Distorted radius up to which every point has an undistorted one; inf if the lens never turns back."""
        ...

    def with_coefficients(self, coefficients: npt.ArrayLike) -> Lens:
        """Return the same kind of lens with other coefficients."""
        ...

    def distort(self, points: npt.ArrayLike) -> FloatArray:
        """Distort points of shape (..., 2); NaN past the fold."""
        ...

    def undistort(self, points: npt.ArrayLike) -> FloatArray:
        """Invert `distort` for points of shape (..., 2); NaN where nothing valid maps to the point."""
        ...

    def distort_unchecked(self, points: npt.ArrayLike) -> FloatArray:
        """Evaluate the bare formula for points of shape (..., 2), past the fold too."""
        ...

    def jacobian_points(self, points: npt.ArrayLike) -> FloatArray:
        """Differentiate the bare formula by the point: shape (..., 2, 2)."""
        ...

    def jacobian_coefficients(self, points: npt.ArrayLike) -> FloatArray:
        """Differentiate the bare formula by the coefficients: shape (..., 2, C)."""
        ...
