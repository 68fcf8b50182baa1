"""What a blurred corner looks like: two curved edges that cross, and the derivatives of every pixel by the parameters.

A corner is where two edges meet. Each edge is a curve: at the distance τ along its tangent it stands off the tangent by
c2 τ² + c3 τ³ + c4 τ⁴. Blurred by a Gaussian, an edge is the normal distribution function of the distance to it over the
blur; where both edges are near, the blurred product of two half planes is the bivariate normal distribution whose
correlation is the cosine of the angle between the normals. Any pattern of four quadrants (a saddle of a checkerboard, the
L-corner of one black square) is a linear mix of the two edges and their product. Illumination multiplies all of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.geometry.arrays import FloatArray, IntArray
from camcal.observations import Image
from camcal.refinement.blurred_steps import Float32Array, column, normal_step, product_excess, product_excess_slopes

X, Y, LOG_BLUR, OFFSET, GAIN, SLOPE_X, SLOPE_Y, OVERSHOOT, RESPONSE, SMEAR, ANGLE_1, ANGLE_2, BEND_1, BEND_2 = range(14)
"""Columns of the parameters (see `Corners.params`)."""

SHAPE_KNOWN, STRAIGHT, ALL_FREE = 10, 12, 14
"""How many leading parameters are fitted: with the edges' shape known, with straight edges of any angle, with curved ones."""

_NEAR_BLURS = 4.2
_LARGEST_CORRELATION = 0.98


@dataclass(frozen=True, slots=True, eq=False)
class Patches:
    """The pixels of C corners, P each; those that fill up a row count for nothing.

    Attributes
    ----------
    centre : ndarray of shape (C, 2)
        Pixel that the offsets are relative to; int64.
    x, y : ndarray of shape (C, P)
        Offset of each pixel from the centre, float32, px; in the order of their distance from it.
    weight : ndarray of shape (C, P)
        1, or 0 for a pixel that only fills up; float32.
    values : ndarray of shape (C, P)
        Grey values, 0 where the weight is; float32.
    """

    centre: IntArray
    x: Float32Array
    y: Float32Array
    weight: Float32Array
    values: Float32Array

    def take(self, rows: IntArray) -> Patches:
        """Return the patches of some corners."""
        return Patches(self.centre[rows], self.x[rows], self.y[rows], self.weight[rows], self.values[rows])


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """What is known and assumed of C corners.

    Attributes
    ----------
    params : ndarray of shape (C, 14)
        x, y of the corner relative to the patch's centre (px); log of the blur (its standard deviation in px, the pixel's
        area included); offset and gain (levels); slope of the illumination along x and y (1/px); overshoot of the edges
        (the factor of a He3(a) φ(a) added to each step, a the distance over the blur: negative where the camera sharpens,
        +1/12 for a disc of defocus); response (the factor r of r (1 - t²) added to the mix t: how much grey values bend
        between ink and paper, as gamma makes them); smear (log of the blur across edge 1 over the mean, minus that of
        edge 2: a shaken camera); angle of the tangents of edge 1 and 2 (radians); c2 of both (1/px).
    cubic, quartic : ndarray of shape (C, 2)
        c3 (1/px²) and c4 (1/px³) of both edges.
    mix : ndarray of shape (C, 4)
        Weights of edge 1, edge 2, their product, and a constant. An edge is +1 on the side of its normal (-sin, cos), which is
        on the right of one who walks along the tangent in an image with y down, and -1 on the other.
    """

    params: FloatArray
    cubic: FloatArray
    quartic: FloatArray
    mix: FloatArray

    def take(self, rows: IntArray) -> Corners:
        """Return some of the corners."""
        return Corners(self.params[rows], self.cubic[rows], self.quartic[rows], self.mix[rows])


def sample_patches(gray: Image, centre: IntArray, x: IntArray, y: IntArray, weight: Float32Array) -> Patches:
    """Cut patches out of an image.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
    centre : ndarray of shape (C, 2)
        Pixels (x, y).
    x, y : ndarray of shape (C, P) or (P,)
        Offsets; where the weight is not 0 they must stay in the image.
    weight : ndarray of shape (C, P)
    """
    height, width = gray.shape
    shape = weight.shape
    index = np.clip(centre[:, 1:] + y, 0, height - 1) * width + np.clip(centre[:, :1] + x, 0, width - 1)
    values = gray.ravel()[index].astype(np.float32)
    values *= weight
    dx, dy = (np.broadcast_to(offset.astype(np.float32), shape) for offset in (x, y))
    return Patches(centre, dx, dy, weight, values)


