"""How the boards stood: which way and how far each was tilted, and how far away it was."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, MaxNLocator, NullLocator

from camcal.geometry.arrays import FloatArray
from camcal.report.figures.canvas import blank, dots, dress
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record

LEAST_TILT_DEG = 15.0
"""A board tilted by less says little about the focal length."""

_MANY_RINGS_DEG, _MANY_TIMES = 45, 20


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw the direction and angle of each tilt as seen from the camera, and the angle against the distance."""
    tilt_deg, azimuth, distance_m = stances(record)
    figure = blank(3.5, style)
    left: Any = figure.add_subplot(1, 2, 1, projection="polar")
    right = figure.add_subplot(1, 2, 2)
    largest = float(np.clip(np.ceil(tilt_deg.max() / 15) * 15, 45, 90))
    _draw_directions(left, tilt_deg, azimuth, largest, style)
    _draw_distances(right, tilt_deg, distance_m, largest, style)
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and how the boards stood."""
    tilt_deg, _, distance_m = stances(record)
    tilted = int((tilt_deg >= LEAST_TILT_DEG).sum())
    return (
        f"Good: dots all around, between {LEAST_TILT_DEG:.0f} and 45° (outside the shaded part), and at several distances. "
        f"Here {tilted} of {tilt_deg.size} views are tilted by {LEAST_TILT_DEG:.0f}° or more, from {distance_m.min():.3g} to "
        f"{distance_m.max():.3g} m away."
    )


def stances(record: Record) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How the board of each view stood.

    Returns
    -------
    tilt_deg : ndarray of shape (V,)
        Angle between the board and the image plane, from 0 to 90.
    azimuth : ndarray of shape (V,)
        Direction in the image, radians, 0 to the right and π/2 up, in which the side of the board lies that is nearer.
    distance_m : ndarray of shape (V,)
        From the camera to the board's centre.
    """
    points, poses = record.board.object_points, record.calibration.poses
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    normals = np.array([pose.R[:, 2] * np.sign(pose.R[2, 2] or 1.0) for pose in poses])
    tilt_deg = np.degrees(np.arccos(np.clip(normals[:, 2], -1.0, 1.0)))
    # The normal points away from the camera: what it leans towards is the side that is nearer.
    azimuth = np.arctan2(-normals[:, 1], normals[:, 0])
    distance_m = np.linalg.norm([pose.apply(centre) for pose in poses], axis=1)
    return tilt_deg, azimuth, distance_m


def _draw_directions(axes: Any, tilt_deg: FloatArray, azimuth: FloatArray, largest: float, style: Style) -> None:
    axes.set_title("Tilt, and which side is nearer", color=style.ink, pad=7)
    axes.set_facecolor("none")
    axes.spines["polar"].set_color(style.muted)
    axes.grid(color=style.grid)
    around = np.linspace(0, 2 * np.pi, 181)
    axes.fill_between(around, 0, LEAST_TILT_DEG, color=style.shade, linewidth=0, zorder=0)
    dots(axes, np.stack([azimuth, tilt_deg], axis=1), style.plain, area=26, alpha=0.8)
    axes.set_ylim(0, largest)
    step = 15 if largest <= _MANY_RINGS_DEG else 30
    rings = np.arange(step, largest + 1, step)
    axes.set_yticks(rings, [f"{ring:.0f}°" for ring in rings], color=style.muted)
    axes.set_rlabel_position(_free_direction_deg(azimuth))
    axes.set_xticks(np.radians([0, 90, 180, 270]), ["right", "top", "left", "bottom"], color=style.muted)
    axes.tick_params(axis="x", pad=3)


def _free_direction_deg(azimuth: FloatArray) -> float:
    """Direction between those of the names, degrees, that is farthest from all dots (V,)."""
    directions = np.arange(22.5, 360, 45)
    away = np.abs(np.exp(1j * np.radians(directions))[:, None] - np.exp(1j * azimuth)).min(axis=1)
    return float(directions[np.argmax(away)])


def _draw_distances(axes: Axes, tilt_deg: FloatArray, distance_m: FloatArray, largest: float, style: Style) -> None:
    dress(axes, style, "Distance and tilt", "distance of the board's centre (m)", "tilt (°)", grid="both")
    axes.axhspan(0, LEAST_TILT_DEG, color=style.shade, linewidth=0)
    dots(axes, np.stack([distance_m, tilt_deg], axis=1), style.plain, area=26, alpha=0.8)
    axes.set_ylim(0, largest)
    axes.yaxis.set_major_locator(MaxNLocator(steps=[1.5, 3], nbins=7))
    if distance_m.max() > _MANY_TIMES * distance_m.min():
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(numticks=4))
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_locator(NullLocator())
    else:
        axes.set_xlim(0, 1.08 * distance_m.max())
