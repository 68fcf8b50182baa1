"""Residuals against the distance from the principal point: what a radial lens model leaves over shows as a wave."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from camcal.geometry.arrays import FloatArray
from camcal.observations import Calibration
from camcal.report.figures.canvas import blank, dots, dress, legend
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record
from camcal.trust.wording import rounded

_MOST_GROUPS, _FEWEST_IN_A_GROUP = 24, 40
_SPREAD = (0.16, 0.84)
_MANY = 4000
_SHOWN_SHARE, _ROOM = 0.998, 1.15


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw the radial part of each residual, positive outwards, with its running median and spread."""
    radius, outward = radial_residuals(record.calibration)
    figure = blank(3.2, style)
    axes = figure.subplots()
    title = "Radial part of the residuals, positive outwards"
    dress(axes, style, title, "distance from the principal point (px)", "radial residual (px)", grid="y")
    dots(axes, np.stack([radius, outward], axis=1), style.plain, area=6, alpha=0.5 if radius.size < _MANY else 0.15)
    centres, low, middle, high = running(radius, outward)
    axes.axhline(0, color=style.muted, linewidth=0.8)
    axes.fill_between(centres, low, high, color=style.notable, alpha=0.3, linewidth=0, label="16th to 84th percentile")
    axes.plot(centres, middle, color=style.notable, linewidth=2.2, label="running median")
    reach = float(np.quantile(np.abs(outward), _SHOWN_SHARE)) * _ROOM or 1.0
    axes.set_ylim(-reach, reach)
    axes.set_xlim(0, None)
    beyond = int((np.abs(outward) > reach).sum())
    if beyond:
        axes.plot([], [], " ", label=f"{beyond} not shown")
    legend(axes, style, loc="upper left", ncols=3)
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and how far the median strays."""
    radius, outward = radial_residuals(record.calibration)
    _, _, middle, _ = running(radius, outward)
    # The standard deviation of a median of n Gaussian values is sqrt(π / 2n) times theirs.
    noise = float(np.sqrt(np.pi / 2 * middle.size / radius.size)) * record.calibration.rms_px / np.sqrt(2)
    return (
        "Good: a median that stays on zero at every distance. A wave means that the lens model does not follow the lens. Here "
        f"it strays up to {rounded(float(np.abs(middle).max()))} px; noise alone makes that about {rounded(2 * noise)} px."
    )


def radial_residuals(calibration: Calibration) -> tuple[FloatArray, FloatArray]:
    """Distance of each corner from the principal point, and the outward part of its residual, each of shape (M,), pixels."""
    away = np.concatenate([seen.corners_px for seen in calibration.detections]) - calibration.camera.K[:2, 2]
    radius = np.linalg.norm(away, axis=1)
    outward = (np.concatenate(calibration.residuals_px) * away).sum(axis=1) / np.maximum(radius, np.finfo(float).tiny)
    return radius, outward


def running(radius: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Median radius, and 16th, 50th and 84th percentile of values, of groups of as many neighbours in radius, each (G,)."""
    groups = int(np.clip(radius.size // _FEWEST_IN_A_GROUP, 1, _MOST_GROUPS))
    parts = np.array_split(np.argsort(radius, kind="stable"), groups)
    rows = [(np.median(radius[part]), *np.quantile(values[part], (_SPREAD[0], 0.5, _SPREAD[1]))) for part in parts]
    centres, low, middle, high = np.array(rows).T
    return centres, low, middle, high
