"""Cross-validation: whether halves of the views agree with each other as well as their uncertainty says they should.

Two halves solved apart give two cameras; their difference is compared with what the covariances of both predict, each
independent way in which their projections can differ counting alike: r² = dᵀ (S₁⁻¹ + S₂⁻¹)⁻¹ d / F, with the difference d
of the F shared parameters and the information S of each half. That is Chow's test (1960, "Tests of equality between sets of
coefficients in two linear regressions"): the fall of the sum of squares if the halves need not share a camera, over what
noise alone makes of it. The rotation between the two cameras, which no calibration can tell from a shift of the principal
point, drops out of it, and so does every pixel past the fold of a lens: only what the corners determine is compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.compare.projection import predicted_length_px
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.trust.linearised import Linearised, inverse
from camcal.trust.uncertainty import image_grid
from camcal.trust.wording import rounded
from camcal.verdict import Finding

FEWEST_IN_A_HALF = 3
"""Two views leave the camera undetermined."""

# More splits say little more about so few parameters.
_MOST_SPLITS = 63
# Clean views stay between 0.7 and 1.4, photographs that calibrate well reach 3.
_HONEST = 2.0
_POOR = 4.0
_POOR_PX = 1.0


@dataclass(frozen=True, slots=True)
class CrossValidation:
    """How well halves of the views agree.

    Attributes
    ----------
    ratio : float
        Difference of the halves over its prediction, root mean square over the splits: about 1 if the standard deviations
        are honest, the factor by which they are too small if not. NaN for fewer than six views or perfect corners.
    splits : int
        Number of ways in which the views were split.
    predicted_px : float
        Median over the image of how far the projection of far points should be off by the covariance, pixels.
    is_bow_free : bool
        Whether the board's bow is solved for, so that it cannot be what the halves differ by.
    """

    ratio: float
    splits: int
    predicted_px: float
    is_bow_free: bool = False

    @property
    def error_px(self) -> float:
        """Median over the image of how far the projection is really off, pixels."""
        return self.ratio * self.predicted_px

    @property
    def findings(self) -> tuple[Finding, ...]:
        """`inconsistent` if the halves differ by more than twice what they should."""
        if not self.ratio > _HONEST:
            return ()
        level = "poor" if self.ratio > _POOR and self.error_px > _POOR_PX else "usable"
        text = (
            f"halves of the views, solved apart, differ {self.ratio:.1f} times as much as their uncertainty allows (expected "
            f"about 1, at most {_HONEST:g}): far points are seen within {rounded(self.error_px)} px rather than "
            f"{rounded(self.predicted_px)} px in the median"
        )
        bent = (
            "a board that was moved by its edges"
            if self.is_bow_free
            else "a board that is bent (try --warp) or was moved by its edges"
        )
        advice = (
            f"Take every standard deviation {self.ratio:.1f} times as large, and look for what all views have wrong: {bent}, "
            "focus or zoom that changed, corners of another detector."
        )
        return (Finding("inconsistent", level, self.ratio, text, advice),)


def cross_validate(linearised: Linearised, *, is_bow_free: bool = False) -> CrossValidation:
    """Compare halves of the views with each other.

    Parameters
    ----------
    linearised : Linearised
        The calibration's minimum. Each half is solved by one Newton step from it, which is as good as solving it anew.
    is_bow_free : bool
        Whether the board's bow is solved for.
    """
    splits = balanced_splits(len(linearised.costs))
    ratio = np.sqrt(dispersion(linearised)) if linearised.telling else float("nan")
    camera = linearised.camera
    predicted = predicted_length_px(camera, linearised.names, linearised.covariance, image_grid(camera.size))
    return CrossValidation(float(ratio), len(splits), float(np.nanmedian(predicted)), is_bow_free)


def dispersion(linearised: Linearised) -> float:
    """Square of the cross-validation's ratio; NaN where there are too few views."""
    splits = balanced_splits(len(linearised.costs)).astype(np.float64)
    if not len(splits):
        return float("nan")
    S, g = linearised.information, linearised.gradient
    halves = [_gains(np.tensordot(side, S, axes=1), side @ g) for side in (splits, 1 - splits)]
    fall = halves[0] + halves[1] - _gains(S.sum(axis=0), g.sum(axis=0))
    return float(fall.mean() / g.shape[1])


def balanced_splits(views: int) -> BoolArray:
    """Ways to split views into two halves, any two of them as different as can be.

    The rows of a Hadamard matrix (Sylvester's) but the first: to first order the differences of the halves are independent.

    Parameters
    ----------
    views : int

    Returns
    -------
    ndarray of shape (K, views)
        True for the views of the first half. At least three views are on either side; K is 0 for fewer than six.

    Examples
    --------
    >>> balanced_splits(6).astype(int).tolist()[0]
    [1, 0, 1, 0, 1, 0]
    """
    rows = np.arange(1, 1 + _MOST_SPLITS)[:, None]
    first: BoolArray = np.bitwise_count(rows & np.arange(views)) % 2 == 0
    counts = first.sum(axis=1)
    first = first[(counts >= FEWEST_IN_A_HALF) & (views - counts >= FEWEST_IN_A_HALF)]
    # Fewer views than splits make some of them equal.
    _, index = np.unique(first, axis=0, return_index=True)
    return first[np.sort(index)]


def _gains(information: FloatArray, gradient: FloatArray) -> FloatArray:
    """By how much sums of squares (...,) fall if the parameters follow gradients (..., F)."""
    gains: FloatArray = (gradient * (inverse(information) @ gradient[..., None])[..., 0]).sum(axis=-1)
    return gains
