"""What a refinement returns: positions, standard deviations, and why a corner was refused."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.observations import Detection, Image
from camcal.refinement.corner_fit import LARGEST_RESPONSE
from camcal.refinement.corner_model import ANGLE_1, BEND_1, GAIN, LOG_BLUR, OFFSET, OVERSHOOT, RESPONSE
from camcal.refinement.corner_search import Found, Starts

ACCEPTED = ""
"""Reason of a corner that is good."""

# A pattern of two levels explains this share of what a patch shows, noise and uneven light left out.
_LEAST_EXPLAINED = 0.8
# Half the difference between ink and paper, in standard deviations of the residuals and in shares of full scale.
_LEAST_GAIN_OVER_NOISE = 3.0
_LEAST_GAIN = 0.008
_LARGEST_BLUR_OVER_RADIUS = 0.5
# Where much of a patch is saturated and the response is bent to the limit of the model, the model must still fit well.
_LARGEST_BRIGHTEST, _LEAST_EXPLAINED_CUT_OFF = 0.3, 0.95
LARGEST_MOVE_PX = 2.5
"""A start farther than this from what the fit finds was another corner's, or none."""

_LARGEST_TURN = np.radians(25.0)


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """Refined corners, in the order of those that were handed in.

    Attributes
    ----------
    corners_px : ndarray of shape (N, 2)
        NaN where a corner was refused.
    sigma_px : ndarray of shape (N, 2)
        Standard deviation along x and y from the scatter of the fit's residuals, px; NaN where a corner was refused.
    blur_px : ndarray of shape (N,)
        Standard deviation of the blur at the corner, the pixel's own area included; NaN where a corner was refused.
    overshoot : ndarray of shape (N,)
        Overshoot of its edges, negative where the camera sharpens (see `corner_model.Corners`); NaN where it was refused.
    noise_levels : ndarray of shape (N,)
        Standard deviation of what the fit leaves unexplained, grey levels of the image; NaN where a corner was refused.
    ink_levels, paper_levels : ndarray of shape (N,)
        Grey levels of ink and paper at the corner; NaN where it was refused.
    reasons : tuple of str
        Why each corner was refused; `ACCEPTED` for the good ones.
    """

    corners_px: FloatArray
    sigma_px: FloatArray
    blur_px: FloatArray
    overshoot: FloatArray
    noise_levels: FloatArray
    ink_levels: FloatArray
    paper_levels: FloatArray
    reasons: tuple[str, ...]

    @property
    def ok(self) -> BoolArray:
        """Which corners are good: shape (N,)."""
        return np.array([reason == ACCEPTED for reason in self.reasons], dtype=bool)

    def applied(self, detection: Detection) -> Detection:
        """Return a detection with the good corners only, refined, and their standard deviations per axis."""
        ok = self.ok
        sigma = np.sqrt((self.sigma_px[ok] ** 2).mean(axis=1))
        return replace(detection, ids=detection.ids[ok], corners_px=self.corners_px[ok], sigma_px=sigma)


class Verdicts:
    """The first reason found against each of N corners."""

    def __init__(self, count: int) -> None:
        self.reasons = [ACCEPTED] * count

    @property
    def ok(self) -> BoolArray:
        """Which corners nothing was found against so far: shape (N,)."""
        return np.array([reason == ACCEPTED for reason in self.reasons], dtype=bool)

    def refuse(self, bad: BoolArray, template: str, *values: FloatArray) -> None:
        """Refuse corners that are still good; the template is formatted with each corner's values."""
        for row in np.flatnonzero(bad & self.ok).tolist():
            self.reasons[row] = template.format(*(value[row] for value in values))


def finite_rows(values: FloatArray) -> BoolArray:
    """Which rows of (N, K) have no NaN and no infinity: shape (N,)."""
    finite: BoolArray = np.all(np.isfinite(values), axis=1)
    return finite


def full_scale(gray: Image) -> float:
    """Largest grey value an 8-bit image can hold; of any other the largest that it does hold (a 12-bit sensor in 16 bits)."""
    return 255.0 if gray.dtype == np.uint8 else float(np.nanmax(gray, initial=0.0))


def judged(gray: Image, starts: Starts, rows: IntArray, found: Found, verdicts: Verdicts) -> Refinement:
    """Turn what was found for some corners into a refinement of all, refusing what does not look like a corner.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
    starts : Starts
        Of all corners.
    rows : ndarray of shape (C,)
        Which of them were searched for.
    found : Found
        Of those.
    verdicts : Verdicts
        What was found against all corners so far; completed here.
    """
    total = len(verdicts.reasons)

    def spread(values: FloatArray) -> FloatArray:
        everywhere = np.full((total, *values.shape[1:]), np.nan)
        everywhere[rows] = values
        return everywhere

    corners, params = spread(found.corners_px), spread(found.params)
    blur, gain = np.exp(params[:, LOG_BLUR]), params[:, GAIN]
    noise, explained = spread(found.noise), spread(found.explained)
    sigma = np.sqrt(spread(np.diagonal(found.covariance, axis1=1, axis2=2)))
    moved = np.linalg.norm(corners - starts.corners_px, axis=1)
    turned = np.abs(np.angle(np.exp(1j * (params[:, ANGLE_1:BEND_1] - starts.angles)))).max(axis=1)
    scale = full_scale(gray)
    weak = ~(np.abs(gain) > np.maximum(_LEAST_GAIN * scale, _LEAST_GAIN_OVER_NOISE * noise))
    verdicts.refuse(weak, "no contrast (ink and paper {:.3g} levels apart, noise {:.2g})", 2 * np.abs(gain), noise)
    verdicts.refuse(gain < 0, "its colours are those of the corner next to it")
    verdicts.refuse(~(moved <= LARGEST_MOVE_PX), "the fit moved it too far ({:.1f} px)", moved)
    verdicts.refuse(
        ~(turned <= _LARGEST_TURN), "its edges do not point to the corners around it ({:.0f} deg off)", np.degrees(turned)
    )
    verdicts.refuse(~(explained >= _LEAST_EXPLAINED), "it does not look like a corner ({:.0%} explained)", explained)
    bent = np.abs(params[:, RESPONSE]) >= LARGEST_RESPONSE
    cut_off = bent & (spread(found.brightest) > _LARGEST_BRIGHTEST) & ~(explained >= _LEAST_EXPLAINED_CUT_OFF)
    verdicts.refuse(cut_off, "its grey values are cut off (saturated)")
    verdicts.refuse(~(blur <= _LARGEST_BLUR_OVER_RADIUS * starts.radius_px), "too blurred for its size (blur {:.1f} px)", blur)
    verdicts.refuse(~np.isin(np.arange(total), rows[found.converged]), "the fit did not converge")
    verdicts.refuse(~finite_rows(sigma), "the fit does not determine it")
    ink, paper = (params[:, OFFSET] + sign * gain for sign in (-1, 1))
    measured = (corners, sigma, blur, params[:, OVERSHOOT].copy(), noise, ink, paper)
    for values in measured:
        values[~verdicts.ok] = np.nan
    return Refinement(*measured, tuple(verdicts.reasons))
