"""The boards and the camera in space."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import Bbox
from mpl_toolkits.mplot3d import proj3d  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection  # type: ignore[import-untyped]

from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.report.figures.canvas import blank
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record

# Left, bottom, width and height as shares of the figure: the box that the axes span, without their labels; the colour bar.
_BOX, _COLOUR_BAR = (0.07, 0.12, 0.69, 0.8), (0.87, 0.2, 0.02, 0.6)
_FRUSTUM_SHARE = 0.3
_FITS = 5
_FAR_AWAY = 20.0
_ELEVATION_DEG, _AZIMUTH_DEG = 24.0, -46.0
_LEAST_SIDE_SHARE = 0.25


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw the features' outline of each board, coloured by the RMS of its view, and the camera's frustum."""
    rms = np.array(record.calibration.view_rms_px)
    quads = outlines(record)
    distances = np.linalg.norm(quads.mean(axis=1), axis=1)
    near = distances <= _FAR_AWAY * np.median(distances)
    frustum = _frustum(record.calibration.camera, _FRUSTUM_SHARE * float(np.median(distances)))
    figure = blank(4.5, style)
    figure.set_layout_engine("none")
    axes: Any = figure.add_axes((0, 0, 1, 1), projection="3d", computed_zorder=False)
    colours = ScalarMappable(Normalize(0.0, float(rms.max()) or 1.0), "viridis")
    faces = colours.to_rgba(rms[near])
    axes.add_collection3d(
        Poly3DCollection(_plotted(quads[near]), facecolors=faces, edgecolors=style.muted, linewidths=0.6, alpha=0.6)
    )
    axes.add_collection3d(Line3DCollection(_plotted(frustum), colors=style.bad, linewidths=1.6))
    _dress(axes, np.concatenate([quads[near].reshape(-1, 3), frustum.reshape(-1, 3)]), style)
    left_out = int((~near).sum())
    title = f"{rms.size} boards and the camera" + (f" ({left_out} too far away to show)" if left_out else "")
    figure.text(0.5, 0.985, title, ha="center", va="top", color=style.ink)
    bar = figure.colorbar(colours, cax=figure.add_axes(_COLOUR_BAR))
    bar.set_label("RMS of the view (px)", color=style.ink)
    bar.ax.tick_params(colors=style.muted, labelcolor=style.muted)
    bar.outline.set_edgecolor(style.muted)
    return figure


def caption(record: Record) -> str:  # noqa: ARG001  # every caption is asked alike
    """Say what good looks like."""
    return (
        "Good: boards at several distances, tilted differently, and no single bright one. Boards that all lie in one plane, or "
        "behind the camera, mean that something is wrong."
    )


def outlines(record: Record) -> FloatArray:
    """Corners of the rectangle around each board's features in the camera frame: shape (V, 4, 3), metres."""
    points = record.board.object_points
    (left, top, _), (right, bottom, _) = points.min(axis=0), points.max(axis=0)
    corners = np.array([[left, top, 0], [right, top, 0], [right, bottom, 0], [left, bottom, 0]])
    return np.stack([pose.apply(corners) for pose in record.calibration.poses])


def _frustum(camera: Camera, depth_m: float) -> FloatArray:
    """Edges of the pyramid that the image spans, lens left out: shape (8, 2, 3), metres."""
    width, height = camera.size
    pixels = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    ends = np.concatenate([camera.normalised_from_pixels(pixels), np.ones((4, 1))], axis=1) * depth_m
    rays = np.stack([np.zeros_like(ends), ends], axis=1)
    return np.concatenate([rays, np.stack([ends, np.roll(ends, -1, axis=0)], axis=1)])


def _fit(axes: Any, sides: FloatArray) -> None:
    """Zoom and shift axes whose box has the given sides (3,) until the box fills its place in the figure."""
    room = Bbox.from_bounds(*_BOX)
    zoom = 1.0
    for _ in range(_FITS):
        axes.set_box_aspect(sides, zoom=zoom)
        axes.apply_aspect()
        limits = np.stack([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)
        corners = np.stack(np.meshgrid(*limits.T), axis=-1).reshape(-1, 3)
        x, y, _ = proj3d.proj_transform(*corners.T, axes.get_proj())
        seen = Bbox.null()
        seen.update_from_data_xy(
            axes.figure.transFigure.inverted().transform(axes.transData.transform(np.stack([x, y], axis=1)))
        )
        zoom *= min(room.width / seen.width, room.height / seen.height)
    place = axes.get_position(original=True)
    shift = (room.p0 + room.p1 - seen.p0 - seen.p1) / 2
    axes.set_position(place.translated(*shift))


def _plotted(points: FloatArray) -> FloatArray:
    """Order the axes as they are plotted: x, z (into the picture), y."""
    return points[..., [0, 2, 1]]


def _dress(axes: Any, points: FloatArray, style: Style) -> None:
    """Scale all axes alike around points (N, 3), y downwards."""
    low, high = points.min(axis=0), points.max(axis=0)
    sides = np.maximum(high - low, _LEAST_SIDE_SHARE * (high - low).max())
    middle = (low + high) / 2
    (x0, y0, z0), (x1, y1, z1) = (middle - 0.52 * sides).tolist(), (middle + 0.52 * sides).tolist()
    axes.set(xlim=(x0, x1), ylim=(z0, z1), zlim=(y1, y0))
    axes.view_init(_ELEVATION_DEG, _AZIMUTH_DEG)
    _fit(axes, _plotted(sides))
    axes.set_facecolor("none")
    for axis, name in ((axes.xaxis, "x (m)"), (axes.yaxis, "z, distance (m)"), (axes.zaxis, "y, down (m)")):
        axis.set_label_text(name, color=style.ink)
        axis.set_major_locator(MaxNLocator(4))
        axis.set_pane_color((0, 0, 0, 0))
        axis.line.set_color(style.muted)
        axis._axinfo["grid"].update(color=style.grid, linewidth=0.6)
        axis.set_tick_params(colors=style.muted, labelcolor=style.muted, pad=1)
