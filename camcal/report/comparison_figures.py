"""Figures of comparisons: an estimate against the truth, and the scenarios of the accuracy suite."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from camcal.compare.parameters import ParameterError
from camcal.compare.projection import ProjectionDifference
from camcal.geometry.arrays import FloatArray
from camcal.report.figures.bands import band_key, fill_bands
from camcal.report.figures.canvas import (
    arrows,
    blank,
    dress,
    dress_image,
    image_figure,
    legend,
    length_key,
    magnification,
    magnified,
    round_below,
)
from camcal.report.figures.style import Style, with_plain_settings

_ARROWS_ACROSS = 16
_ROOM_SHARE, _KEY_SHARE = 0.055, 0.2
_ROW_IN, _AROUND_IN = 0.34, 1.0
_USUAL_SIGMAS = 2.0


@with_plain_settings
def difference_figure(size: tuple[int, int], difference: ProjectionDifference, style: Style) -> Figure:
    """Draw how far two cameras of an image size (width, height) disagree: the length over the image, and arrows."""
    figure = image_figure(size, 2, style, extra_in=0.75)
    left, right = figure.subplots(1, 2)
    _draw_lengths(left, size, difference, style)
    _draw_arrows(right, size, difference, style)
    right.set_ylabel("")
    band_key(figure, (left, right), "distance between where the two cameras see a far point (px)", style)
    return figure


@with_plain_settings
def errors_figure(parameters: tuple[ParameterError, ...], style: Style, limit: float | None = None) -> Figure:
    """Draw the error of every parameter that has a standard deviation, in these; with the gate if there is one."""
    known = [error for error in parameters if error.sigma > 0]
    figure = blank(_AROUND_IN + _ROW_IN * len(known), style)
    axes = figure.subplots()
    dress(axes, style, "Error of each parameter", "estimate minus truth, in its standard deviations", "", grid="x")
    errors = np.array([error.error_in_sigma for error in known])
    most = limit if limit is not None else _USUAL_SIGMAS
    axes.axvspan(-most, most, color=style.shade, zorder=0, label=f"within {most:g}")
    colours = [style.bad if abs(error) > most else style.plain for error in errors.tolist()]
    axes.barh(np.arange(len(known)), errors, height=0.6, color=colours)
    axes.axvline(0, color=style.strong, linewidth=1)
    axes.set_yticks(np.arange(len(known)), [error.name for error in known])
    axes.invert_yaxis()
    reach = 1.1 * max(most, float(np.abs(errors).max(initial=0.0)))
    axes.set_xlim(-reach, reach)
    legend(axes, style, loc="lower right")
    return figure


@with_plain_settings
def suite_figure(names: tuple[str, ...], panels: tuple[tuple[str, FloatArray, FloatArray], ...], style: Style) -> Figure:
    """Draw figures of every scenario whose ideal is 1.

    Parameters
    ----------
    names : tuple of str
        Of the scenarios.
    panels : tuple of (str, ndarray of shape (S,), ndarray of shape (S,))
        The title of a figure, its values and those of the baseline (NaN where there is none).
    style : Style
    """
    figure = blank(_AROUND_IN + _ROW_IN * len(names), style)
    every = np.atleast_1d(figure.subplots(1, len(panels), sharey=True))
    rows = np.arange(len(names))
    for axes, (title, values, baseline) in zip(every, panels, strict=True):
        dress(axes, style, title, "times the ideal", "", grid="x")
        axes.barh(rows, values, height=0.6, color=style.plain, label="this run")
        if np.isfinite(baseline).any():
            axes.plot(baseline, rows, "D", color=style.notable, markersize=6, label="baseline")
        axes.axvline(1.0, color=style.strong, linewidth=1.2, linestyle=(0, (5, 3)), label="ideal")
        axes.set_xlim(0, 1.15 * float(np.nanmax([*values, *baseline, 1.0])))
    every[0].set_yticks(rows, list(names))
    every[0].invert_yaxis()
    figure.legend(
        *every[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False, labelcolor=style.ink
    )
    return figure


def _grid(difference: ProjectionDifference) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Columns (C,), rows (R,) and lengths (R, C) of the grid on which two cameras were compared."""
    x, y = (np.unique(difference.pixels[:, axis]) for axis in (0, 1))
    return x, y, np.linalg.norm(difference.difference_px, axis=1).reshape(y.size, x.size)


def _draw_lengths(axes: Axes, size: tuple[int, int], difference: ProjectionDifference, style: Style) -> None:
    dress_image(axes, size, style, "Length of the difference")
    x, y, length = _grid(difference)
    fill_bands(axes, x, y, length, style)


def _draw_arrows(axes: Axes, size: tuple[int, int], difference: ProjectionDifference, style: Style) -> None:
    x, y, _ = _grid(difference)
    step = max(1, round(x.size / _ARROWS_ACROSS))
    chosen = np.zeros((y.size, x.size), dtype=bool)
    chosen[step // 2 :: step, step // 2 :: step] = True
    rows = chosen.ravel() & np.isfinite(difference.difference_px).all(axis=1)
    vectors = difference.difference_px[rows]
    factor = magnification(vectors, _ROOM_SHARE * size[0])
    dress_image(axes, size, style, f"Estimate minus truth, {magnified(factor)}")
    arrows(axes, difference.pixels[rows], factor * vectors, style.plain)
    length = round_below(_KEY_SHARE * size[0] / factor)
    length_key(axes, style, length * factor, f"{length:g} px")
