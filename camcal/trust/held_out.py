"""Lens models judged by how well they predict views held out: each view with the camera that the other views give.

All polynomial models are linearised at the minimum of the largest of them, of which they are special cases. Gains are
measured in units of what the views themselves disagree by (quasi-likelihood; Burnham and Anderson 2002, "Model selection
and multimodel inference", section 2.5): where the board or the corners are not perfect the residuals hold far more than
noise, and a coefficient gains from that by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from camcal.calibration.finish import descend
from camcal.calibration.parameters import COEFFICIENTS, PINHOLE, distortion_names, free_names, places
from camcal.geometry.arrays import BoolArray
from camcal.geometry.camera import Camera
from camcal.trust.cross_validation import dispersion
from camcal.trust.linearised import Linearised
from camcal.trust.minimum import Minimum

POLYNOMIALS: tuple[tuple[str, ...], ...] = (
    (),
    ("k1",),
    ("k1", "k2"),
    ("k1", "k2", "k3"),
    ("k1", "k2", "p1", "p2"),
    ("k1", "k2", "p1", "p2", "k3"),
)
"""Models that are compared, the simplest first."""

RATIONALS: tuple[tuple[str, ...], ...] = (
    ("k1", "k2", "k3", "k4", "k5", "k6"),
    ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
)
"""Models that fit nearly anything where there are corners, and nothing beyond: taken where every polynomial fails."""

# A coefficient has to earn this much beyond what it gains by chance, in units of the variance; with what it gains by chance
# that asks for 2.4 standard deviations.
_PRICE = 4.0
# Variance of the views over that of their corners, where they are too few to tell: what photographs show.
_USUAL_SPREAD = 9.0
# Shares of the residual: smaller gains do not matter, however certain they are.
_RELEVANT = 0.01
_RELEVANT_RATIONAL = 0.1
_MOST_SAMPLE_VIEWS = 40
_MOST_SAMPLE_CORNERS = 4000


@dataclass(frozen=True, slots=True)
class Candidate:
    """A lens model and how well it predicts.

    Attributes
    ----------
    distortion : tuple of str
        Names of its coefficients, in stored order.
    held_out_px : float
        Root mean square residual length of held-out corners; pixels of a corner of weight 1.
    score : float
        Sum of squares of the held-out views in units of their dispersion, plus the price of the coefficients: the lower, the
        better.
    """

    distortion: tuple[str, ...]
    held_out_px: float
    score: float

    @property
    def option(self) -> str:
        """What to pass to `--distortion`."""
        return ",".join(self.distortion) or "none"


@dataclass(frozen=True, slots=True, eq=False)
class Judge:
    """What all models of one set of corners are judged by.

    Attributes
    ----------
    base : Minimum
        The minimum of the largest polynomial model.
    there : Linearised
        The same with all coefficients freed.
    spread : float
        Variance of what the views say over that of their corners; at least 1.
    """

    base: Minimum
    there: Linearised
    spread: float

    @classmethod
    def of(cls, minimum: Minimum) -> Judge:
        """Descend from the minimum of any model to that of the largest polynomial one."""
        base = remodelled(minimum, POLYNOMIALS[-1]) or minimum
        there = Linearised.of(base.freed(free_names(RATIONALS[-1])))
        spread = dispersion(there.only(_chosen(there, POLYNOMIALS[-1])))
        return cls(base, there, _USUAL_SPREAD if np.isnan(spread) else max(1.0, spread))

    def foreseen(self, distortion: tuple[str, ...]) -> Candidate:
        """Judge a model to first order, without solving it."""
        return self._candidate(distortion, self.there.held_out(_chosen(self.there, distortion)).sum())

    def solved(self, distortion: tuple[str, ...], linearised: Linearised) -> Candidate:
        """Judge a model at its own minimum."""
        return self._candidate(distortion, linearised.held_out().sum() * linearised.variance_px2 / self.there.variance_px2)

    def best(self) -> Candidate:
        """Find the simplest polynomial model that predicts as well as any, as far as that matters."""
        tried = [self.foreseen(model) for model in POLYNOMIALS]
        least = min(tried, key=lambda each: each.score)
        return next(each for each in tried if each is least or each.held_out_px <= (1 + _RELEVANT) * least.held_out_px)

    def rational(self, polynomial: Candidate) -> tuple[Candidate, Camera] | None:
        """Find the rational model that predicts far better than a polynomial, and its camera; None if there is none."""
        foreseen = min((self.foreseen(model) for model in RATIONALS), key=lambda each: each.score)
        if not far_better(foreseen, polynomial):
            return None
        # Far from where it is linearised nothing is certain before it is solved; some of the corners are enough for that.
        few = replace(self, base=self._sample())
        one, other = (few.approached(model) for model in (foreseen.distortion, polynomial.distortion))
        if one is None or other is None:
            return None
        solved = few.solved(foreseen.distortion, Linearised.of(one))
        confirmed = far_better(solved, few.solved(polynomial.distortion, Linearised.of(other)))
        return (foreseen, one.state.camera) if confirmed else None

    def approached(self, distortion: tuple[str, ...]) -> Minimum | None:
        """Descend from the base with another lens model; None if that leads nowhere.

        The coefficients of a rational model make up for each other, so that the descent may creep along a valley: where it
        is left the model fits as well as it can, though its coefficients are not the last ones.
        """
        return _descended(_prepared(self.base, distortion), creeping=is_rational(distortion))

    def _sample(self) -> Minimum:
        """Take evenly spaced views and corners of the base, few enough for a model that converges slowly."""
        count = self.base.seen.starts.size
        views = np.zeros(count, dtype=bool)
        views[np.unique(np.linspace(0, count - 1, min(count, _MOST_SAMPLE_VIEWS)).astype(int))] = True
        some = self.base.only(views)
        every = -(-some.seen.view.size // _MOST_SAMPLE_CORNERS)
        return replace(some, seen=some.seen.only(np.arange(some.seen.view.size) % every == 0))

    def _candidate(self, distortion: tuple[str, ...], squares: float) -> Candidate:
        squares = max(float(squares), 0.0)
        held_out_px = np.sqrt(squares * self.there.variance_px2 / self.base.seen.view.size)
        return Candidate(distortion, float(held_out_px), squares / self.spread + _PRICE * len(distortion))


def far_better(rational: Candidate, polynomial: Candidate) -> bool:
    """Tell whether a rational model gains enough to be worth what it may do where there are no corners."""
    gain = polynomial.held_out_px / rational.held_out_px - 1 if rational.held_out_px > 0 else 0.0
    return rational.score < polynomial.score and gain > _RELEVANT_RATIONAL


def is_rational(distortion: Sequence[str]) -> bool:
    """Tell whether a model has a denominator."""
    return not {"k4", "k5", "k6"}.isdisjoint(distortion)


def distortion_of(minimum: Minimum) -> tuple[str, ...]:
    """Names of the free distortion coefficients of a minimum."""
    names = minimum.state.camera.intrinsic_names
    return distortion_names(tuple(names[column] for column in minimum.columns if column < len(names)))


def remodelled(minimum: Minimum, distortion: tuple[str, ...]) -> Minimum | None:
    """Solve the corners of a minimum with another lens model, from where it stands; None if that leads nowhere."""
    return _descended(_prepared(minimum, distortion), creeping=False)


def _prepared(minimum: Minimum, distortion: tuple[str, ...]) -> Minimum:
    """Free the coefficients of another lens model and put all others to 0."""
    camera, columns = minimum.state.camera, minimum.columns
    dropped = [name in COEFFICIENTS and name not in distortion for name in camera.intrinsic_names]
    state = replace(minimum.state, camera=camera.with_intrinsics(np.where(dropped, 0.0, camera.intrinsics)))
    shape = columns[columns >= camera.intrinsics.size]
    return Minimum(state, minimum.seen, np.append(places(camera, free_names(distortion)), shape))


def _descended(start: Minimum, *, creeping: bool) -> Minimum | None:
    """Descend; also as far as it goes where it only creeps."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        found = descend(start.state, start.seen, start.columns)
    return replace(start, state=found.state) if not found.failure or (creeping and np.isfinite(found.cost)) else None


def _chosen(linearised: Linearised, distortion: tuple[str, ...]) -> BoolArray:
    """Which free parameters a model has, shape (F,): its own, and the board's shape."""
    chosen = np.ones(len(linearised.values), dtype=bool)
    chosen[: len(linearised.names)] = [name in PINHOLE or name in distortion for name in linearised.names]
    return chosen
