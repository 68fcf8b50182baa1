"""Where a Brown-Conrady lens turns back on itself: the fold, direction by direction.

A point is valid when the Jacobian's determinant is positive all the way from the centre to it. In a point's own radial
and tangential directions, with the tangential vector a = (p2, p1) split into a_u along the radius and a_w across it, the
Jacobian is [[f' + 6 r a_u, 2 r a_w], [2 r a_w, g + 2 r a_u]], where f(r) = r g(r²). Its determinant times D³ is a
polynomial in r whose smallest root with a change of sign is the fold. It depends on the direction only through the
angle to a, so half a turn of directions describes the whole fold.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import Polynomial

from camcal.geometry import formula
from camcal.geometry.arrays import BoolArray, FloatArray

_DIRECTIONS = 361
_BISECTIONS = 64
# The fold is interpolated between directions half a degree apart, which is good to some 1e-5 of the radius; within this
# share of it the sign of the determinant at the point itself decides. Two folds closer together than this overlap by
# less than 1e-12 in the image, which is nothing.
_SLACK = 1e-4
# Between directions the fold may reach a little farther than at them.
_FARTHEST_SLACK = 1e-2
# The inverse of what is too far away to be squared: coefficients of 1e-200 do not fold anything.
_NEVER = 1e-100


@dataclass(frozen=True, slots=True, eq=False)
class Fold:
    """The fold of one lens, in undistorted normalised coordinates.

    Attributes
    ----------
    inverse_radii : ndarray of shape (M,)
        1 / radius of the fold by direction, 0 where the lens never turns back: M = 1 for a radial lens, else at angles
        evenly spaced from 0 to π to the tangential vector (p2, p1).
    radius : float
        The smallest radius; inf if the lens never turns back.
    radius_distorted : float
        The smallest distorted radius on the fold; inf if the lens never turns back or grows without bound before.
    farthest_distorted: float
        A distorted radius that no point inside the fold exceeds; inf if some direction never turns back.
    """

    inverse_radii: FloatArray
    radius: float
    radius_distorted: float
    farthest_distorted: float


def inside_fold(coefficients: FloatArray, x: FloatArray, y: FloatArray) -> BoolArray:
    """Tell which undistorted points (x and y of one shape (N,)) lie inside the fold; NaN and infinite ones do not."""
    fold = find_fold(tuple(coefficients.tolist()))
    s = x * x + y * y
    if fold.inverse_radii.size == 1:
        inside: BoolArray = s < fold.radius * fold.radius
        return inside
    surely = (1 - _SLACK) * fold.radius
    inside = s < surely * surely
    near = np.flatnonzero(~inside & np.isfinite(s))
    inside[near] = _inside_near_fold(coefficients, fold, x[near], y[near])
    return inside


def _inside_near_fold(coefficients: FloatArray, fold: Fold, x: FloatArray, y: FloatArray) -> BoolArray:
    """Decide for points (N,) beyond the fold's smallest radius, by their own direction and determinant."""
    p1, p2 = coefficients[2:4].tolist()
    r = np.hypot(x, y)
    angle = np.arccos(np.clip((p2 * x + p1 * y) / (r * np.hypot(p1, p2)), -1, 1))
    inverse_radius = np.interp(angle, np.linspace(0, np.pi, fold.inverse_radii.size), fold.inverse_radii)
    xx, xy, yy = formula.jacobian(coefficients, x, y)
    inside: BoolArray = (r * inverse_radius < 1 + _SLACK) & (xx * yy - xy * xy > 0)
    return inside


