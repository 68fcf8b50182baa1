"""One view: where its corners were seen, and the residual of each as an arrow."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from camcal.report.figures.canvas import (
    arrows,
    dots,
    dress_image,
    image_figure,
    legend,
    length_key,
    magnification,
    magnified,
    round_below,
)
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record
from camcal.trust.wording import rounded

_LEAST_ROOM_SHARE, _MOST_ROOM_SHARE = 0.015, 0.06


@with_plain_settings
def view_quiver(record: Record, index: int, style: Style) -> Figure:
    """Draw the residuals of view `index` of `calibration.detections`, magnified, and the corners that were left out.

    Raises
    ------
    IndexError
        If there is no such view.
    """
    calibration = record.calibration
    seen, residuals = calibration.detections[index], calibration.residuals_px[index]
    width, height = calibration.camera.size
    spacing = float(np.sqrt(np.ptp(seen.corners_px, axis=0).prod() / len(seen)))
    factor = magnification(residuals, float(np.clip(1.2 * spacing, _LEAST_ROOM_SHARE * width, _MOST_ROOM_SHARE * width)))
    figure = image_figure((width, height), 1, style, extra_in=0.1)
    axes = figure.subplots()
    title = f"{seen.source}: RMS {rounded(calibration.view_rms_px[index])} px, residuals {magnified(factor)}"
    dress_image(axes, (width, height), style, title)
    dots(axes, seen.corners_px, style.muted, area=5)
    arrows(axes, seen.corners_px, factor * residuals, style.plain)
    left_out = [outlier for outlier in calibration.outliers if outlier.source == seen.source]
    if left_out:
        places = np.array([outlier.corner_px for outlier in left_out])
        axes.plot(*places.T, "x", color=style.bad, markersize=7, markeredgewidth=1.6, label=f"{len(left_out)} left out")
        legend(axes, style, loc="lower left")
    length = round_below(0.15 * width / factor)
    length_key(axes, style, length * factor, f"{length:g} px")
    return figure
