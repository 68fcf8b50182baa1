"""Whether a lens that no pinhole describes is a fisheye: a lens model of angles is fitted to the same corners.

Kannala and Brandt 2006, "A generic camera model and calibration method for conventional, wide-angle, and fish-eye lenses",
as OpenCV writes it: the distance from the centre is θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸), with θ the angle from the axis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from camcal.calibration.branches import reposed
from camcal.calibration.closed_form import facing
from camcal.calibration.finish import descend
from camcal.calibration.limits import LARGEST_RMS_PX
from camcal.calibration.normal_equations import Observations, State, residuals
from camcal.calibration.views import FEWEST_CORNERS, FEWEST_VIEWS
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.geometry.camera import Camera
from camcal.observations import Detection
from camcal.trust.held_out import POLYNOMIALS, remodelled
from camcal.trust.minimum import Minimum
from camcal.trust.wording import rounded
from camcal.verdict import Finding

ADVICE = (
    "Calibrate it with a fisheye model (Kannala-Brandt), which camcal does not have; --distortion k1,k2,k3,k4,k5,k6 comes "
    "nearest to it."
)
"""What to do about a fisheye."""

# A pinhole that leaves less is good enough, and a fisheye has to fit so many times better. Ordinary wide lenses are fitted
# better by a polynomial; the angles of a fisheye reach farther than theirs.
_LEAST_RMS_PX = 1.0
_TIMES_BETTER = 3.0
_LEAST_ANGLE_DEG = 60.0
# A pinhole sees nothing beyond 90 degrees from the axis: the outermost corners are left out, by share of the radius.
_INNER_SHARE = 0.85
_ANGLES_AT_THE_RIM_DEG = (55.0, 75.0, 95.0)
_MOST_VIEWS = 30
_NEWTON_STEPS = 20
# Free intrinsics, in the order of `Camera.intrinsics`: fx, fy, cx, cy, then k1..k4 as well.
_STAGES = (np.arange(4), np.array([0, 1, 2, 3, 5, 6, 7, 8]))


@dataclass(frozen=True, slots=True, eq=False)
class AngleLens:
    """Kannala and Brandt's lens, for rays in front of the camera.

    Attributes
    ----------
    coefficients : ndarray of shape (4,)
        (k1, k2, k3, k4).
    """

    coefficients: FloatArray

    @property
    def coefficient_names(self) -> tuple[str, ...]:
        """Names of the coefficients."""
        return ("k1", "k2", "k3", "k4")

    @property
    def valid_radius(self) -> float:
        """Infinite: the formula is used in front of the camera only, to judge a fit."""
        return float("inf")

    @property
    def valid_radius_distorted(self) -> float:
        """Infinite, as `valid_radius`."""
        return float("inf")

    def with_coefficients(self, coefficients: npt.ArrayLike) -> AngleLens:
        """Return the same kind of lens with other coefficients."""
        return AngleLens(np.asarray(coefficients, dtype=np.float64))

    def distort(self, points: npt.ArrayLike) -> FloatArray:
        """Distort points of shape (..., 2)."""
        return self.distort_unchecked(points)

    def distort_unchecked(self, points: npt.ArrayLike) -> FloatArray:
        """Distort points of shape (..., 2)."""
        xy = np.asarray(points, dtype=np.float64)
        r, along = _polar(xy)
        distorted: FloatArray = along * self._radius(np.arctan(r))[..., None]
        return distorted

    def undistort(self, points: npt.ArrayLike) -> FloatArray:
        """Invert `distort` for points of shape (..., 2); NaN at a right angle from the axis and beyond."""
        theta = self.angles(points)
        _, along = _polar(np.asarray(points, dtype=np.float64))
        inside = (theta >= 0) & (theta < np.pi / 2)
        undistorted: FloatArray = along * np.tan(np.where(inside, theta, np.nan))[..., None]
        return undistorted

    def angles(self, points: npt.ArrayLike) -> FloatArray:
        """Angle from the axis, in radians, at which distorted points of shape (..., 2) are seen, by Newton's method."""
        r, _ = _polar(np.asarray(points, dtype=np.float64))
        theta = r.copy()
        for _ in range(_NEWTON_STEPS):
            theta = theta - (self._radius(theta) - r) / self._slope(theta)
        return theta

    def jacobian_points(self, points: npt.ArrayLike) -> FloatArray:
        """Differentiate by the point: shape (..., 2, 2)."""
        r, along = _polar(np.asarray(points, dtype=np.float64))
        theta = np.arctan(r)
        across = np.divide(self._radius(theta), r, out=np.ones_like(r), where=r > 0)
        outward = self._slope(theta) / (1 + r**2)
        radial = along[..., :, None] * along[..., None, :]
        jacobian: FloatArray = across[..., None, None] * np.eye(2) + (outward - across)[..., None, None] * radial
        return jacobian

    def jacobian_coefficients(self, points: npt.ArrayLike) -> FloatArray:
        """Differentiate by the coefficients: shape (..., 2, 4)."""
        r, along = _polar(np.asarray(points, dtype=np.float64))
        powers: FloatArray = along[..., None] * (np.arctan(r)[..., None] ** [3, 5, 7, 9])[..., None, :]
        return powers

    def _radius(self, theta: FloatArray) -> FloatArray:
        """Distance from the centre of rays at an angle from the axis."""
        k1, k2, k3, k4 = self.coefficients
        s = theta**2
        radius: FloatArray = theta * (1 + s * (k1 + s * (k2 + s * (k3 + s * k4))))
        return radius

    def _slope(self, theta: FloatArray) -> FloatArray:
        """Derivative of `_radius` by the angle."""
        k1, k2, k3, k4 = self.coefficients
        s = theta**2
        slope: FloatArray = 1 + s * (3 * k1 + s * (5 * k2 + s * (7 * k3 + s * 9 * k4)))
        return slope


