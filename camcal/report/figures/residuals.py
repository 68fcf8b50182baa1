"""Residuals over the image: each as an arrow, and their mean in each region, where noise averages out and errors do not."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from camcal.geometry.arrays import FloatArray
from camcal.observations import Calibration
from camcal.report.figures.canvas import (
    arrows,
    dress_image,
    image_figure,
    length_key,
    magnification,
    magnified,
    round_below,
)
from camcal.report.figures.coverage import regions
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record
from camcal.trust.wording import rounded

MOST_SHOWN = 2500
"""Of more residuals a sample that is spread evenly over all views is shown."""

SIGNIFICANT_SIGMAS = 3.5
"""A region's mean beyond so many standard deviations is more than noise."""

_FEWEST_IN_A_REGION = 5
_ROOM_SHARE, _REGION_ROOM_SHARE = 0.055, 0.075
_KEY_SHARE = 0.2


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw the residuals, and the mean of each region with the circle that noise keeps within."""
    calibration = record.calibration
    size = calibration.camera.size
    figure = image_figure(size, 2, style, extra_in=0.1)
    left, right = figure.subplots(1, 2)
    _draw_each(left, calibration, style)
    _draw_means(right, calibration, style)
    right.set_ylabel("")
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and how many regions are off."""
    places, means, sigmas = region_means(record.calibration)
    good = (
        "Good: arrows in every direction, and no pattern; on the right, arrows that stay within their circles. An arrow points "
        "the way in which a corner was seen beside where the camera model expects it."
    )
    if not len(places):
        return good
    off = int((np.linalg.norm(means, axis=1) > SIGNIFICANT_SIGMAS * sigmas).sum())
    largest = rounded(float(np.linalg.norm(means, axis=1).max()))
    if not off:
        return f"{good} Here the means are noise, none over {largest} px."
    return (
        f"{good} Here the mean of {off} of {len(places)} regions is more than noise (in red, up to {largest} px): the lens "
        "model does not follow the lens there, or the board is not as it should be."
    )


def shown_rows(count: int, most: int = MOST_SHOWN) -> slice:
    """Return which of so many residuals are shown: every n-th."""
    return slice(None, None, -(-count // most))


def region_means(calibration: Calibration) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Average the residuals over regions of the image in which there are enough of them.

    Returns
    -------
    places : ndarray of shape (M, 2)
        Mean position of the corners, pixels.
    means : ndarray of shape (M, 2)
        Pixels.
    sigmas : ndarray of shape (M,)
        Standard deviation per axis that noise leaves of a mean, pixels.
    """
    corners = np.concatenate([seen.corners_px for seen in calibration.detections])
    residuals = np.concatenate(calibration.residuals_px)
    region, _ = regions(corners, calibration.camera.size)
    counts = np.bincount(region)
    enough = counts >= _FEWEST_IN_A_REGION
    sums = [np.bincount(region, values)[enough] for values in (*corners.T, *residuals.T)]
    x, y, mean_x, mean_y = np.array(sums) / counts[enough]
    sigma = calibration.rms_px / np.sqrt(2)
    return np.stack([x, y], axis=1), np.stack([mean_x, mean_y], axis=1), sigma / np.sqrt(counts[enough])


def _draw_each(axes: Axes, calibration: Calibration, style: Style) -> None:
    corners = np.concatenate([seen.corners_px for seen in calibration.detections])
    residuals = np.concatenate(calibration.residuals_px)
    width, _ = calibration.camera.size
    shown = shown_rows(len(corners))
    factor = magnification(residuals, _ROOM_SHARE * width)
    dress_image(axes, calibration.camera.size, style, f"Residuals, {magnified(factor)}")
    arrows(axes, corners[shown], factor * residuals[shown], style.plain, width=0.8)
    _draw_key(axes, factor, width, style)


def _draw_means(axes: Axes, calibration: Calibration, style: Style) -> None:
    places, means, sigmas = region_means(calibration)
    width, _ = calibration.camera.size
    factor = magnification(
        np.concatenate([means, np.stack([SIGNIFICANT_SIGMAS * sigmas] * 2, axis=1)]), _REGION_ROOM_SHARE * width
    )
    dress_image(axes, calibration.camera.size, style, f"Mean of each region, {magnified(factor)}")
    circles = [Circle(tuple(place), SIGNIFICANT_SIGMAS * sigma * factor) for place, sigma in zip(places, sigmas, strict=True)]
    axes.add_collection(PatchCollection(circles, facecolor=style.shade, edgecolor=style.muted, linewidths=0.6))
    beyond = np.linalg.norm(means, axis=1) > SIGNIFICANT_SIGMAS * sigmas
    arrows(axes, places[~beyond], factor * means[~beyond], style.plain, width=1.4)
    arrows(axes, places[beyond], factor * means[beyond], style.bad, width=1.6)
    _draw_key(axes, factor, width, style)


def _draw_key(axes: Axes, factor: float, width: int, style: Style) -> None:
    length = round_below(_KEY_SHARE * width / factor)
    length_key(axes, style, length * factor, f"{length:g} px")
