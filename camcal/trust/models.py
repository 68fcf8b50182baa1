"""Which distortion coefficients the images support: one too many blows up where no board ever was, one too few bends it all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.boards.base import Board
from camcal.calibration.views import FEWEST_VIEWS
from camcal.compare.projection import predicted_length_px, projection_difference
from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.observations import Calibration
from camcal.threads import single_threaded
from camcal.trust.held_out import (
    POLYNOMIALS,
    Candidate,
    Judge,
    distortion_of,
    far_better,
    is_rational,
    remodelled,
)
from camcal.trust.linearised import Linearised
from camcal.trust.minimum import Minimum
from camcal.trust.uncertainty import image_grid
from camcal.trust.wording import rounded
from camcal.verdict import Finding

# The simpler model must know the image's corners so many times as well to be worth a word, and to be worth a warning.
_NOTABLE_BLOW_UP, _USABLE_BLOW_UP = 1.1, 1.5
_MOST_NAMED_BLOW_UP = 100.0
_USABLE_CORNER_PX = 1.0
# Gains as shares of the residual, and pixels of the median difference, from which a model that is too simple does harm.
_NOTABLE_GAIN, _USABLE_GAIN, _POOR_GAIN, _POOR_PX = 0.01, 0.1, 0.5, 1.0


@dataclass(frozen=True, slots=True)
class ModelCheck:
    """Lens models compared.

    Attributes
    ----------
    current : Candidate
        The model of the calibration.
    best : Candidate
        The simplest model that predicts as well as any.
    simpler : Candidate or None
        The best model with only some of the current coefficients that predicts as well as all of them.
    corner_sigma_px, simpler_corner_sigma_px : float
        How far far points may be seen off at the worst corner of the image, with the current model and with the simpler one;
        NaN where the lens has no answer there.
    difference_px : float
        Median over the image of how far the projections of the current and of the best model are apart; NaN where the best
        model is a part of the current one.
    """

    current: Candidate
    best: Candidate
    simpler: Candidate | None
    corner_sigma_px: float
    simpler_corner_sigma_px: float
    difference_px: float

    @property
    def findings(self) -> tuple[Finding, ...]:
        """`unsupported_coefficient` and `lens_too_simple`."""
        return tuple(finding for finding in (self._unsupported(), self._too_simple()) if finding)

    def _unsupported(self) -> Finding | None:
        # NaN where either lens has turned back before the image's corners: then there is nothing to compare there.
        blow_up = self.corner_sigma_px / self.simpler_corner_sigma_px
        if self.simpler is None or blow_up < _NOTABLE_BLOW_UP:
            return None
        dropped = ",".join(name for name in self.current.distortion if name not in self.simpler.distortion)
        text = (
            f"{dropped} {'are' if ',' in dropped else 'is'} not supported by these images: {self.simpler.option} predicts "
            f"held-out views as well as they can tell ({self.simpler.held_out_px:.3g} px, {self.current.held_out_px:.3g} px "
            f"with {self.current.option}){self._known_corners(blow_up)}"
        )
        added = f" (the lens needs {self._missing} as well)" if self._missing else ""
        advised = self.best if self._missing or set(self.best.distortion) <= set(self.current.distortion) else self.simpler
        advice = f"Pass --distortion {advised.option}{added}, or add views whose boards reach the image's corners."
        harmless = self.corner_sigma_px <= _USABLE_CORNER_PX or blow_up < _USABLE_BLOW_UP
        weight = float(np.nan_to_num(blow_up, nan=_MOST_NAMED_BLOW_UP))
        return Finding("unsupported_coefficient", "note" if harmless else "usable", weight, text, advice)

    def _known_corners(self, blow_up: float) -> str:
        """Say how much better the simpler model knows the image's corners."""
        if np.isnan(self.simpler_corner_sigma_px):
            return ""
        if np.isnan(self.corner_sigma_px):
            return " and has an answer at the image's corners, where the lens has turned back with them"
        times = rounded(blow_up) if blow_up <= _MOST_NAMED_BLOW_UP else f"over {_MOST_NAMED_BLOW_UP:g}"
        return f" and knows the image's corners {times} times as well"

    @property
    def _gain(self) -> float:
        """Share by which held-out views are predicted worse than by the best model."""
        return self.current.held_out_px / self.best.held_out_px - 1

    @property
    def _missing(self) -> str:
        """Coefficients of the best model that the current one lacks, if that is worth telling."""
        if self._gain < _NOTABLE_GAIN:
            return ""
        return ",".join(name for name in self.best.distortion if name not in self.current.distortion)

    def _too_simple(self) -> Finding | None:
        if not self._missing:
            return None
        gain = self._gain
        level = "usable" if gain > _USABLE_GAIN else "note"
        if gain > _POOR_GAIN and self.difference_px > _POOR_PX:
            level = "poor"
        apart = "" if np.isnan(self.difference_px) else f", {rounded(self.difference_px)} px away from it in the median"
        text = (
            f"the lens needs {self._missing}: {self.best.option} predicts held-out views to {self.best.held_out_px:.3g} px, "
            f"{self.current.option} to {self.current.held_out_px:.3g} px only{apart}"
        )
        return Finding("lens_too_simple", level, gain, text, f"Pass --distortion {self.best.option}.")