@dataclass(frozen=True, slots=True)
class FisheyeFit:
    """A fisheye fitted to corners.

    Attributes
    ----------
    rms_px : float
        Root mean square residual length of the corners that it was fitted to: those nearer to the centre.
    pinhole_rms_px : float
        The same of the best polynomial pinhole; inf if there is none.
    left_px : float
        What that pinhole leaves of all corners.
    angle_deg : float
        How far from the axis the corners reach.
    """

    rms_px: float
    pinhole_rms_px: float
    left_px: float
    angle_deg: float

    @property
    def is_fisheye(self) -> bool:
        """Whether this is the lens, and no pinhole."""
        better = self.pinhole_rms_px > max(_LEAST_RMS_PX, _TIMES_BETTER * self.rms_px)
        return better and self.rms_px < LARGEST_RMS_PX and self.angle_deg > _LEAST_ANGLE_DEG

    @property
    def findings(self) -> tuple[Finding, ...]:
        """`fisheye` if it is one."""
        if not self.is_fisheye:
            return ()
        return (Finding("fisheye", "rejected", self.angle_deg, self.text, ADVICE),)

    @property
    def text(self) -> str:
        """What was found, as a clause."""
        fits = f"a fisheye model {rounded(self.rms_px)} px"
        if np.isfinite(self.left_px):
            fits = f"a pinhole leaves {rounded(self.left_px)} px ({rounded(self.pinhole_rms_px)} px where {fits})"
        else:
            fits = f"no pinhole can be fitted, {fits}"
        return f"this is a fisheye: {fits}; its corners reach {self.angle_deg:.0f}° from the axis"


