"""The bare Brown-Conrady formula and its derivatives, element by element, past the fold too.

With s = x² + y², the radial gain g(s) = N / D of N = 1 + k1 s + k2 s² + k3 s³ and D = 1 + k4 s + k5 s² + k6 s³, and the
tangential vector a = (p2, p1), the formula is x_d = (g + 2 a·x) x + s a: the tangential terms as OpenCV writes them,
gathered. Its Jacobian (g + 2 a·x) I + 2 g' x xᵀ + 2 (a xᵀ + x aᵀ) is symmetric.

Coefficients are (k1, k2, p1, p2, k3, k4, k5, k6) throughout; s, x and y are arrays of one shape.

Source: Brown 1966, "Decentering distortion of lenses", and Conrady 1919; the rational form and the order of the
coefficients are those of OpenCV's calib3d documentation.
"""

from __future__ import annotations

from camcal.geometry.arrays import FloatArray


def numerator_and_denominator(coefficients: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """N and D at s."""
    k1, k2, _, _, k3, k4, k5, k6 = coefficients.tolist()
    return 1 + s * (k1 + s * (k2 + s * k3)), 1 + s * (k4 + s * (k5 + s * k6))


def radial_gain(coefficients: FloatArray, s: FloatArray) -> FloatArray:
    """Radial gain g at s."""
    k1, k2, _, _, k3, k4, k5, k6 = coefficients.tolist()
    gain: FloatArray = 1 + s * (k1 + s * (k2 + s * k3))
    if k4 or k5 or k6:
        gain = gain / (1 + s * (k4 + s * (k5 + s * k6)))
    return gain


def radial_gain_and_slope(coefficients: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radial gain g and its derivative dg/ds at s."""
    k1, k2, _, _, k3, k4, k5, k6 = coefficients.tolist()
    gain = 1 + s * (k1 + s * (k2 + s * k3))
    slope = k1 + s * (2 * k2 + s * (3 * k3))
    if k4 or k5 or k6:
        D = 1 + s * (k4 + s * (k5 + s * k6))
        gain = gain / D
        slope = (slope - gain * (k4 + s * (2 * k5 + s * (3 * k6)))) / D
    return gain, slope


def distorted(coefficients: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distorted x and y."""
    p1, p2 = coefficients[2:4].tolist()
    s = x * x + y * y
    gain = radial_gain(coefficients, s)
    if not (p1 or p2):
        return gain * x, gain * y
    gain = gain + 2 * (p2 * x + p1 * y)
    return gain * x + p2 * s, gain * y + p1 * s


def jacobian(coefficients: FloatArray, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Entries dx_d/dx, dx_d/dy (= dy_d/dx) and dy_d/dy of the symmetric Jacobian."""
    p1, p2 = coefficients[2:4].tolist()
    gain, slope = radial_gain_and_slope(coefficients, x * x + y * y)
    common = gain + 2 * (p2 * x + p1 * y)
    xx = common + x * (2 * slope * x + 4 * p2)
    xy = 2 * (slope * x * y + p1 * x + p2 * y)
    yy = common + y * (2 * slope * y + 4 * p1)
    return xx, xy, yy
