"""A minimum to first order, view by view: what each view says about what all of them share."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.geometry.camera import Camera
from camcal.trust.minimum import Minimum

# Of the largest eigenvalue of a scaled information matrix: below it a direction is not determined.
_LEAST_DETERMINED = 1e-13
# Corners that scatter less were made, not seen; what they leave are the last bits.
_LEAST_SIGMA_PX = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Linearised:
    """What each view says about the shared parameters, in units in which the variance of the corners is 1.

    If the parameters move by d, and its own pose makes the best of that, a view's sum of squares becomes
    `cost - 2 gradient·d + d·information·d`.

    Attributes
    ----------
    camera : Camera
        At the minimum.
    names : tuple of str
        Names of the free intrinsics; parameters of the board's shape follow them.
    values : ndarray of shape (F,)
        Where the free parameters stand.
    costs : ndarray of shape (V,)
    information : ndarray of shape (V, F, F)
    gradient : ndarray of shape (V, F)
        At the minimum they cancel.
    variance_px2 : float
        Variance per axis of a corner of weight 1, px²; NaN where nothing is left to tell it.
    """

    camera: Camera
    names: tuple[str, ...]
    values: FloatArray
    costs: FloatArray
    information: FloatArray
    gradient: FloatArray
    variance_px2: float

    @classmethod
    def of(cls, minimum: Minimum) -> Linearised:
        """Linearise a minimum."""
        information, gradient = minimum.view_information()
        camera, own = minimum.state.camera, minimum.variance_px2
        variance = max(own, _LEAST_SIGMA_PX**2) if np.isfinite(own) else float("nan")
        intrinsics = minimum.columns[minimum.columns < camera.intrinsics.size]
        return cls(
            camera=camera,
            names=tuple(camera.intrinsic_names[column] for column in intrinsics),
            values=minimum.state.shared[minimum.columns],
            costs=np.add.reduceat((minimum.residuals**2).sum(axis=1), minimum.seen.starts) / variance,
            information=information / variance,
            gradient=gradient / variance,
            variance_px2=variance,
        )

    def only(self, chosen: BoolArray) -> Linearised:
        """Hold all free parameters but the chosen ones, shape (F,), where they stand."""
        names = tuple(name for name, keep in zip(self.names, chosen.tolist(), strict=False) if keep)
        information = self.information[:, chosen][:, :, chosen]
        return replace(
            self, names=names, values=self.values[chosen], information=information, gradient=self.gradient[:, chosen]
        )

    @property
    def telling(self) -> bool:
        """Whether the corners scatter at all, so that anything can be compared with their scatter."""
        return self.variance_px2 > _LEAST_SIGMA_PX**2

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the free intrinsics, in the squares of their units."""
        free = len(self.names)
        return inverse(self.information.sum(axis=0))[:free, :free]

    def held_out(self, free: BoolArray | None = None) -> FloatArray:
        """Sum of squares (V,) of each view under the camera that the other views give.

        The view itself has a say in its own pose only. To first order nothing need be solved again.

        Parameters
        ----------
        free : ndarray of shape (F,), optional
            Which parameters are; the others are put to 0. All are by default.
        """
        S, G = self.information.sum(axis=0), self.gradient.sum(axis=0)
        chosen = np.ones(len(self.values), dtype=bool) if free is None else free
        to_zero = np.where(chosen, 0.0, -self.values)
        A = S - self.information
        right = (G - self.gradient - A @ to_zero)[:, chosen]
        d = np.tile(to_zero, (len(self.costs), 1))
        d[:, chosen] = (inverse(A[:, chosen][:, :, chosen]) @ right[..., None])[..., 0]
        curved = (d[:, None] @ self.information @ d[..., None])[:, 0, 0]
        squares: FloatArray = self.costs - 2 * (self.gradient * d).sum(axis=1) + curved
        return squares


def inverse(matrix: FloatArray) -> FloatArray:
    """Inverse of symmetric matrices (..., F, F) of very different units; what they do not determine stays where it is."""
    scale = np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), np.finfo(float).tiny))
    units = scale[..., :, None] * scale[..., None, :]
    inverted: FloatArray = np.linalg.pinv(matrix / units, rcond=_LEAST_DETERMINED, hermitian=True) / units
    return inverted
