"""The figures of a report, in the order of its page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from camcal.report.figures import (
    board_plane,
    coverage,
    distortion,
    histogram,
    quivers,
    radius,
    residuals,
    scene,
    stance,
    uncertainty,
    view_rms,
)
from camcal.report.figures.rendering import KINDS, render, render_svg
from camcal.report.figures.style import STYLES, Style
from camcal.report.figures.view import view_quiver
from camcal.report.record import Record

__all__ = ["FIGURES", "KINDS", "STYLES", "FigureKind", "Style", "render", "render_svg", "view_quiver"]


@dataclass(frozen=True, slots=True)
class FigureKind:
    """One figure that a report shows.

    Attributes
    ----------
    name : str
        For files and ids: lower case letters and underscores.
    title : str
        For the heading above it.
    draw : function of (Record, Style)
        Returns the figure; where there is nothing to show, the figure says why.
    caption : function of Record
        What good looks like and, where that is known, what there is, in one or two sentences.
    """

    name: str
    title: str
    draw: Callable[[Record, Style], Figure]
    caption: Callable[[Record], str]


FIGURES = (
    FigureKind("uncertainty", "Projection uncertainty", uncertainty.draw, uncertainty.caption),
    FigureKind("coverage", "Coverage of the image", coverage.draw, coverage.caption),
    FigureKind("stance", "Tilts and distances", stance.draw, stance.caption),
    FigureKind("residuals", "Residuals over the image", residuals.draw, residuals.caption),
    FigureKind("residual_radius", "Residuals against radius", radius.draw, radius.caption),
    FigureKind("residual_histogram", "Distribution of the residuals", histogram.draw, histogram.caption),
    FigureKind("quivers", "Residuals of each view", quivers.draw, quivers.caption),
    FigureKind("view_rms", "RMS of each view", view_rms.draw, view_rms.caption),
    FigureKind("scene", "Boards and camera in space", scene.draw, scene.caption),
    FigureKind("distortion", "Distortion and valid radius", distortion.draw, distortion.caption),
    FigureKind("board", "The board, feature by feature", board_plane.draw, board_plane.caption),
)
"""Every figure of a whole calibration; `view_quiver` draws that of a single view."""
