"""What the figures have in common: blank figures, dressed axes, images as frames, dots and arrows by the thousand."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import ScaledTranslation

from camcal.geometry.arrays import FloatArray
from camcal.report.figures.style import Style

WIDTH_IN = 7.2
"""Width of every figure: 518 pt, or 691 CSS pixels."""

MOST_VECTORS = 400
"""More dots or arrows than this are stored as pixels: a page holds dozens of figures."""

_MOST_DOTS = 20_000
# Around an image: labels to its left and below, and how tall it may become.
_BESIDE_IN, _BELOW_IN, _TALLEST_IN = 0.75, 0.85, 4.6
_HEAD_SHARE, _HEAD_HALF_ANGLE = 0.3, np.radians(25)
_KEY_DROP_IN, _KEY_GAP_IN = 0.42, 0.08
_LEAST_MAGNIFICATION, _LARGEST_MAGNIFICATION = 1e-12, 1e9


def blank(height_in: float, style: Style) -> Figure:
    """Return an empty figure that arranges its axes itself."""
    ground = style.paper if style.opaque else "none"
    figure = Figure(figsize=(WIDTH_IN, height_in), layout="constrained", facecolor=ground)
    FigureCanvasAgg(figure)
    return figure


def image_figure(size: tuple[int, int], panels: int, style: Style, extra_in: float = 0.0) -> Figure:
    """Return an empty figure with room for panels that are images (width, height) side by side, and a strip more."""
    width_in = WIDTH_IN / panels - _BESIDE_IN
    return blank(min(_TALLEST_IN, width_in * size[1] / size[0]) + _BELOW_IN + extra_in, style)


def dress(axes: Any, style: Style, title: str, x: str, y: str, *, grid: str = "") -> None:
    """Give axes their title, labels with units, and colours; with grid lines along "x", "y" or "both" no box."""
    axes.set_title(title, color=style.ink, pad=7)
    axes.set_xlabel(x, color=style.ink)
    axes.set_ylabel(y, color=style.ink)
    axes.tick_params(colors=style.muted, labelcolor=style.muted, which="both")
    axes.set_facecolor("none")
    for name, spine in axes.spines.items():
        spine.set_color(style.muted)
        spine.set_visible(name in {"left", "bottom"} or not grid)
    if grid:
        axes.grid(axis=grid, color=style.grid)


def dress_image(axes: Axes, size: tuple[int, int], style: Style, title: str) -> None:
    """Make axes the frame of an image (width, height) in pixels, y down, up to the outer edges of its pixels."""
    dress(axes, style, title, "x (px)", "y (px)")
    axes.set_xlim(-0.5, size[0] - 0.5)
    axes.set_ylim(size[1] - 0.5, -0.5)
    axes.set_aspect("equal")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))


def legend(axes: Axes, style: Style, **place: Any) -> None:
    """Name what was labelled, on the ground of the page."""
    axes.legend(
        labelcolor=style.ink,
        facecolor=style.paper,
        edgecolor="none",
        framealpha=0.8,
        handlelength=1.6,
        borderaxespad=0.3,
        **place,
    )


def not_available(axes: Axes, style: Style, why: str) -> None:
    """Say in the middle of flat axes that there is nothing to show, and why."""
    text = axes.text(0.5, 0.5, f"not available:\n{why}", ha="center", va="center", color=style.muted)
    text.set_transform(axes.transAxes)


def dots(axes: Axes, xy: FloatArray, colour: str, *, area: float = 9.0, alpha: float = 0.7, label: str = "") -> None:
    """Draw points (N, 2); of very many, which hide one another, every n-th."""
    xy = xy[:: -(-len(xy) // _MOST_DOTS)]
    axes.scatter(
        xy[:, 0],
        xy[:, 1],
        s=area,
        color=colour,
        alpha=alpha,
        linewidths=0,
        rasterized=len(xy) > MOST_VECTORS,
        label=label or None,
    )


def arrows(
    axes: Axes, tails: FloatArray, vectors: FloatArray, colour: str, *, width: float = 1.0, label: str = ""
) -> PathPatch:
    """Draw arrows as one path.

    Parameters
    ----------
    axes : Axes
    tails : ndarray of shape (N, 2)
        In the axes' coordinates.
    vectors : ndarray of shape (N, 2)
        From tail to tip, magnified already.
    colour : str
    width : float
        Of the lines, in points.
    label : str
        For the legend.

    Returns
    -------
    PathPatch
        Five vertices an arrow: tail, tip, one end of the head, tip, the other end.
    """
    tips = tails + vectors
    back = -_HEAD_SHARE * vectors
    cosine, sine = np.cos(_HEAD_HALF_ANGLE), np.sin(_HEAD_HALF_ANGLE)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    vertices = np.stack([tails, tips, tips + back @ turn, tips, tips + back @ turn.T], axis=1).reshape(-1, 2)
    codes = np.tile([Path.MOVETO, Path.LINETO, Path.MOVETO, Path.LINETO, Path.LINETO], len(tails))
    path = Path(vertices, codes)
    path.should_simplify = False
    patch = PathPatch(path, fill=False, edgecolor=colour, linewidth=width, capstyle="round", joinstyle="round")
    patch.set_label(label)
    patch.set_rasterized(len(tails) > MOST_VECTORS)
    axes.add_patch(patch)
    return patch


def length_key(axes: Axes, style: Style, length: float, label: str) -> None:
    """Draw a length along x, in the axes' coordinates, under their right end."""
    right = max(axes.get_xlim())
    place = axes.get_xaxis_transform() + ScaledTranslation(0, -_KEY_DROP_IN, axes.figure.dpi_scale_trans)
    axes.plot([right - length, right], [0, 0], color=style.ink, marker="|", linewidth=1.4, transform=place, clip_on=False)
    beside = place + ScaledTranslation(-_KEY_GAP_IN, 0, axes.figure.dpi_scale_trans)
    axes.text(right - length, 0, label, ha="right", va="center", color=style.ink, fontsize=9.5, transform=beside)


def round_below(value: float, steps: tuple[float, ...] = (1.0, 2.0, 5.0)) -> float:
    """Return the largest round number, one of the steps times a power of ten, that is not above a positive value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in steps if step * power <= value * (1 + 1e-9)))


def magnification(vectors: FloatArray, room: float) -> float:
    """Return the round factor by which all but a few of vectors (N, 2) become at most as long as the room for them."""
    lengths = np.linalg.norm(vectors, axis=1)
    typical = float(np.quantile(lengths, 0.95)) if lengths.size else 0.0
    if not typical > 0:
        return 1.0
    wanted = float(np.clip(room / typical, _LEAST_MAGNIFICATION, _LARGEST_MAGNIFICATION))
    return round_below(wanted, (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0))


def magnified(factor: float) -> str:
    """Say by how much vectors are magnified.

    Examples
    --------
    >>> magnified(200.0), magnified(0.05)
    ('magnified 200×', 'shrunk 20×')
    """
    return f"magnified {factor:,g}×" if factor >= 1 else f"shrunk {1 / factor:,.0f}×"