def jacobian_and_residual(patches: Patches, corners: Corners, count: int) -> Float32Array:
    """Differentiate the modelled grey values of every pixel and compare them with the image.

    Parameters
    ----------
    patches : Patches
    corners : Corners
    count : int
        How many leading parameters to differentiate by: `SHAPE_KNOWN`, `STRAIGHT` or `ALL_FREE`.

    Returns
    -------
    ndarray of shape (C, count + 1, P)
        Rows 0..count - 1: derivative of the model by each parameter; the last row: image minus model. float32.
    """
    params = corners.params
    x, y, weight = patches.x, patches.y, patches.weight
    dx, dy = x - column(params[:, X]), y - column(params[:, Y])
    edges = [_Edge.of(dx, dy, corners, nth) for nth in (0, 1)]
    template, slopes, ripples = _mixed(edges, corners, _count_near(dx, dy, np.maximum(edges[0].blur, edges[1].blur)))
    light = weight + column(params[:, SLOPE_X]) * (weight * x) + column(params[:, SLOPE_Y]) * (weight * y)
    out = np.empty((len(params), count + 1, x.shape[1]), dtype=np.float32)
    bulge = 1 - template * template
    contrast = template + column(params[:, RESPONSE]) * bulge
    signal = contrast * column(params[:, GAIN])
    signal += column(params[:, OFFSET])
    amplitude = light * (1 - column(2 * params[:, RESPONSE]) * template)
    amplitude *= column(params[:, GAIN])
    fringes = [ripple * amplitude for ripple in ripples]
    np.add(fringes[0], fringes[1], out=out[:, OVERSHOOT])
    np.multiply(light, bulge * column(params[:, GAIN]), out=out[:, RESPONSE])
    pulls = [slope * amplitude * column(1 / edge.blur) for slope, edge in zip(slopes, edges, strict=True)]
    out[:, OFFSET] = light
    np.multiply(light, contrast, out=out[:, GAIN])
    np.multiply(signal, weight * x, out=out[:, SLOPE_X])
    np.multiply(signal, weight * y, out=out[:, SLOPE_Y])
    # A wider blur makes less of the pixel's own overshoot, which goes with its fourth power.
    widths = [
        pull * edge.distance + fringe * column(4 * edge.pixel_overshoot)
        for pull, edge, fringe in zip(pulls, edges, fringes, strict=True)
    ]
    np.add(widths[0], widths[1], out=out[:, LOG_BLUR])
    np.negative(out[:, LOG_BLUR], out=out[:, LOG_BLUR])
    np.subtract(widths[1], widths[0], out=out[:, SMEAR])
    _differentiate_curves(out, edges, pulls, count)
    np.multiply(signal, light, out=signal)
    np.subtract(patches.values, signal, out=out[:, count])
    return out


def _differentiate_curves(out: Float32Array, edges: list[_Edge], pulls: list[Float32Array], count: int) -> None:
    """Fill in the rows of position, angles and bends, given how each pixel follows the distance to each edge.

    What the angles change in the correlation of the edges is left out: it is small, and even where a shift is odd.
    """
    out[:, X], out[:, Y] = _shift_derivatives(edges, pulls)
    for nth, (edge, pull) in enumerate(zip(edges, pulls, strict=True)):
        if count >= STRAIGHT:
            out[:, ANGLE_1 + nth] = -pull * (edge.along + edge.rise * edge.across)
        if count >= ALL_FREE:
            out[:, BEND_1 + nth] = -pull * (edge.along * edge.along + column(edge.blur**2))


