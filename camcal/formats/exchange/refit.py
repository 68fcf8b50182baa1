"""A camera refitted to the lens that a format has: never truncated, and the difference told in pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.errors import QualityError
from camcal.formats.exchange.profile import COEFFICIENTS, ForeignLens, Profile
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera

_GRID_COLUMNS = 96
_STEPS = 50
_CONVERGED_PX = 1e-9
_TABLE = 20_000
_DENOMINATOR = ("k4", "k5", "k6")
# Coefficients of our own lens that a foreign one is fitted with, simplest first: a denominator follows odd powers of r far
# better, but fewer other tools hold it, and not every lens keeps the larger ones from turning back.
_OWN = (("k1", "k2", "k3"), ("k1", "k2", "k3", "k4"), ("k1", "k2", "k3", "k4", "k5", "k6"))
_CLOSE_PX = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Refit:
    """A camera and how far it is from the one it stands for.

    Attributes
    ----------
    camera : Camera
    lost : tuple of str
        What could not be held; empty if the camera is the same.
    max_px, rms_px : float
        Largest, and root mean square, distance between where the two see the same point, over the image.
    """

    camera: Camera
    lost: tuple[str, ...] = ()
    max_px: float = 0.0
    rms_px: float = 0.0

    @property
    def told(self) -> str:
        """The difference in words."""
        return f"up to {self.max_px:.3g} px (rms {self.rms_px:.2g} px) over the image"


def refitted(camera: Camera, profile: Profile) -> Refit:
    """Return the camera that a format can hold and that is nearest to a given one.

    Least squares over a grid that covers the image evenly: the points that the given camera sees at its crossings are to be
    seen there. Focal lengths, principal point and the format's coefficients are free (a denominator or a skew only if the
    camera has one); the camera frame stays what it is.

    Parameters
    ----------
    camera : Camera
    profile : Profile

    Returns
    -------
    Refit
        Of the given camera itself if the format holds it.

    Raises
    ------
    QualityError
        If the format's lens turns back within the image.
    """
    lost = profile.missing(camera)
    if not lost:
        return Refit(camera)
    pixels = _grid(camera.size)
    rays = camera.unproject(pixels)
    seen = np.isfinite(rays[:, 0])
    used = dict(zip(COEFFICIENTS, camera.dist.tolist(), strict=True))
    # A denominator or a skew that the camera has no use for would only make the problem indefinite.
    free = tuple(name for name in profile.lens_or_largest(camera) if name not in _DENOMINATOR or used[name] != 0)
    skew = profile.skew and bool(camera.K[0, 1] != 0)
    fitted = _fit(rays[seen], pixels[seen], camera, free, skew=skew, one_focal=profile.one_focal)
    return _measured(fitted, rays[seen], pixels[seen], lost, profile.title)


def from_foreign(camera: Camera, foreign: ForeignLens) -> Refit:
    """Return the camera of camcal's own lens that stands for one with a foreign radial lens.

    It has the fewest coefficients that come within 0.01 px of it all over the image, or else those that come nearest.

    Parameters
    ----------
    camera : Camera
        The pinhole camera behind the foreign lens.
    foreign : ForeignLens

    Raises
    ------
    QualityError
        If no lens of camcal's comes near.
    """
    pixels = _grid(camera.size)
    distorted = camera.normalised_from_pixels(pixels)
    radius_d = np.hypot(*distorted.T)
    # A table of the lens turned round starts the search; where the lens has turned back there is nothing to fit.
    table = np.linspace(0, 4 * radius_d.max() + 1e-12, _TABLE)
    table_d = foreign.distort(table)
    turns = np.flatnonzero(np.diff(table_d) <= 0)
    end = turns[0] + 1 if turns.size else table.size
    inside = radius_d <= table_d[end - 1]
    radius = np.interp(radius_d[inside], table_d[:end], table[:end])
    with np.errstate(invalid="ignore", divide="ignore"):
        direction = np.where(radius_d[inside, None] > 0, distorted[inside] / radius_d[inside, None], 0.0)
    rays = np.column_stack([direction * radius[:, None], np.ones(radius.size)])
    # The table's rounding moves the points, not the answer: they are sent through the foreign lens exactly.
    seen = camera.pixels_from_normalised(direction * foreign.distort(radius)[:, None])
    one_focal = bool(camera.K[0, 0] == camera.K[1, 1])
    fits: list[Refit] = []
    faults: list[QualityError] = []
    for free in _OWN:
        fitted = _fit(rays, seen, camera, free, skew=False, one_focal=one_focal)
        try:
            fits.append(_measured(fitted, rays, seen, (foreign.name,), "camcal"))
        except QualityError as error:
            faults.append(error)
        if fits and fits[-1].max_px <= _CLOSE_PX:
            break
    if not fits:
        raise faults[0]
    return min(fits, key=lambda fit: fit.max_px)


def _grid(size: tuple[int, int]) -> FloatArray:
    """Crossings of a grid of cells, as square as may be, that covers the image to its outer edge: shape (M, 2)."""
    width, height = size
    rows = max(2, round(_GRID_COLUMNS * height / width))
    u = np.linspace(-0.5, width - 0.5, _GRID_COLUMNS)
    v = np.linspace(-0.5, height - 0.5, rows)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def _fit(rays: FloatArray, pixels: FloatArray, start: Camera, free: tuple[str, ...], *, skew: bool, one_focal: bool) -> Camera:
    """Fit a camera to where points (M, 3) are seen, pixels (M, 2), by Gauss-Newton with halved steps."""
    directions = _directions(start, free, skew=skew, one_focal=one_focal)
    values = np.where(directions.any(axis=1), start.intrinsics, 0.0)
    if one_focal:
        values[:2] = values[:2].mean()
    # With K given, the numerator's coefficients are a linear problem: it starts anywhere.
    lens_only = directions[:, -len(free) :] if free else directions
    camera = start.with_intrinsics(values)
    for columns in [lens_only] * 2 + [directions] * _STEPS:
        seen, _, jacobian = camera.project_with_jacobians(rays)
        residual = (pixels - seen).ravel()
        slope = jacobian.reshape(-1, values.size) @ columns
        scale = np.linalg.norm(slope, axis=0)
        scale[scale == 0] = 1.0
        step = columns @ (np.linalg.lstsq(slope / scale, residual, rcond=1e-12)[0] / scale)
        shorter = _shortened(camera, values, step, rays, pixels)
        values = values + shorter * step
        moved = start.with_intrinsics(values)
        change = np.abs(_seen(moved, rays) - seen).max()
        camera = moved
        if columns is directions and (change < _CONVERGED_PX or shorter == 0):
            break
    return camera


def _directions(start: Camera, free: tuple[str, ...], *, skew: bool, one_focal: bool) -> FloatArray:
    """How the free parameters move the intrinsics: one column for each, the lens's last."""
    index = start.intrinsic_names.index
    groups: list[tuple[str, ...]] = [("fx", "fy")] if one_focal else [("fx",), ("fy",)]
    groups += [("cx",), ("cy",)] + [("skew",)] * skew + [(name,) for name in free]
    directions = np.zeros((len(start.intrinsic_names), len(groups)))
    for column, names in enumerate(groups):
        directions[[index(name) for name in names], column] = 1.0
    return directions


