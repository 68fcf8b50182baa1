"""What a photograph looks like around its corners: blur, sharpening, noise, and the grey levels of ink, paper and light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.observations import Image
from camcal.refinement.verdicts import Refinement

_PIXEL_VARIANCE = 1 / 12
_ROUNDING_VARIANCE = 1 / 12
# The light must stay positive to the image's corners, also where the boards let only a part of the slope be seen.
_LARGEST_GRADIENT = 0.8
_FEWEST_FOR_GRADIENT = 6
_REPEATS = 3
_OUTLIER_MADS = 4.0
_BACKGROUND_STEP = 4
# Noise is the scatter in windows so small that light and shades of the print are even in them.
_WINDOW_PX = 5
_FEWEST_IN_WINDOW = 9
_FEWEST_WINDOWS = 100


@dataclass(frozen=True, slots=True)
class Look:
    """Appearance of one view, in shares of the full scale of its pixels.

    Grey values are taken as they are stored: where a camera's gamma is not known, the image counts as linear.

    Attributes
    ----------
    blur_sigma_px : float
        Standard deviation of the blur of the continuous image, the pixel's own area taken out; px.
    overshoot : float
        Overshoot of the edges, negative where the camera sharpens (see `corner_model.Corners`).
    noise : float
        Standard deviation of a pixel's noise before it is rounded, as even ink and paper show it (see `flat_noise`): fine
        texture of the print and traces of compression count as noise. NaN where nothing is even.
    unexplained : float
        The same of what the fitted corners leave unexplained: where ink spreads, paper is lit unevenly or a sensor saturates,
        much more than noise.
    ink, paper : float
        At the image centre: the light falls on both alike.
    background : float
        Median of the image, but not darker than half-way between ink and paper: a board needs a bright surround.
    gradient, gradient_direction_deg : float
        Relative change of the light over half the image's diagonal, and where it grows to (0 is right, 90 is down).
    bits : int
        8, or 16 for anything deeper.
    """

    blur_sigma_px: float
    overshoot: float
    noise: float
    unexplained: float
    ink: float
    paper: float
    background: float
    gradient: float
    gradient_direction_deg: float
    bits: int


def measured_look(gray: Image, fit: Refinement) -> Look | None:
    """Measure a view's appearance, but for its noise, from its fitted corners: medians, so that bad corners do not count.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        The image that was fitted.
    fit : Refinement

    Returns
    -------
    Look or None
        None if no corner was accepted.
    """
    ok = fit.ok
    if not ok.any():
        return None
    scale = _full_scale(gray)
    offsets, paper_levels = _from_centre(fit.corners_px[ok], gray), fit.paper_levels[ok]
    slope = _relative_slope(offsets, paper_levels)
    light = scale * (1 + offsets @ slope)
    ink, paper = float(np.median(fit.ink_levels[ok] / light)), float(np.median(paper_levels / light))
    surround = float(np.median(gray[::_BACKGROUND_STEP, ::_BACKGROUND_STEP])) / scale
    return Look(
        blur_sigma_px=_root(float(np.median(fit.blur_px[ok])) ** 2 - _PIXEL_VARIANCE),
        overshoot=float(np.median(fit.overshoot[ok])),
        noise=float("nan"),
        unexplained=_unrounded(float(np.median(fit.noise_levels[ok])) ** 2, gray),
        ink=ink,
        paper=paper,
        background=float(np.clip(surround, 0.5 * (ink + paper), paper)),
        gradient=float(np.hypot(*slope)),
        gradient_direction_deg=float(np.degrees(np.arctan2(slope[1], slope[0]))),
        bits=8 if gray.dtype == np.uint8 else 16,
    )


def flat_noise(gray: Image, ink: BoolArray, paper: BoolArray) -> float:
    """Measure the noise of an image where it is even, as `Look.noise` has it; NaN where too little is.

    Of every small window of even ink, or of even paper, the variance is taken; of these the median, and of ink's and paper's
    the mean, since an edge has noise from both of its sides.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
    ink, paper : ndarray of shape (height, width)
        Which pixels show nothing but ink, and nothing but paper.
    """
    variances = [_window_variance(gray, flat) for flat in (ink, paper)]
    known = [variance for variance in variances if not np.isnan(variance)]
    return _unrounded(float(np.mean(known)), gray) if known else float("nan")


def completed_looks(looks: Sequence[Look | None]) -> tuple[Look, ...]:
    """Fill in what is not known of some views with what is typical of the others; empty if nothing is known of any.

    A view without a look gets the median of every figure, in even light. Where no view has even ink or paper, the noise is
    what the fits leave unexplained.
    """
    known = [look for look in looks if look is not None]
    if not known:
        return ()

    def median(name: str) -> float:
        values = np.array([getattr(look, name) for look in known])
        return float(np.median(values[~np.isnan(values)])) if not np.isnan(values).all() else float("nan")

    typical = Look(
        blur_sigma_px=median("blur_sigma_px"),
        overshoot=median("overshoot"),
        noise=median("noise"),
        unexplained=median("unexplained"),
        ink=median("ink"),
        paper=median("paper"),
        background=median("background"),
        gradient=0.0,
        gradient_direction_deg=0.0,
        bits=known[0].bits,
    )

    def completed(look: Look) -> Look:
        if not np.isnan(look.noise):
            return look
        return replace(look, noise=look.unexplained if np.isnan(typical.noise) else typical.noise)

    return tuple(completed(look or typical) for look in looks)


def _window_variance(gray: Image, flat: BoolArray) -> float:
    """Median of the variances of the flat pixels in small windows, levels²; NaN where there are too few."""
    inside = np.ix_(*(np.flatnonzero(flat.any(axis=axis)) for axis in (1, 0)))
    mask = flat[inside]
    if not mask.any():
        return float("nan")
    values = np.where(mask, gray[inside] - np.median(gray[flat]), 0.0)
    count, total, squares = (
        cv2.boxFilter(each, -1, (_WINDOW_PX, _WINDOW_PX), normalize=False, borderType=cv2.BORDER_CONSTANT)
        for each in (mask.astype(np.float64), values, values**2)
    )
    at = mask & (count >= _FEWEST_IN_WINDOW - 0.5)
    if at.sum() < _FEWEST_WINDOWS:
        return float("nan")
    count, total, squares = count[at], total[at], squares[at]
    # The median of a chi² distribution lies below its mean (Wilson and Hilferty 1931).
    variance = (squares - total**2 / count) / (count - 1) / (1 - 2 / (9 * (count - 1))) ** 3
    return float(np.median(variance))


def _full_scale(gray: Image) -> float:
    """Largest grey value that an image can hold: of its integers, or the largest that it does hold if its pixels are floats."""
    if np.issubdtype(gray.dtype, np.integer):
        return float(np.iinfo(gray.dtype).max)
    return float(np.nanmax(gray, initial=np.finfo(np.float32).tiny))


def _from_centre(corners_px: FloatArray, gray: Image) -> FloatArray:
    """Offsets (N, 2) of corners from the image centre in units of half its diagonal."""
    size = np.array(gray.shape[::-1])
    offsets: FloatArray = (corners_px - (size - 1) / 2) / (np.hypot(*size) / 2)
    return offsets


def _relative_slope(offsets: FloatArray, levels: FloatArray) -> FloatArray:
    """Slope (2,) of the plane through levels (N,) over its value at the centre, without outliers; 0 where it is unknown."""
    design = np.column_stack([np.ones(len(levels)), offsets])
    kept = np.ones(len(levels), dtype=bool)
    slope = np.zeros(2)
    for _ in range(_REPEATS):
        plane, _, rank, _ = np.linalg.lstsq(design[kept], levels[kept], rcond=None)
        if kept.sum() < _FEWEST_FOR_GRADIENT or rank < design.shape[1] or not plane[0] > 0:
            break
        slope = plane[1:] / plane[0]
        off = np.abs(levels - design @ plane)
        kept = off <= _OUTLIER_MADS * np.median(off)
    limited: FloatArray = slope * (_LARGEST_GRADIENT / max(float(np.hypot(*slope)), _LARGEST_GRADIENT))
    return limited


def _unrounded(variance: float, gray: Image) -> float:
    """Standard deviation, in shares of full scale, of noise whose variance (levels²) was measured after rounding."""
    rounding = 0.0 if np.issubdtype(gray.dtype, np.floating) else _ROUNDING_VARIANCE
    return _root(variance - rounding) / _full_scale(gray)


def _root(variance: float) -> float:
    """Standard deviation of a variance; 0 for one that its correction took below 0."""
    return float(np.sqrt(max(variance, 0.0)))