def compare_models(minimum: Minimum, linearised: Linearised) -> ModelCheck | None:
    """Compare lens models on held-out views.

    Parameters
    ----------
    minimum : Minimum
        Where the calibration ended.
    linearised : Linearised
        The same, linearised.

    Returns
    -------
    ModelCheck or None
        None for fewer than four views.
    """
    if len(linearised.costs) < FEWEST_VIEWS + 1:
        return None
    judge = Judge.of(minimum)
    current = judge.solved(distortion_of(minimum), linearised)
    camera = minimum.state.camera
    best, best_camera = _best(judge, current, camera)
    simpler = _simpler(judge, current)
    return ModelCheck(
        current=current,
        best=best,
        simpler=simpler[0] if simpler else None,
        corner_sigma_px=_corner_sigma_px(linearised),
        simpler_corner_sigma_px=_corner_sigma_px(simpler[1]) if simpler else float("nan"),
        difference_px=_difference_px(camera, best_camera),
    )


def choose_distortion(calibration: Calibration, board: Board) -> tuple[str, ...]:
    """Choose the distortion coefficients that the images support.

    Parameters
    ----------
    calibration : Calibration
        Solved with any coefficients, best with the usual ones.
    board : Board
        The board it was solved with.

    Returns
    -------
    tuple of str
        The simplest model that predicts held-out views as well as any; k1 alone for fewer than four views.
    """
    with single_threaded():
        minimum = Minimum.of(calibration, board)
        check = compare_models(minimum, Linearised.of(minimum))
    return check.best.distortion if check else POLYNOMIALS[1]


def _best(judge: Judge, current: Candidate, camera: Camera) -> tuple[Candidate, Camera | None]:
    """Find the best model, and its camera if it is no part of the current one, which is known better than foreseen."""
    polynomial = judge.best()
    if is_rational(current.distortion):
        rational = (current, camera) if far_better(current, polynomial) else None
    else:
        rational = judge.rational(polynomial)
    if rational:
        return rational
    if current.distortion == polynomial.distortion:
        return current, camera
    if set(polynomial.distortion) < set(current.distortion):
        return polynomial, None
    solved = judge.approached(polynomial.distortion)
    return polynomial, solved.state.camera if solved else None


def _simpler(judge: Judge, current: Candidate) -> tuple[Candidate, Linearised] | None:
    """Find the model with only some of the current coefficients that predicts as well, and solve it; None if there is none."""
    fewer = [judge.foreseen(model) for model in POLYNOMIALS if set(model) < set(current.distortion)]
    least = min(fewer, key=lambda each: each.score, default=None)
    if least is None or least.score > current.score:
        return None
    minimum = remodelled(judge.base, least.distortion)
    if minimum is None:
        return None
    linearised = Linearised.of(minimum)
    solved = judge.solved(least.distortion, linearised)
    return (solved, linearised) if solved.score <= current.score else None


def _corner_sigma_px(linearised: Linearised) -> float:
    """How far far points may be seen off at the worst corner of the image; NaN if the lens has no answer at one of them."""
    camera = linearised.camera
    width, height = camera.size
    corners = np.array([(0.0, 0.0), (width - 1, 0), (width - 1, height - 1), (0, height - 1)])
    # The rotation is fitted over the whole image.
    pixels = np.concatenate([corners, image_grid(camera.size)])
    return float(predicted_length_px(camera, linearised.names, linearised.covariance, pixels)[: len(corners)].max())


def _difference_px(camera: Camera, best: Camera | None) -> float:
    """Median over the image of how far the projections of two cameras are apart; NaN if they have nothing in common."""
    if best is None:
        return float("nan")
    try:
        return float(np.median(projection_difference(best, camera).length_px))
    except InputError:
        return float("nan")
