"""Corners and residuals drawn over a photograph: a few SVG paths in the photograph's own pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.geometry.arrays import FloatArray
from camcal.observations import Calibration, Outlier
from camcal.report.figures import canvas as figures

_LONG_SHARE = 0.06
"""Share of the image's width that long residuals are drawn with."""


@dataclass(frozen=True, slots=True)
class Overlay:
    """What is drawn over one photograph.

    Attributes
    ----------
    view_box : str
        The image in its own pixels, whose centres are whole numbers.
    corners : str
        Path data: a dot for every corner that was used.
    residuals : str
        Path data: a line from each, in the direction in which the corner is off, magnified.
    left_out : str
        Path data: a dot for every corner that was left out.
    count : int
        How many corners there are.
    """

    view_box: str
    corners: str
    residuals: str
    left_out: str
    count: int


def magnification(calibration: Calibration) -> float:
    """By how much residuals are magnified so that long ones can be seen; the same for all photographs."""
    return figures.magnification(np.concatenate(calibration.residuals_px), _LONG_SHARE * calibration.camera.size[0])


def overlay(calibration: Calibration, index: int, outliers: tuple[Outlier, ...], magnified: float) -> Overlay:
    """Draw a view that was used.

    Parameters
    ----------
    calibration : Calibration
    index : int
        Of the view among the detections.
    outliers : tuple of Outlier
        The corners of that view that were left out.
    magnified : float
        Factor on the residuals.
    """
    corners, residual = calibration.detections[index].corners_px, calibration.residuals_px[index]
    return Overlay(
        view_box=_view_box(calibration.camera.size),
        corners=_dots(corners),
        residuals=_lines(corners, magnified * residual),
        left_out=_dots(_places(outliers)),
        count=len(corners),
    )


def overlay_of_outliers(size: tuple[int, int], outliers: tuple[Outlier, ...]) -> Overlay:
    """Draw a view (width, height) all of whose corners were left out."""
    return Overlay(_view_box(size), "", "", _dots(_places(outliers)), 0)


def _places(outliers: tuple[Outlier, ...]) -> FloatArray:
    return np.array([outlier.corner_px for outlier in outliers]).reshape(-1, 2)


def _view_box(size: tuple[int, int]) -> str:
    return f"-0.5 -0.5 {size[0]} {size[1]}"


def _dots(places: FloatArray) -> str:
    """A line without length at each place (N, 2), which round ends make a dot."""
    return "".join(f"M{x:.1f} {y:.1f}h0" for x, y in places.tolist())


def _lines(places: FloatArray, vectors: FloatArray) -> str:
    """A line from each place (N, 2) along its vector (N, 2)."""
    rows = np.concatenate([places, vectors], axis=1).tolist()
    return "".join(f"M{x:.1f} {y:.1f}l{dx:.1f} {dy:.1f}" for x, y, dx, dy in rows)
