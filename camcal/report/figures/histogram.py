"""How the residuals are distributed, and the Gaussian that the uncertainties take them for."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from camcal.geometry.arrays import FloatArray
from camcal.observations import Calibration
from camcal.report.figures.canvas import blank, dress, legend, not_available
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record
from camcal.trust.wording import rounded

_REACH_SIGMAS = 5.0
_FEWEST_BINS, _MOST_BINS = 15, 81


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw the histograms of the two components, and the Gaussian of mean 0 and of the residuals' own spread.

    The outermost bins hold whatever lies beyond them.
    """
    calibration = record.calibration
    residuals, sigma = np.concatenate(calibration.residuals_px), sigma_px(calibration)
    figure = blank(3.2, style)
    axes = figure.subplots()
    dress(
        axes, style, f"{residuals.shape[0]:,} corners, σ = {rounded(sigma)} px per axis", "residual (px)", "corners", grid="y"
    )
    if not sigma > 0:
        not_available(axes, style, "every residual is zero")
        return figure
    edges, counts = histogram(residuals, sigma)
    for part, name, colour in zip(counts, ("x", "y"), (style.plain, style.notable), strict=True):
        axes.stairs(part, edges, color=colour, linewidth=1.6, label=f"along {name}")
    axes.stairs(counts[0], edges, color=style.plain, fill=True, alpha=0.22)
    x = np.linspace(edges[0], edges[-1], 301)
    axes.plot(x, gaussian(x, sigma, edges, len(residuals)), color=style.strong, linewidth=1.6, label="Gaussian of that σ")
    axes.set_xlim(edges[0], edges[-1])
    axes.set_ylim(0, 1.12 * axes.dataLim.ymax)
    legend(axes, style, loc="upper left")
    beyond = int((np.abs(residuals) > edges[-1]).any(axis=1).sum())
    if beyond:
        axes.plot([], [], " ", label=f"{beyond} beyond, in the outermost bins")
        legend(axes, style, loc="upper left")
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and what the pixels' noise alone would give."""
    good = (
        "Good: both histograms follow the curve. Tails above it are mistaken corners or views that do not fit; a shift is an "
        "error of the detector."
    )
    known = np.concatenate([seen.sigma_px for seen in record.calibration.detections])
    known = known[np.isfinite(known) & (known > 0)]
    if not known.size:
        return good
    return (
        f"{good} The noise of the pixels alone would give σ = {rounded(float(np.sqrt((known**2).mean())))} px; the rest is the "
        "board, the lens model, or motion."
    )


def sigma_px(calibration: Calibration) -> float:
    """Root mean square of the residuals' components, pixels."""
    return calibration.rms_px / float(np.sqrt(2))


def histogram(residuals_px: FloatArray, sigma: float) -> tuple[FloatArray, FloatArray]:
    """Count the components of residuals (M, 2), in bins up to five sigma.

    Returns
    -------
    edges : ndarray of shape (B + 1,)
        Pixels.
    counts : ndarray of shape (2, B)
        For x and y; each sums up to M.
    """
    bins = int(np.clip(2 * round(len(residuals_px) ** 0.5 / 2) + 1, _FEWEST_BINS, _MOST_BINS))
    edges = np.linspace(-1, 1, bins + 1) * min(_REACH_SIGMAS * sigma, 1.001 * float(np.abs(residuals_px).max()))
    inside = np.clip(residuals_px, edges[0], edges[-1])
    counts = np.array([np.histogram(part, edges)[0] for part in inside.T], dtype=np.float64)
    return edges, counts


def gaussian(x: FloatArray, sigma: float, edges: FloatArray, count: int) -> FloatArray:
    """Number of corners that a bin around each of x (N,) would hold, if `count` of them were normally distributed."""
    density: FloatArray = np.exp(-0.5 * (x / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
    expected: FloatArray = count * (edges[1] - edges[0]) * density
    return expected