@lru_cache(maxsize=64)
def find_fold(coefficients: tuple[float, ...]) -> Fold:
    """Find the fold of the lens with the given eight coefficients, in OpenCV's order."""
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients
    N, D, s = Polynomial([1, k1, k2, k3]), Polynomial([1, k4, k5, k6]), Polynomial([0, 1])
    turn = N * D + 2 * s * (N.deriv() * D - N * D.deriv())  # f' D²
    pole = np.sqrt(first_sign_change(_coefficients(D)[None]))
    tangential = float(np.hypot(p1, p2))
    if tangential == 0:
        angles = np.zeros(1)
        folds = np.sqrt(first_sign_change(_coefficients(turn)[None]))
    else:
        angles = np.linspace(0, np.pi, _DIRECTIONS)
        folds = first_sign_change(_determinants(N, D, turn, tangential, angles))
    inverse_radii = np.maximum(folds, pole)
    inverse_radii.flags.writeable = False
    nearest = float(inverse_radii.max())
    # Towards a pole the lens reaches ever farther; only a true fold bounds what it reaches.
    bounding = (folds > 0) & (folds >= pole)
    reached = _distorted_radii(np.array(coefficients), 1 / folds[bounding], angles[bounding] + np.arctan2(p1, p2))
    return Fold(
        inverse_radii,
        radius=1 / nearest if nearest > 0 else float("inf"),
        radius_distorted=float(reached.min(initial=np.inf)),
        farthest_distorted=float(reached.max()) * (1 + _FARTHEST_SLACK) if bounding.all() else float("inf"),
    )


def _coefficients(polynomial: Polynomial) -> FloatArray:
    """Coefficients in ascending powers: shape (n + 1,)."""
    return np.asarray(polynomial.coef, dtype=np.float64)


def _distorted_radii(coefficients: FloatArray, radii: FloatArray, directions: FloatArray) -> FloatArray:
    """Distorted radius of points given in polar coordinates, shape (N,)."""
    with np.errstate(over="ignore", invalid="ignore"):
        x_d, y_d = formula.distorted(coefficients, radii * np.cos(directions), radii * np.sin(directions))
    distances: FloatArray = np.hypot(x_d, y_d)
    return distances


def _determinants(N: Polynomial, D: Polynomial, turn: Polynomial, tangential: float, angles: FloatArray) -> FloatArray:
    """Coefficients of the determinant times D³ in ascending powers of r: shape (M, n + 1) for M angles to (p2, p1)."""
    r = Polynomial([0, 1])
    N, D, turn = N(r * r), D(r * r), turn(r * r)
    parts = [_coefficients(part) for part in (turn * N, 2 * r * turn * D + 6 * r * D**2 * N, 4 * r**2 * D**3)]
    along, across = tangential * np.cos(angles), tangential * np.sin(angles)
    weights = (np.ones_like(angles), along, 3 * along**2 - across**2)
    determinants = np.zeros((angles.size, max(part.size for part in parts)))
    for part, weight in zip(parts, weights, strict=True):
        determinants[:, : part.size] += np.outer(weight, part)
    return determinants


def first_sign_change(polynomials: FloatArray) -> FloatArray:
    """Inverse of the smallest positive argument at which each polynomial turns negative; 0 if it never does.

    Parameters
    ----------
    polynomials : ndarray of shape (M, n + 1)
        Coefficients in ascending powers; the constant term is 1.

    Returns
    -------
    ndarray of shape (M,)

    Notes
    -----
    Everything happens in q = 1 / argument, in which the polynomials are monic: the magnitudes of the companion matrix's
    eigenvalues cut the axis into pieces, the sign on each piece tells which cut is a change of sign, and bisection
    makes that one exact. A magnitude that belongs to no real root does no harm.
    """
    degree = int(np.flatnonzero(polynomials.any(axis=0))[-1])
    if degree == 0:
        return np.zeros(len(polynomials))
    polynomials = polynomials[:, : degree + 1]
    companion = np.zeros((len(polynomials), degree, degree))
    companion[:, 0] = -polynomials[:, 1:]
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1
    cuts = np.sort(np.abs(np.linalg.eigvals(companion)), axis=1)[:, ::-1]
    probes = 0.5 * np.concatenate([4 * cuts[:, :1], cuts[:, :-1] + cuts[:, 1:], cuts[:, -1:]], axis=1)
    descending = polynomials.T[..., None]

    def negative(q: FloatArray) -> BoolArray:
        value = np.ones_like(q)
        with np.errstate(over="ignore"):
            for coefficient in descending[1:]:
                value = value * q + coefficient
        below: BoolArray = value < 0
        return below

    turned = negative(probes)
    turned[:, 0] = False
    first = turned.argmax(axis=1)
    rows = np.arange(len(polynomials))
    high, low = probes[rows, first - (first > 0)][:, None], probes[rows, first][:, None]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        past = negative(middle)
        low, high = np.where(past, middle, low), np.where(past, high, middle)
    return np.where(turned.any(axis=1) & (high[:, 0] > _NEVER), high[:, 0], 0.0)
