"""Steps blurred by a Gaussian: the error function, and the blurred product of two steps, in 32-bit numpy."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from camcal.geometry.arrays import FloatArray

Float32Array = npt.NDArray[np.float32]

# Abramowitz and Stegun 1964, formula 7.1.26: erf to 1.5e-7 (no more is kept in 32 bits).
_ERF_P = np.float32(0.3275911 / np.sqrt(2.0))
_ERF_A = tuple(np.float32(v) for v in (0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429))
_DENSITY = np.float32(1.0 / np.sqrt(2.0 * np.pi))
# Gauss-Legendre on [-1, 1]: the integral over the correlation is good to 4e-8 up to 0.7, and to 1e-5 at 0.9.
_NODES = np.polynomial.legendre.leggauss(5)


def normal_step(a: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Blurred step and its density: erf(a / √2), accurate to 2e-7, and exp(-a² / 2) / √(2 π)."""
    t = 1 / (1 + _ERF_P * np.abs(a))
    bell = np.exp(a * a * np.float32(-0.5))
    a1, a2, a3, a4, a5 = _ERF_A
    step = 1 - t * (a1 + t * (a2 + t * (a3 + t * (a4 + t * a5)))) * bell
    return np.copysign(step, a), bell * _DENSITY


def product_excess(a: Float32Array, b: Float32Array, correlation: FloatArray) -> Float32Array:
    """How much the blurred product of two steps exceeds the product of the blurred ones.

    Parameters
    ----------
    a, b : ndarray of shape (C, P)
        Distances to the edges over the blur.
    correlation : ndarray of shape (C,)
        Cosine of the angle between their normals.

    Notes
    -----
    4 (Φ2(a, b; ρ) - Φ(a) Φ(b)) as an integral over the correlation (Drezner and Wesolowsky 1990, "On the computation of the
    bivariate normal integral", eq. 4, with r = sin φ).
    """
    half = np.arcsin(correlation) / 2
    squares, doubled = a * a + b * b, 2 * a * b
    total = np.zeros_like(squares)
    for node, weight in zip(*_NODES, strict=True):
        phi = half * (1 + node)
        bell = np.exp((doubled * column(np.sin(phi)) - squares) * column(0.5 / np.cos(phi) ** 2))
        total += column(weight * half * (2 / np.pi)) * bell
    return total


def product_excess_slopes(a: Float32Array, b: Float32Array, correlation: FloatArray) -> tuple[Float32Array, Float32Array]:
    """Derivatives of `product_excess` by a and by b.

    On the first edge the second step has the mean erf((b - ρ a) / √(2 (1 - ρ²))), and the other way round.
    """
    rho, scale = column(correlation), column(1 / np.sqrt(1 - correlation**2))
    (step_a, density_a), (step_b, density_b) = normal_step(a), normal_step(b)
    by_a = 2 * density_a * (normal_step((b - rho * a) * scale)[0] - step_b)
    by_b = 2 * density_b * (normal_step((a - rho * b) * scale)[0] - step_a)
    return by_a, by_b


def column(values: npt.ArrayLike) -> Float32Array:
    """Values (C,) as a float32 column (C, 1)."""
    return np.asarray(values, dtype=np.float32)[:, None]
