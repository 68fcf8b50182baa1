"""Lengths in pixels as bands of colour, the same in every figure, so that one can be held against another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from camcal.geometry.arrays import FloatArray
from camcal.report.figures.style import Style

LEVELS_PX = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
"""Between which the colour changes."""


def fill_bands(axes: Axes, x: FloatArray, y: FloatArray, length_px: FloatArray, style: Style) -> FloatArray:
    """Fill an image with its bands, hatched where a length is not known.

    Parameters
    ----------
    axes : Axes
    x : ndarray of shape (C,)
    y : ndarray of shape (R,)
        Pixels.
    length_px : ndarray of shape (R, C)
        NaN where it is not known.
    style : Style

    Returns
    -------
    ndarray of shape (R, C)
        The lengths, masked where they are not known; nothing is filled if that is everywhere.
    """
    known = np.ma.masked_invalid(length_px)
    if known.count() < length_px.size:
        axes.set_facecolor(style.shade)
        axes.patch.set(hatch="///", edgecolor=style.grid)
    if known.count():
        axes.contourf(x, y, known, levels=LEVELS_PX, colors=_colours().colors, extend="both")
    return known


def band_key(figure: Figure, axes: Sequence[Axes], label: str, style: Style) -> None:
    """Put the key of the bands below axes."""
    colours = _colours()
    bar = figure.colorbar(
        ScalarMappable(BoundaryNorm(LEVELS_PX, colours.N, extend="both"), colours),
        ax=list(axes),
        orientation="horizontal",
        ticks=LEVELS_PX,
        format="%g",
        aspect=45,
        pad=0.04,
    )
    bar.set_label(label, color=style.ink)
    bar.ax.tick_params(colors=style.muted, labelcolor=style.muted)
    bar.outline.set_edgecolor(style.muted)


def _colours() -> ListedColormap:
    """One colour for each band, and for what is below and above them."""
    return ListedColormap(colormaps["viridis"](np.linspace(0.0, 1.0, len(LEVELS_PX) + 1)))
