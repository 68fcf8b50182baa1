"""Lens distortion: the protocol every lens keeps, and the Brown-Conrady (plumb bob, rational) lens.

A lens maps ideal normalised coordinates (X / Z, Y / Z) to distorted ones. It is invertible only up to where it turns
back on itself (folds); past that it answers NaN, never nonsense.

Source of the model: Brown 1966, "Decentering distortion of lenses"; the rational form is Claus and Fitzgibbon 2005 as
OpenCV writes it, and so are the names and the order of the coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import BoolArray, FloatArray, IntArray, frozen_floats

_NEWTON_STEPS = 100
_ANGLES = 720
_RADII = 512
_BISECTIONS = 60
# How far past its tabulated limit a point still counts as connected to the centre: the table is interpolated between
# directions, and the sign of the determinant decides exactly.
_TABLE_SLACK = 1e-3


class Lens(Protocol):
    """What the rest of camcal asks of a lens; all coordinates are normalised (dimensionless)."""

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
        """Smallest distorted radius that `valid_radius` maps to; inf if the lens never turns back."""
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


@dataclass(frozen=True, slots=True, eq=False)
class BrownConrady:
    """Radial (rational), tangential lens: x_d = x N(r²) / D(r²) + tangential.

    N = 1 + k1 r² + k2 r⁴ + k3 r⁶, D = 1 + k4 r² + k5 r⁴ + k6 r⁶.

    Attributes
    ----------
    coefficients : ndarray of shape (8,)
        (k1, k2, p1, p2, k3, k4, k5, k6), OpenCV's order, dimensionless. Fewer values are filled up with zeros.

    Raises
    ------
    ValueError
        If there are more than 8 coefficients or one is not finite.

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
        full = np.zeros(8)
        full[: given.size] = given
        object.__setattr__(self, "coefficients", frozen_floats(full, (8,), "dist"))

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
    def is_radial(self) -> bool:
        """Whether there is no tangential part."""
        return not self.coefficients[2:4].any()

    @property
    def valid_radius(self) -> float:
        """Smallest undistorted radius at which the Jacobian's determinant turns zero; inf if it never does."""
        return float(self._fold_radii().min())

    @property
    def valid_radius_distorted(self) -> float:
        """Smallest distorted radius on the fold; inf if the lens never turns back."""
        radii = self._fold_radii()
        finite = np.isfinite(radii)
        if not finite.any():
            return float("inf")
        angle = np.arange(radii.size)[finite] * (2 * np.pi / radii.size)
        points = radii[finite, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            reached = np.linalg.norm(self.distort_unchecked(points), axis=-1)
        # At a pole of the rational form the lens reaches infinitely far.
        return float(np.where(np.isfinite(reached) & (reached < 1 / np.finfo(float).eps), reached, np.inf).min())

    def distort(self, points: npt.ArrayLike) -> FloatArray:
        """Distort points.

        Parameters
        ----------
        points : array_like of shape (..., 2)
            Ideal normalised coordinates.

        Returns
        -------
        ndarray of shape (..., 2)
            Distorted normalised coordinates; NaN past the radius where the lens turns back.
        """
        xy = np.asarray(points, dtype=np.float64)
        if self.is_identity:
            return xy.copy()
        out = self.distort_unchecked(xy)
        out[~self.is_valid(xy)] = np.nan
        return out

    def is_valid(self, points: npt.ArrayLike) -> BoolArray:
        """Tell for undistorted points of shape (..., 2) whether they lie inside the fold (NaN does not)."""
        xy = np.asarray(points, dtype=np.float64)
        radius = np.hypot(xy[..., 0], xy[..., 1])
        limits = self._fold_radii()
        if limits.size == 1:
            inside: BoolArray = radius < limits[0]
            return inside
        turn = np.arctan2(xy[..., 1], xy[..., 0]) % (2 * np.pi) * (limits.size / (2 * np.pi))
        with np.errstate(invalid="ignore"):
            low = np.nan_to_num(np.floor(turn)).astype(np.intp) % limits.size
            limit = np.fmin(limits[low], limits[(low + 1) % limits.size])
            between = limits[low] + (turn - np.floor(turn)) * (limits[(low + 1) % limits.size] - limits[low])
            limit = np.where(np.isfinite(between), between, limit)
            connected = radius < limit * (1 + _TABLE_SLACK)
            positive = _determinant(self.jacobian_points(xy)) > 0
        both: BoolArray = connected & positive
        return both

    def undistort(self, points: npt.ArrayLike) -> FloatArray:
        """Invert the lens by Newton's method, to the last bits.

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
        if self.is_identity:
            return xy_d.copy()
        flat = xy_d.reshape(-1, 2)
        found = self._undistort_radial(flat)
        if not self.is_radial:
            found = self._undistort_newton(flat, found)
        return found.reshape(xy_d.shape)

    def distort_unchecked(self, points: npt.ArrayLike) -> FloatArray:
        """Evaluate the bare formula for points of shape (..., 2), past the fold too."""
        xy = np.asarray(points, dtype=np.float64)
        _, _, p1, p2, *_ = self.coefficients
        x, y = xy[..., 0], xy[..., 1]
        s = x * x + y * y
        N, D = self._polynomials(s)
        gain = N / D
        out = np.empty_like(xy)
        out[..., 0] = x * gain
        out[..., 1] = y * gain
        if not self.is_radial:
            out[..., 0] += 2 * p1 * x * y + p2 * (s + 2 * x * x)
            out[..., 1] += p1 * (s + 2 * y * y) + 2 * p2 * x * y
        return out

    def jacobian_points(self, points: npt.ArrayLike) -> FloatArray:
        """Differentiate the bare formula by the point, for points of shape (..., 2): shape (..., 2, 2), symmetric."""
        xy = np.asarray(points, dtype=np.float64)
        _, _, p1, p2, *_ = self.coefficients
        x, y = xy[..., 0], xy[..., 1]
        s = x * x + y * y
        N, D = self._polynomials(s)
        dN, dD = self._polynomial_derivatives(s)
        gain = N / D
        slope = 2 * (dN - gain * dD) / D
        out = np.empty((*xy.shape, 2))
        out[..., 0, 0] = gain + x * x * slope + 2 * p1 * y + 6 * p2 * x
        out[..., 0, 1] = x * y * slope + 2 * p1 * x + 2 * p2 * y
        out[..., 1, 0] = out[..., 0, 1]
        out[..., 1, 1] = gain + y * y * slope + 6 * p1 * y + 2 * p2 * x
        return out

    def jacobian_coefficients(self, points: npt.ArrayLike) -> FloatArray:
        """Differentiate the bare formula by (k1, k2, p1, p2, k3, k4, k5, k6): shape (..., 2, 8) for points (..., 2)."""
        xy = np.asarray(points, dtype=np.float64)
        x, y = xy[..., 0], xy[..., 1]
        s = x * x + y * y
        N, D = self._polynomials(s)
        powers = np.stack([s, s * s, s * s * s], axis=-1)
        numerator = powers / D[..., None]
        denominator = -numerator * (N / D)[..., None]
        out = np.empty((*xy.shape, 8))
        out[..., [0, 1, 4]] = xy[..., :, None] * numerator[..., None, :]
        out[..., 5:] = xy[..., :, None] * denominator[..., None, :]
        out[..., 0, 2] = out[..., 1, 3] = 2 * x * y
        out[..., 0, 3] = s + 2 * x * x
        out[..., 1, 2] = s + 2 * y * y
        return out

    def _polynomials(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Numerator N and denominator D at s = r²."""
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients
        return 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))

    def _polynomial_derivatives(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """dN/ds and dD/ds at s = r²."""
        k1, k2, _, _, k3, k4, k5, k6 = self.coefficients
        return k1 + s * (2 * k2 + s * 3 * k3), k4 + s * (2 * k5 + s * 3 * k6)

    def _fold_radii(self) -> FloatArray:
        """Undistorted radius of the fold by direction: one value for a radial lens, else one per angle from 0."""
        return _fold_radii(tuple(self.coefficients.tolist()))

    def _undistort_radial(self, flat: FloatArray) -> FloatArray:
        """Invert the radial part alone for points (N, 2): safeguarded Newton on r N(r²) / D(r²) = r_d."""
        r_d = np.hypot(flat[:, 0], flat[:, 1])
        fold = _radial_fold(tuple(self.coefficients.tolist()))
        r = np.full(r_d.shape, np.nan)
        active = np.flatnonzero(np.isfinite(r_d) & (r_d < self._radius_reached(fold)))
        low, high = np.zeros(active.size), np.full(active.size, fold)
        goal = r_d[active]
        guess = np.minimum(goal, 0.5 * fold) if np.isfinite(fold) else goal.copy()
        for _ in range(_NEWTON_STEPS):
            value, slope = self._radius_and_slope(guess)
            miss = value - goal
            r[active] = guess
            open_ = np.abs(miss) > 2 * np.finfo(float).eps * np.maximum(goal, np.finfo(float).tiny)
            if not open_.any():
                break
            low, high = np.where(miss < 0, guess, low), np.where(miss > 0, guess, high)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = guess - miss / slope
            inside = (step > low) & (step < high)
            middle = np.where(np.isfinite(high), 0.5 * (low + high), 2 * low + 1)
            following = np.where(inside, step, middle)
            open_ &= following != guess
            active, goal, guess = active[open_], goal[open_], following[open_]
            low, high = low[open_], high[open_]
            r[active] = guess
            if active.size == 0:
                break
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(r_d > 0, r / np.where(r_d > 0, r_d, 1), r + 1)
        result: FloatArray = flat * scale[:, None]
        return result

    def _radius_and_slope(self, r: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radial part r N / D and its derivative by r."""
        s = r * r
        N, D = self._polynomials(s)
        dN, dD = self._polynomial_derivatives(s)
        gain = N / D
        return r * gain, gain + 2 * s * (dN - gain * dD) / D

    def _radius_reached(self, fold: float) -> float:
        """Distorted radius that the radial part reaches at its fold (inf at a pole or without a fold)."""
        if not np.isfinite(fold):
            return float("inf")
        s = np.array(fold * fold)
        N, D = self._polynomials(s)
        return float(fold * N / D) if abs(D) > 1e-12 else float("inf")

    def _undistort_newton(self, flat: FloatArray, start: FloatArray) -> FloatArray:
        """Finish the inversion with the tangential part: damped two-dimensional Newton that never leaves the fold."""
        found = np.full(flat.shape, np.nan)
        active: IntArray = np.flatnonzero(np.isfinite(flat).all(axis=1))
        goal: FloatArray = flat[active]
        guess = self._start_inside(goal, start[active])
        miss = self.distort_unchecked(guess) - goal
        tolerance = 4 * np.finfo(float).eps * (1 + np.abs(goal).max(axis=1, initial=0))
        for _ in range(_NEWTON_STEPS):
            done = np.abs(miss).max(axis=1, initial=0) <= tolerance
            found[active[done]] = guess[done]
            active, goal, guess, miss, tolerance = (a[~done] for a in (active, goal, guess, miss, tolerance))
            if active.size == 0:
                break
            step = -np.linalg.solve(self.jacobian_points(guess), miss[..., None])[..., 0]
            guess, miss, moved = self._backtrack(guess, step, goal, miss)
            # A point that can no longer be improved is an answer only if it is as exact as the arithmetic allows.
            good = ~moved & (np.abs(miss).max(axis=1, initial=0) <= 1e3 * tolerance)
            found[active[good]] = guess[good]
            active, goal, guess, miss, tolerance = (a[moved] for a in (active, goal, guess, miss, tolerance))
        return found

    def _start_inside(self, goal: FloatArray, start: FloatArray) -> FloatArray:
        """Starting points inside the fold: the radial answer, else a point in its direction pulled inwards."""
        start = np.where(np.isfinite(start), start, goal)
        for _ in range(_BISECTIONS):
            outside = ~self.is_valid(start)
            if not outside.any():
                break
            start = np.where(outside[:, None], 0.8 * start, start)
        return start

    def _backtrack(
        self, guess: FloatArray, step: FloatArray, goal: FloatArray, miss: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Take the longest of the steps 1, 1/2, 1/4, ... that stays inside the fold and comes closer to the goal."""
        size = np.linalg.norm(miss, axis=1)
        best, best_miss = guess.copy(), miss.copy()
        waiting = np.ones(guess.shape[0], dtype=bool)
        length = 1.0
        for _ in range(30):
            trial = guess[waiting] + length * step[waiting]
            trial_miss = self.distort_unchecked(trial) - goal[waiting]
            better = self.is_valid(trial) & (np.linalg.norm(trial_miss, axis=1) < size[waiting])
            rows = np.flatnonzero(waiting)[better]
            best[rows], best_miss[rows] = trial[better], trial_miss[better]
            waiting[rows] = False
            if not waiting.any():
                break
            length *= 0.5
        return best, best_miss, ~waiting


def _determinant(matrices: FloatArray) -> FloatArray:
    """Determinants of shape (...) of 2x2 matrices of shape (..., 2, 2)."""
    det: FloatArray = matrices[..., 0, 0] * matrices[..., 1, 1] - matrices[..., 0, 1] * matrices[..., 1, 0]
    return det


@lru_cache(maxsize=64)
def _radial_fold(coefficients: tuple[float, ...]) -> float:
    """Smallest positive radius at which the radial part turns back or its denominator vanishes; inf if none."""
    k1, k2, _, _, k3, k4, k5, k6 = coefficients
    N, D = np.poly1d([k3, k2, k1, 1.0]), np.poly1d([k6, k5, k4, 1.0])
    s = np.poly1d([1.0, 0.0])
    # d(r N / D) / dr vanishes where N D + 2 s (N' D - N D') does.
    turn = N * D + 2 * s * (N.deriv() * D - N * D.deriv())
    roots = np.concatenate([turn.roots, D.roots])
    real = roots[np.abs(roots.imag) <= 1e-9 * np.maximum(1, np.abs(roots.real))].real
    positive = real[real > 0]
    return float(np.sqrt(positive.min())) if positive.size else float("inf")


@lru_cache(maxsize=64)
def _fold_radii(coefficients: tuple[float, ...]) -> FloatArray:
    """Radius of the fold: shape (1,) for a radial lens, else one per direction, shape (720,).

    With tangential terms the determinant is followed along each direction on a grid of atan(r) and its first zero
    bisected.
    """
    radial = _radial_fold(coefficients)
    lens = BrownConrady(np.array(coefficients))
    if lens.is_radial:
        radii = np.array([radial])
        radii.flags.writeable = False
        return radii
    angle = np.arange(_ANGLES) * (2 * np.pi / _ANGLES)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    k4, k5, k6 = coefficients[5:]
    poles = np.roots([k6, k5, k4, 1.0])
    real = poles[(np.abs(poles.imag) <= 1e-9) & (poles.real > 0)].real
    reach = float(np.sqrt(real.min())) if real.size else float("inf")

    def determinant(radius: FloatArray) -> FloatArray:
        return _determinant(lens.jacobian_points(radius[..., None] * direction))

    grid = np.tan(np.linspace(0, np.arctan(min(reach, 1e3)), _RADII + 1)[1:-1])
    folded = determinant(np.broadcast_to(grid[:, None], (grid.size, _ANGLES))) <= 0
    first = folded.argmax(axis=0)
    high = grid[first]
    low = np.where(first > 0, grid[np.maximum(first - 1, 0)], 0.0)
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        past = determinant(middle) <= 0
        low, high = np.where(past, low, middle), np.where(past, middle, high)
    radii = np.where(folded.any(axis=0), low, reach)
    radii.flags.writeable = False
    return radii
