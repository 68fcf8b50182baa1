"""The quiver of each view, side by side: what is wrong with one view shows in one, what is wrong with all shows in all."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from camcal.geometry.arrays import FloatArray
from camcal.report.figures.canvas import WIDTH_IN, arrows, blank, dress, length_key, magnification, round_below
from camcal.report.figures.residuals import shown_rows
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.figures.view_rms import short_name
from camcal.report.record import Record
from camcal.trust.wording import rounded

MOST_SHOWN = 30
"""Of more views those are shown that fit worst."""

_MOST_ARROWS = 1700
_MOST_COLUMNS, _FEWEST_COLUMNS = 6, 3
# A cell is one unit wide; its corners stand in the lower part, its name above them.
_CELL_HEIGHT, _CORNERS_WIDTH, _CORNERS_HEIGHT, _NAME_HEIGHT = 1.08, 0.72, 0.56, 0.1
_ROOM_SHARE, _KEY_SHARE = 0.13, 0.3
_LONGEST_NAME, _NAME_PT = 14, 7.5


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw the residuals of each view over its corners, the worst first; every arrow is on the same scale."""
    calibration = record.calibration
    order = _order(record)
    columns = min(_MOST_COLUMNS, max(_FEWEST_COLUMNS, len(order)))
    rows = -(-len(order) // columns)
    figure = blank(0.95 + (WIDTH_IN - 0.4) / columns * rows * _CELL_HEIGHT, style)
    axes = figure.subplots()
    dress(axes, style, _title(len(order), len(calibration.poses)), "above each view its name and RMS (px)", "")
    axes.spines[:].set_visible(False)
    axes.set(xticks=[], yticks=[], xlim=(0, columns), ylim=(rows * _CELL_HEIGHT, 0), aspect="equal")
    residuals = np.concatenate([calibration.residuals_px[index] for index in order])
    factor = magnification(residuals, _ROOM_SHARE)
    tails = []
    for place, index in enumerate(order):
        row, column = divmod(place, columns)
        corner = np.array([column, row * _CELL_HEIGHT])
        tails.append(corner + _in_cell(calibration.detections[index].corners_px))
        _name(axes, corner, 0.0, short_name(calibration.detections[index].source, _LONGEST_NAME), style.ink)
        _name(axes, corner, _NAME_HEIGHT, rounded(calibration.view_rms_px[index]), style.muted)
    shown = shown_rows(len(residuals), _MOST_ARROWS)
    arrows(axes, np.concatenate(tails)[shown], factor * residuals[shown], style.plain, width=0.8)
    length = round_below(_KEY_SHARE / factor)
    length_key(axes, style, length * factor, f"{length:g} px")
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and where the longest residual is."""
    calibration = record.calibration
    longest = [float(np.linalg.norm(residuals, axis=1).max()) for residuals in calibration.residuals_px]
    worst = int(np.argmax(longest))
    return (
        "Good: short arrows in all directions in every view. Arrows that go together in one view: it moved, or its corners are "
        "mistaken; in all views alike: the board or the lens model. Each view is drawn as large as its corners allow. Here the "
        f"longest residual, {rounded(longest[worst])} px, is in {calibration.detections[worst].source}."
    )


def _order(record: Record) -> list[int]:
    """Which views are shown, the worst first."""
    order: list[int] = np.argsort(-np.array(record.calibration.view_rms_px), kind="stable")[:MOST_SHOWN].tolist()
    return order


def _title(shown: int, every: int) -> str:
    return f"Residuals of {every} views, worst first" if shown == every else f"Residuals of the worst {shown} of {every} views"


def _in_cell(corners_px: FloatArray) -> FloatArray:
    """Place corners (N, 2) in a cell, as large as fits."""
    low, high = corners_px.min(axis=0), corners_px.max(axis=0)
    scale = float(np.min([_CORNERS_WIDTH, _CORNERS_HEIGHT] / np.maximum(high - low, 1e-9)))
    below_name = (2 * _NAME_HEIGHT + _CELL_HEIGHT) / 2
    placed: FloatArray = scale * (corners_px - (low + high) / 2) + [0.5, below_name]
    return placed


def _name(axes: Axes, corner: FloatArray, below: float, text: str, colour: str) -> None:
    axes.text(corner[0] + 0.5, corner[1] + 0.04 + below, text, ha="center", va="top", fontsize=_NAME_PT, color=colour)
