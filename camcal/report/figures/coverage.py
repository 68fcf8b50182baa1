"""Where in the image the corners fell: each of them, and how many in each region."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from camcal.geometry.arrays import FloatArray, IntArray
from camcal.report.figures.canvas import MOST_VECTORS, dots, dress_image, image_figure
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record

_SHORT_SIDE = 6
_MOST_CELLS = 12
_COUNT_PT = 9.0


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw every corner over the image, and the number of corners in each region of it."""
    calibration = record.calibration
    corners = np.concatenate([seen.corners_px for seen in calibration.detections])
    size = calibration.camera.size
    figure = image_figure(size, 2, style)
    left, right = figure.subplots(1, 2)
    dress_image(left, size, style, f"{len(corners):,} corners of {len(calibration.detections):,} views")
    many = len(corners) > 10 * MOST_VECTORS
    dots(left, corners, style.plain, area=3 if many else 8, alpha=0.3 if many else 0.75)
    counts = region_counts(corners, size)
    dress_image(right, size, style, f"Corners per region: {(counts > 0).sum()} of {counts.size} reached")
    right.set_ylabel("")
    _draw_counts(right, counts, style)
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and how much was reached."""
    calibration = record.calibration
    counts = region_counts(np.concatenate([seen.corners_px for seen in calibration.detections]), calibration.camera.size)
    empty = int((counts == 0).sum())
    good = "Good: corners everywhere, up to the edges and into each corner of the image."
    if not empty:
        return f"{good} Here every region was reached."
    return f"{good} Here {empty} of {counts.size} regions (hatched) were never reached: hold the board there."


def regions(corners_px: FloatArray, size: tuple[int, int]) -> tuple[IntArray, tuple[int, int]]:
    """Tell in which region of an image corners fell: roughly square ones, six along its shorter side.

    Parameters
    ----------
    corners_px : ndarray of shape (M, 2)
    size : tuple of int
        Image (width, height) in pixels.

    Returns
    -------
    index : ndarray of shape (M,)
        Row times columns plus column; for a corner outside the image that of the nearest region.
    shape : tuple of int
        Number of rows and columns.
    """
    columns, rows = (int(np.clip(round(_SHORT_SIDE * side / min(size)), _SHORT_SIDE, _MOST_CELLS)) for side in size)
    cell = np.clip((corners_px + 0.5) / size * [columns, rows], 0, [columns - 1, rows - 1]).astype(np.int64)
    index: IntArray = cell[:, 1] * columns + cell[:, 0]
    return index, (rows, columns)


def region_counts(corners_px: FloatArray, size: tuple[int, int]) -> IntArray:
    """Count corners (M, 2) by region: shape (rows, columns)."""
    index, shape = regions(corners_px, size)
    counts: IntArray = np.bincount(index, minlength=shape[0] * shape[1]).reshape(shape).astype(np.int64)
    return counts


def _draw_counts(axes: Axes, counts: IntArray, style: Style) -> None:
    """Colour each region by its count, and write it into it."""
    rows, columns = counts.shape
    width, height = max(axes.get_xlim()) + 0.5, max(axes.get_ylim()) + 0.5
    x, y = np.arange(columns + 1) / columns * width - 0.5, np.arange(rows + 1) / rows * height - 0.5
    axes.set_facecolor(style.shade)
    axes.patch.set(hatch="////", edgecolor=style.bad)
    norm = LogNorm(1, max(2, counts.max()))
    axes.pcolormesh(x, y, np.ma.masked_equal(counts, 0), cmap="viridis", norm=norm, edgecolors="face", linewidth=0.4)
    dark = colormaps["viridis"](norm(np.maximum(counts, 1)))[..., :3] @ [0.3, 0.59, 0.11] < 0.5
    for row, column in np.argwhere(counts > 0):
        axes.text(
            (column + 0.5) / columns * width - 0.5,
            (row + 0.5) / rows * height - 0.5,
            _brief(int(counts[row, column])),
            ha="center",
            va="center",
            fontsize=_COUNT_PT,
            color="#ffffff" if dark[row, column] else "#000000",
        )


def _brief(count: int) -> str:
    """Write a count in at most four characters."""
    for size, unit in ((1_000_000, "M"), (1000, "k")):
        if count >= size:
            return f"{count / size:.0f}{unit}" if count >= 10 * size else f"{count / size:.1f}{unit}"
    return str(count)