def _shortened(camera: Camera, values: FloatArray, step: FloatArray, rays: FloatArray, pixels: FloatArray) -> float:
    """Share of a step that makes the sum of squares smaller; 0 if none does."""

    def cost(candidate: Camera) -> float:
        return float(((pixels - _seen(candidate, rays)) ** 2).sum())

    before = cost(camera)
    for halvings in range(12):
        share = 0.5**halvings
        try:
            if cost(camera.with_intrinsics(values + share * step)) <= before:
                return share
        except ValueError:
            continue
    return 0.0


def _seen(camera: Camera, rays: FloatArray) -> FloatArray:
    """Where a camera's bare formula puts rays (M, 3) with z = 1, past its fold too: pixels (M, 2)."""
    return camera.pixels_from_normalised(camera.lens.distort_unchecked(rays[:, :2]))


def _measured(camera: Camera, rays: FloatArray, pixels: FloatArray, lost: tuple[str, ...], title: str) -> Refit:
    """Measure how far a fitted camera is from what it was fitted to."""
    away = np.linalg.norm(camera.project(rays) - pixels, axis=1)
    if not np.isfinite(away).all():
        share = 100 * float(np.isnan(away).mean())
        raise QualityError(
            f"{title}: cannot hold {', '.join(lost)}, and its own lens, refitted, turns back in {share:.2g} % of the image. "
            "Choose a format that holds it."
        )
    return Refit(camera, lost, float(away.max()), float(np.sqrt((away**2).mean())))
