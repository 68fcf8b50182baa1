"""Which split of the views into two explains most of what one camera leaves unexplained: any split, or one in time.

Each view v says with its information I_v and its gradient g_v by how much it would move the intrinsics that may differ
between the groups. To first order, giving a group its own values lowers the sum of squares by gᵀ I⁻¹ g, with the group's
sums of both (a score test; for a change at an unknown time: Andrews 1993, "Tests for parameter instability and structural
change with unknown change point").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.trust.linearised import inverse

FEWEST_IN_A_GROUP = 3
_MOST_ROUNDS = 30
_SEEDS = 8
_BEST = 3
# Of so many views one may be in the wrong group; more of fewer are in order by chance.
_VIEWS_PER_STRAY = 15


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """What each view says about the parameters, in units in which the corners' variance is 1.

    Attributes
    ----------
    information : ndarray of shape (V, F, F)
        Of all free parameters, the ones that may differ between groups first.
    gradient : ndarray of shape (V, F)
        Adds up to nearly nothing at the minimum.
    own : int
        How many parameters, K, may differ between groups: an even number.
    """

    information: FloatArray
    gradient: FloatArray
    own: int

    @property
    def gains(self) -> FloatArray:
        """By how much the sum of squares falls if each view has parameters of its own, shape (V,)."""
        gradient = self.gradient[:, : self.own]
        gains: FloatArray = (gradient * _solved(self.information[:, : self.own, : self.own], gradient)).sum(axis=1)
        return gains

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the sum of all gains: what the views share takes some."""
        views, free = self.gradient.shape
        return int(views * self.own - free)

    @property
    def dispersion(self) -> float:
        """Mean gain per degree of freedom: 1 if nothing differs between the views."""
        return float(self.gains.sum() / self.freedom) if self.freedom > 0 else 1.0


@dataclass(frozen=True, slots=True)
class Change:
    """The likeliest change of the parameters in the course of the views.

    Attributes
    ----------
    first : int
        Index of the first view after it.
    chance : float
        Probability of a change that looks like this where there is none.
    chance_without_one : float
        The same without the view that speaks for the change most.
    share : float
        Share of the views' gains that it explains.
    """

    first: int
    chance: float
    chance_without_one: float
    share: float


def best_partitions(scores: Scores) -> tuple[tuple[BoolArray, float], ...]:
    """Split the views into two groups whose own parameters explain most: 2-means with each view's own information.

    Returns
    -------
    tuple of (mask, share)
        The best splits that different starts lead to, the best first: the views of one group, shape (V,), and the share of
        the views' gains that the split explains. Empty if no group would be left with `FEWEST_IN_A_GROUP` views.
    """
    information, gradient = scores.information[:, : scores.own, : scores.own], scores.gradient[:, : scores.own]
    settled = [_settled(information, gradient, start) for start in _starts(information, gradient, scores.gains)]
    # A split and its complement are one.
    distinct = {(mask == mask[0]).tobytes(): mask for mask in settled if _large_enough(mask)}
    left = _group_gain(information, gradient)
    found = []
    for mask in distinct.values():
        gain = sum(_group_gain(information[part], gradient[part]) for part in (mask, ~mask))
        found.append((mask, (gain - left) / float(scores.gains.sum() - left)))
    return tuple(sorted(found, key=lambda split: -split[1])[:_BEST])


def best_change(scores: Scores) -> Change | None:
    """Find the likeliest change in the course of the views; None if they are too few to tell.

    The gain of a split is compared with how much the views differ within the two parts (an F test), so that what the model
    leaves unexplained in every view is no sign of a change.
    """
    V = len(scores.gradient)
    firsts = np.arange(FEWEST_IN_A_GROUP, V - FEWEST_IN_A_GROUP + 1)
    if not firsts.size or scores.freedom <= 2 * scores.own:
        return None
    before, pushed = np.cumsum(scores.information, axis=0), np.cumsum(scores.gradient, axis=0)
    gains = _split_gains(before[firsts - 1], pushed[firsts - 1], before[-1], pushed[-1], scores.own)
    at = int(np.argmax(gains))
    first = int(firsts[at])
    total = scores.gains
    chance = _chance(gains[at], total.sum(), scores.freedom, scores.own)
    inside = (np.arange(V) < first)[:, None]
    # Without a view the others stand at a minimum of their own; the gains within the parts change little by that.
    without = _split_gains(
        before[first - 1] - inside[..., None] * scores.information,
        pushed[first - 1] - inside * scores.gradient,
        before[-1] - scores.information,
        pushed[-1] - scores.gradient,
        scores.own,
    )
    chances = [
        _chance(gain, rest, scores.freedom - scores.own, scores.own)
        for gain, rest in zip(without.tolist(), (total.sum() - total).tolist(), strict=True)
    ]
    share = float(gains[at] / total.sum())
    return Change(first, min(1.0, chance * firsts.size), min(1.0, max(chances) * firsts.size), share)


