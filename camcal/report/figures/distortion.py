"""What the lens does: by how much it moves a point towards or away from the middle, against where the point is seen."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.report.figures.canvas import blank, dress, legend, not_available
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record

_RADII, _DIRECTIONS = 161, 48
_FAR_ENOUGH = 0.75


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw the displacement from an ideal pinhole camera, with the range of the corners and the valid radius."""
    camera = record.calibration.camera
    figure = blank(3.3, style)
    axes = figure.subplots()
    title = "Where the lens puts a point, against an ideal pinhole"
    dress(axes, style, title, "distance from the principal point in the image (px)", "displacement (px)", grid="y")
    farthest = farthest_px(camera)
    axes.set_xlim(0, farthest)
    radius, displacement = displacements(camera)
    known = np.isfinite(displacement).all(axis=1)
    if known.sum() < 2:
        not_available(axes, style, "the lens has no inverse in this image")
        return figure
    _draw_ranges(axes, record, farthest, style)
    low, high = displacement[known].min(axis=1), displacement[known].max(axis=1)
    axes.fill_between(radius[known], low, high, color=style.plain, alpha=0.3, linewidth=0)
    axes.plot(radius[known], np.median(displacement[known], axis=1), color=style.plain, linewidth=2.2, label="this lens")
    axes.axhline(0, color=style.strong, linewidth=1.2, linestyle=(0, (5, 3)), label="ideal pinhole")
    spread = max(float(high.max()), 0.0) - min(float(low.min()), 0.0) or 1.0
    axes.set_ylim(min(float(low.min()), 0.0) - 0.12 * spread, max(float(high.max()), 0.0) + 0.12 * spread)
    legend(axes, style, loc="lower left" if abs(low.min()) > abs(high.max()) else "upper left")
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and how far the lens may be used."""
    camera = record.calibration.camera
    good = "Good: a smooth curve, and corners (shaded) as far as you will measure. Negative is barrel, positive pincushion."
    valid, farthest = camera.valid_radius_px, farthest_px(camera)
    if valid < farthest:
        return f"{good} Beyond {valid:.0f} px the model turns back on itself: nothing there can be undistorted."
    reach = float(corner_radii(record).max())
    if reach < _FAR_ENOUGH * farthest:
        return (
            f"{good} Here they reach {reach:.0f} of the {farthest:.0f} px to the image's corner: beyond, the curve is a guess."
        )
    return (
        f"{good} Here they reach {reach:.0f} of the {farthest:.0f} px to the image's corner, and the model holds all the way."
    )


def farthest_px(camera: Camera) -> float:
    """Distance from the principal point to the farthest corner of the image, pixels."""
    width, height = camera.size
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]]) - 0.5
    return float(np.linalg.norm(corners - camera.K[:2, 2], axis=1).max())


def corner_radii(record: Record) -> FloatArray:
    """Distance of every corner from the principal point, shape (M,), pixels."""
    corners = np.concatenate([seen.corners_px for seen in record.calibration.detections])
    radii: FloatArray = np.linalg.norm(corners - record.calibration.camera.K[:2, 2], axis=1)
    return radii


def displacements(camera: Camera) -> tuple[FloatArray, FloatArray]:
    """By how much the lens moves points outwards, in many directions.

    Returns
    -------
    radius : ndarray of shape (R,)
        Distance from the principal point at which points are seen, up to the image's farthest corner, pixels.
    displacement : ndarray of shape (R, D)
        `radius` minus the distance at which a pinhole camera with the same K would see the point, by direction, pixels;
        NaN where there is no ray.
    """
    radius = np.linspace(0.0, farthest_px(camera), _RADII)
    angle = np.arange(_DIRECTIONS) / _DIRECTIONS * 2 * np.pi
    pixels = camera.K[:2, 2] + radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    with np.errstate(all="ignore"):
        ideal = camera.pixels_from_normalised(camera.unproject(pixels)[..., :2])
        displacement = radius[:, None] - np.linalg.norm(ideal - camera.K[:2, 2], axis=-1)
    return radius, displacement


def _draw_ranges(axes: Axes, record: Record, farthest: float, style: Style) -> None:
    """Shade where corners were seen, and hatch what lies beyond the valid radius."""
    reach = corner_radii(record)
    axes.axvspan(reach.min(), reach.max(), color=style.shade, linewidth=0, label=f"corners, up to {reach.max():.0f} px")
    valid = record.calibration.camera.valid_radius_px
    if valid < farthest:
        axes.axvspan(valid, farthest, facecolor="none", edgecolor=style.bad, hatch="///", linewidth=0, alpha=0.6)
        axes.axvline(valid, color=style.bad, linewidth=1.6, label=f"valid up to {valid:.0f} px")