@dataclass(frozen=True, slots=True, eq=False)
class _Edge:
    """One edge of every corner, at every pixel: arrays of shape (C, P) unless said otherwise."""

    blur: FloatArray  # standard deviation across this edge, px, (C,)
    pixel_overshoot: FloatArray  # (C,)
    cosine: Float32Array  # of the tangent's angle, (C, 1)
    sine: Float32Array
    along: Float32Array  # τ, px
    across: Float32Array  # ν: distance to the tangent, px
    rise: Float32Array  # slope of the curve against its tangent at τ
    distance: Float32Array  # to the curve, px, positive towards the normal
    step: Float32Array  # -1..1
    density: Float32Array  # half the slope of the step over distance / blur
    ripple: Float32Array  # derivative of the step by its overshoot

    @classmethod
    def of(cls, dx: Float32Array, dy: Float32Array, corners: Corners, nth: int) -> _Edge:
        angle = corners.params[:, ANGLE_1 + nth]
        blur = np.exp(corners.params[:, LOG_BLUR] + (1, -1)[nth] * corners.params[:, SMEAR])
        cosine, sine = column(np.cos(angle)), column(np.sin(angle))
        along: Float32Array = cosine * dx + sine * dy
        across: Float32Array = cosine * dy - sine * dx
        bends = (corners.params[:, BEND_1 + nth], corners.cubic[:, nth], corners.quartic[:, nth])
        c2, c3, c4 = (column(c) for c in bends)
        # Blur moves a curved edge towards its centre of curvature: the mean of c2 τ² under the blur is c2 (τ² + blur²).
        distance: Float32Array = across - along * along * (c2 + along * (c3 + along * c4)) - column(bends[0] * blur**2)
        twice_c2, thrice_c3, four_c4 = (column(power * c) for power, c in zip((2, 3, 4), bends, strict=True))
        rise: Float32Array = along * (twice_c2 + along * (thrice_c3 + along * four_c4))
        a = distance * column(1 / blur)
        step, density = normal_step(a)
        # The area of a pixel is no Gaussian: its fourth cumulant, seen along the edge's normal, sharpens the step.
        pixel = _pixel_overshoot(angle, blur)
        fourth = pixel + corners.params[:, OVERSHOOT]
        squared = a * a
        ripple: Float32Array = (squared - 3) * a * density
        step += column(fourth) * ripple
        density *= 1 + column(fourth / 2) * (squared * (6 - squared) - 3)
        return cls(blur, pixel, cosine, sine, along, across, rise, distance, step, density, ripple)


def _mixed(edges: list[_Edge], corners: Corners, near: int) -> tuple[Float32Array, list[Float32Array], list[Float32Array]]:
    """The mix of the edges and their product, its slopes over each distance / blur, and what each edge's overshoot adds."""
    mix = [column(corners.mix[:, k]) for k in range(4)]
    steps = [edge.step for edge in edges]
    product = steps[0] * steps[1]
    angles = corners.params[:, ANGLE_1:BEND_1]
    correlation = np.clip(np.cos(angles[:, 1] - angles[:, 0]), -_LARGEST_CORRELATION, _LARGEST_CORRELATION)
    a, b = (edge.distance[:, :near] * column(1 / edge.blur) for edge in edges)
    product[:, :near] += product_excess(a, b, correlation)
    template = mix[2] * product + mix[3]
    if corners.mix[:, :2].any():
        template += mix[0] * steps[0] + mix[1] * steps[1]
    slopes, ripples = [], []
    excess_slopes = product_excess_slopes(a, b, correlation)
    for edge, other, weight, excess in zip(edges, steps[::-1], mix[:2], excess_slopes, strict=True):
        seen = mix[2] * other + weight
        ripples.append(seen * edge.ripple)
        seen *= edge.density
        seen *= 2
        seen[:, :near] += mix[2] * excess
        slopes.append(seen)
    return template, slopes, ripples


def _shift_derivatives(edges: list[_Edge], pulls: list[Float32Array]) -> tuple[Float32Array, Float32Array]:
    """Derivative of the grey values by the corner's x and y."""
    by_x, by_y = np.zeros_like(pulls[0]), np.zeros_like(pulls[0])
    for edge, pull in zip(edges, pulls, strict=True):
        tilted = pull * edge.rise
        by_x += edge.sine * pull + edge.cosine * tilted
        by_y += edge.sine * tilted - edge.cosine * pull
    return by_x, by_y


def _pixel_overshoot(angle: FloatArray, blur: FloatArray) -> FloatArray:
    """Overshoot of an edge at some angle that the area of a pixel makes: -1/12 of its fourth cumulant over the blur's."""
    overshoot: FloatArray = (np.cos(angle) ** 4 + np.sin(angle) ** 4) / (1440 * blur**4)
    return overshoot


def _count_near(dx: Float32Array, dy: Float32Array, blur: FloatArray) -> int:
    """How many of the leading pixels of the patches can be near both edges of any corner."""
    reach = column(_NEAR_BLURS * blur)
    near = np.any(dx * dx + dy * dy < reach * reach, axis=0)
    return int(near.size - np.argmax(near[::-1])) if near.any() else 0