def check_fisheye(minimum: Minimum) -> FisheyeFit | None:
    """Try a fisheye where a pinhole does not fit.

    Parameters
    ----------
    minimum : Minimum
        Where a calibration ended.

    Returns
    -------
    FisheyeFit or None
        None if the calibration fits well enough, or no fisheye can be fitted.
    """
    if _rms_px(minimum.state, minimum.seen) <= _LEAST_RMS_PX:
        return None
    pinhole = remodelled(minimum, POLYNOMIALS[-1]) or minimum
    keep = _inner(minimum.seen, minimum.state.camera.size)
    inner = minimum.seen.only(keep)
    views = np.unique(minimum.seen.view[keep])
    if views.size < FEWEST_VIEWS:
        return None
    # Both are fitted to the same corners.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = descend(pinhole.state.of_views(views), inner, pinhole.columns)
    left = _rms_px(found.state, inner), _rms_px(pinhole.state, minimum.seen)
    return _fitted(inner, minimum.seen, minimum.state.camera.size, *left)


def fit_fisheye(detections: Sequence[Detection], object_points: FloatArray) -> FisheyeFit | None:
    """Try a fisheye on corners that no pinhole could be solved from.

    Parameters
    ----------
    detections : sequence of Detection
        Usable views of one image size.
    object_points : ndarray of shape (N, 3)
        The board's features in metres, by id.

    Returns
    -------
    FisheyeFit or None
        With an infinite RMS of the pinhole; None if no fisheye can be fitted.
    """
    seen, size = Observations.gather(detections, object_points), detections[0].size
    inner = seen.only(_inner(seen, size))
    return _fitted(inner, seen, size, float("inf"), float("inf")) if inner.starts.size >= FEWEST_VIEWS else None


def _fitted(
    inner: Observations, seen: Observations, size: tuple[int, int], pinhole_rms_px: float, left_px: float
) -> FisheyeFit | None:
    """Fit a fisheye to the inner corners, from several guesses at its focal length."""
    centre = (np.array(size) - 1) / 2
    rim_px = np.linalg.norm(seen.corners_px - centre, axis=1).max()
    lens = AngleLens(np.zeros(4))
    best: State | None = None
    for angle in np.radians(_ANGLES_AT_THE_RIM_DEG):
        focal = rim_px / angle
        camera = Camera(size, [[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]], lens)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            start = reposed(facing(camera, inner), inner)
            if start is None:
                continue
            for columns in _STAGES:
                start = descend(start, inner, columns).state
        if best is None or _rms_px(start, inner) < _rms_px(best, inner):
            best = start
    if best is None or not np.isfinite(_rms_px(best, inner)):
        return None
    fitted = AngleLens(best.camera.dist)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        angles = fitted.angles(best.camera.normalised_from_pixels(seen.corners_px))
    return FisheyeFit(_rms_px(best, inner), pinhole_rms_px, left_px, float(np.degrees(angles.max())))


def _inner(seen: Observations, size: tuple[int, int]) -> BoolArray:
    """Corners (M,) near enough to the centre, of some of the views, and of those that keep enough of them."""
    radius = np.linalg.norm(seen.corners_px - (np.array(size) - 1) / 2, axis=1)
    some = np.unique(np.linspace(0, seen.starts.size - 1, min(seen.starts.size, _MOST_VIEWS)).astype(int))
    near = (radius <= _INNER_SHARE * radius.max()) & np.isin(seen.view, some)
    enough = np.add.reduceat(near.astype(int), seen.starts) >= FEWEST_CORNERS
    inner: BoolArray = near & enough[seen.view]
    return inner


def _rms_px(state: State, seen: Observations) -> float:
    """Root mean square residual length, unweighted; inf where a point falls behind the camera."""
    squares = (residuals(state, seen) ** 2).sum(axis=1)
    return float(np.sqrt(np.where(np.isfinite(squares), squares, np.inf).mean()))


def _polar(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances (...,) of points (..., 2) from the centre, and directions (..., 2); 0 at the centre."""
    r = np.linalg.norm(points, axis=-1)
    along: FloatArray = points / np.where(r > 0, r, 1.0)[..., None]
    return r, along