def _split_gains(part: FloatArray, pushed: FloatArray, whole: FloatArray, total: FloatArray, own: int) -> FloatArray:
    """Gain (...,) of giving a part of the views, with sums of information and gradient, its own K first parameters.

    The parameters that stay shared make up for what they can: the gradient of the part is taken at the minimum of the
    whole, and its covariance there is B - B A⁻¹ B for the informations B of the part and A of the whole.
    """
    share = part @ inverse(whole)
    covariance = part - share @ np.swapaxes(part, -1, -2)
    score = (pushed - (share @ total[..., None])[..., 0])[..., :own]
    gains: FloatArray = (score * _solved(covariance[..., :own, :own], score)).sum(axis=-1)
    return gains


def _chance(gain: float, total: float, freedom: int, own: int) -> float:
    """Probability of a gain by chance, given the gains of all views and their degrees of freedom."""
    inner = freedom - own
    within = max(1.0, (total - gain) / inner)
    return fisher_tail(max(gain, 0.0) / own / within, own, inner)


def fisher_tail(ratio: float, numerator: int, denominator: int) -> float:
    """Probability that a variable of Fisher's F distribution exceeds a ratio; the numerator's degrees of freedom are even.

    The incomplete beta function is then a finite sum (Abramowitz and Stegun 26.6.4).

    Examples
    --------
    >>> round(fisher_tail(4.0, 2, 10), 6) == round((1 + 2 * 4 / 10) ** -5.0, 6)
    True
    """
    x = denominator / (denominator + numerator * ratio)
    half = denominator / 2
    terms = [1.0]
    for i in range(1, numerator // 2):
        terms.append(terms[-1] * (half + i - 1) / i * (1 - x))
    return float(x**half * sum(terms))


def _starts(information: FloatArray, gradient: FloatArray, gains: FloatArray) -> list[BoolArray]:
    """Splits to begin with: below and above the median in each parameter and along its main directions, and far views."""
    each = _solved(information, gradient)
    whole = information.sum(axis=0)
    scaled = (each - np.median(each, axis=0)) * np.sqrt(np.diag(whole))
    # A view that says next to nothing about a parameter must not decide the directions.
    _, _, axes = np.linalg.svd(np.clip(scaled, -1e3, 1e3), full_matrices=False)
    along = np.concatenate([scaled, scaled @ axes.T], axis=1)
    sides = list((along > np.median(along, axis=0)).T)
    farthest = np.argsort(-gains)[:_SEEDS]
    return [*sides, *(_costs(information, gradient, each[view]) < 0 for view in farthest)]


def _settled(information: FloatArray, gradient: FloatArray, mask: BoolArray) -> BoolArray:
    """Give each view to the group whose parameters suit it better until nothing changes."""
    for _ in range(_MOST_ROUNDS):
        if not _large_enough(mask):
            break
        one, other = (_solved(information[part].sum(axis=0), gradient[part].sum(axis=0)) for part in (mask, ~mask))
        changed = _costs(information, gradient, one) < _costs(information, gradient, other)
        if (changed == mask).all():
            break
        mask = changed
    return mask


def _large_enough(mask: BoolArray) -> bool:
    return bool(min(mask.sum(), (~mask).sum()) >= FEWEST_IN_A_GROUP)


def _costs(information: FloatArray, gradient: FloatArray, shift: FloatArray) -> FloatArray:
    """By how much each view's sum of squares grows if the parameters move by a shift (K,): shape (V,)."""
    costs: FloatArray = (information @ shift) @ shift - 2 * gradient @ shift
    return costs


def _group_gain(information: FloatArray, gradient: FloatArray) -> float:
    """By how much the sum of squares of a group of views falls with parameters of its own."""
    pushed = gradient.sum(axis=0)
    return float(pushed @ _solved(information.sum(axis=0), pushed))


def _solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution (..., K) of symmetric systems; what they do not determine stays where it is."""
    solved: FloatArray = (inverse(matrix) @ right[..., None])[..., 0]
    return solved


def in_course(mask: BoolArray) -> int | None:
    """Index of the first view of the later group if the groups (V,) follow one another but for a few; None if they do not."""
    firsts = np.arange(1, mask.size)
    before = np.concatenate([[0], np.cumsum(mask)])
    # Views that are out of place if the group of the mask comes first, and if it comes last.
    astray = firsts - before[firsts] + before[-1] - before[firsts]
    astray = np.minimum(astray, mask.size - astray)
    best = int(np.argmin(astray))
    return int(firsts[best]) if astray[best] <= mask.size // _VIEWS_PER_STRAY else None
