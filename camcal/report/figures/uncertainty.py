"""Where the projection is known how well: its standard deviation over the image, at the boards' distance and far away."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from camcal.geometry.arrays import FloatArray
from camcal.observations import Calibration
from camcal.report.figures.bands import LEVELS_PX, band_key, fill_bands
from camcal.report.figures.canvas import dress_image, image_figure, not_available
from camcal.report.figures.distortion import farthest_px
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record
from camcal.trust.uncertainty import board_range_m, projection_sigma
from camcal.trust.wording import rounded

_COLUMNS = 121
_DARK_BANDS = 6
_LEAST_SHARE_BETWEEN = 0.05


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw two maps: for points as far away as the boards, and for infinitely far ones."""
    calibration = record.calibration
    range_m = board_range_m(calibration, record.board.object_points)
    figure = image_figure(calibration.camera.size, 2, style, extra_in=0.75)
    left, right = figure.subplots(1, 2)
    _draw_map(left, calibration, range_m, style, f"At the boards' distance, {rounded(range_m)} m")
    _draw_map(right, calibration, float("inf"), style, "Far away (at infinity)")
    right.set_ylabel("")
    band_key(figure, (left, right), "standard deviation of a projected point, along its worst direction (px)", style)
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and what there is."""
    good = (
        "Good: below 0.1 px wherever you measure. Outside the dashed line no corner was seen: the lens is only guessed there."
    )
    camera = record.calibration.camera
    if camera.valid_radius_px < farthest_px(camera):
        good += " Where it is hatched, the lens model gives no ray."
    known = record.intrinsics.uncertainty
    if known is None or not np.isfinite(known.at_range.centre_px):
        return good
    return (
        f"{good} Here: {rounded(known.at_range.centre_px)} px in the middle at the boards' distance, and below 0.1 px over "
        f"{100 * known.at_range.shares[0]:.0f} % of the image."
    )


def sigma_map(calibration: Calibration, range_m: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Standard deviations on a grid that spans the image to its outer edges.

    Returns
    -------
    x : ndarray of shape (C,)
    y : ndarray of shape (R,)
        Pixels.
    sigma : ndarray of shape (R, C)
        Pixels; NaN where there is no ray or no finite answer.
    """
    width, height = calibration.camera.size
    rows = int(np.clip(round(_COLUMNS * height / width), 9, 3 * _COLUMNS))
    x, y = np.linspace(-0.5, width - 0.5, _COLUMNS), np.linspace(-0.5, height - 0.5, rows)
    pixels = np.stack(np.meshgrid(x, y), axis=-1)
    with np.errstate(all="ignore"):
        sigma = projection_sigma(calibration, pixels.reshape(-1, 2), range_m).reshape(rows, _COLUMNS)
    return x, y, np.where(np.isfinite(sigma), sigma, np.nan)


def _apart(sigma: Any, levels: list[float]) -> list[float]:
    """Leave out levels whose lines are too near the one before to be labelled as well."""
    kept: list[float] = []
    below = 0.0
    for level in levels:
        share = float((sigma < level).mean())
        if share - below >= _LEAST_SHARE_BETWEEN:
            kept.append(level)
            below = share
    return kept


def _draw_map(axes: Axes, calibration: Calibration, range_m: float, style: Style, title: str) -> None:
    dress_image(axes, calibration.camera.size, style, title)
    x, y, sigma = sigma_map(calibration, range_m)
    known = fill_bands(axes, x, y, sigma, style)
    if not np.ma.count(known):
        not_available(axes, style, "the covariance says nothing here")
        return
    shown = [level for level in LEVELS_PX if known.min() < level < known.max()]
    if shown:
        inks = ["#ffffff" if LEVELS_PX.index(level) < _DARK_BANDS else "#000000" for level in shown]
        lines = axes.contour(x, y, known, levels=shown, colors=inks, linewidths=0.7)
        axes.clabel(lines, levels=_apart(known, shown), fmt="%g", fontsize=9, inline_spacing=2)
    corners = np.concatenate([seen.corners_px for seen in calibration.detections]).astype(np.float32)
    hull = cv2.convexHull(corners).reshape(-1, 2)
    hull = np.concatenate([hull, hull[:1]])
    axes.plot(*hull.T, color="#000000", linewidth=2.4, alpha=0.45)
    axes.plot(*hull.T, color="#ffffff", linewidth=1.2, linestyle=(0, (4, 3)))
