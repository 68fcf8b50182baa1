"""From the lowest minimum of all corners to that of the corners that belong, each with its own weight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camcal.calibration.advice import worst_view
from camcal.calibration.finish import Descent, descend
from camcal.calibration.normal_equations import Observations, State, residuals, view_rms
from camcal.calibration.outliers import belonging, distances_in_sigmas, named_outlier, standing_out, worst_misfit
from camcal.calibration.softened import softened
from camcal.calibration.views import FEWEST_VIEWS
from camcal.calibration.weights import total_sigma_px
from camcal.errors import SolveError
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.observations import Detection, Outlier, Rejected

# Where a model does not describe its corners the choice may go round in circles.
_MOST_ROUNDS = 10
_MOST_WEIGHINGS = 4
_SAME_WEIGHT = 0.01
# A view whose median corner is so many times farther off than the median view's may have been bent by a part of itself.
_STANDS_OUT = 3.0
# Where least squares fails, what is left without the rest has to fit beyond doubt.
_NO_DOUBT_RMS_PX = 1.0
# With more views out than this it is not they that are wrong.
_LARGEST_SHARE_OF_VIEWS = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A minimum, and the corners it rests on.

    Attributes
    ----------
    state : State
    seen : Observations
        The corners that were kept, with their weights.
    detections : tuple of Detection
        The same corners, view by view.
    outliers : tuple of Outlier
        Corners that were left out, also those of views that were left out as a whole.
    misfits : tuple of Rejected
        Views that were left out as a whole.
    """

    state: State
    seen: Observations
    detections: tuple[Detection, ...]
    outliers: tuple[Outlier, ...] = ()
    misfits: tuple[Rejected, ...] = ()

    @property
    def rms_px(self) -> float:
        """Root mean square length of the residuals, unweighted."""
        return float(np.sqrt((residuals(self.state, self.seen) ** 2).sum(axis=1).mean()))


def undoubted_minimum(
    state: State, seen: Observations, detections: Sequence[Detection], columns: IntArray, free: tuple[str, ...]
) -> Fit | None:
    """Leave out what does not belong without asking least squares over all corners first, which nonsense leads nowhere.

    Parameters
    ----------
    state : State
        A start that what does not belong has not bent.
    seen, detections, columns, free
        As `robust_minimum` takes them.

    Returns
    -------
    Fit or None
        None unless what is left fits beyond doubt, and every view of it as the others do.
    """
    fit = _from_softened(_all(state, seen, detections), columns, free)
    return None if fit is None or fit.rms_px > _NO_DOUBT_RMS_PX or _stands_out(fit) else fit


def robust_minimum(
    lowest: Descent,
    seen: Observations,
    detections: Sequence[Detection],
    columns: IntArray,
    free: tuple[str, ...],
    *,
    restart: Callable[[], State],
) -> Fit:
    """Leave out what does not belong, and weigh the rest.

    Least squares over all corners comes first. Where it fails, or lets views stand out, what does not belong may have bent
    it so far that nothing tells what; then another way is tried, from a minimum that gross errors hardly move.

    Parameters
    ----------
    lowest : Descent
        How far least squares got with all corners, weighing the same.
    seen : Observations
        All corners.
    detections : sequence of Detection
        The same, view by view.
    columns : ndarray of shape (F,)
        Places of the free parameters in `State.shared`.
    free : tuple of str
        Names of the free intrinsics, for advice.
    restart : function
        Gives the state that the other way starts from.

    Raises
    ------
    SolveError
        If a descent fails; it names the view that fits worst.
    """
    start = _all(lowest.state, seen, detections)
    try:
        if lowest.failure:
            raise SolveError(_failed(lowest, seen, detections, free))
        fit = _from_least_squares(start, columns, free)
    except SolveError:
        other = _from_softened(replace(start, state=restart()), columns, free)
        if other is None or other.rms_px > _NO_DOUBT_RMS_PX:
            raise
        return other
    if not fit.misfits and not _stands_out(fit):
        return fit
    other = _from_softened(replace(start, state=restart()), columns, free)
    return fit if other is None or not _clearer(other, fit) else other


def _all(state: State, seen: Observations, detections: Sequence[Detection]) -> _Round:
    """Begin with all corners."""
    return _Round(state, seen, tuple(detections), np.ones(seen.view.size, dtype=bool))


def _clearer(other: Fit, fit: Fit) -> bool:
    """Tell whether nothing stands out any more where something did, or fewer views had to go for that."""
    if _stands_out(other) or len(other.misfits) > len(fit.misfits):
        return False
    return len(other.misfits) < len(fit.misfits) or _stands_out(fit)


def _stands_out(fit: Fit) -> bool:
    """Tell whether a view is left that may have been bent by a part of itself."""
    return bool(standing_out(fit.state, fit.seen).max() > _STANDS_OUT)


def _failed(found: Descent, seen: Observations, detections: Sequence[Detection], free: tuple[str, ...]) -> str:
    """Say why a descent is no minimum, and which view fits worst."""
    return f"solve: {found.failure}. {worst_view(view_rms(found.state, seen), detections, free)}"


def _from_least_squares(start: _Round, columns: IntArray, free: tuple[str, ...]) -> Fit:
    """Leave out what does not belong, from the least-squares minimum of all corners."""
    fit = _without_outliers(*start.solved(columns, free), columns, free, drop_views=True)
    if len(fit.misfits) > _LARGEST_SHARE_OF_VIEWS * len(start.detections):
        return _without_outliers(*start.solved(columns, free), columns, free, drop_views=False)
    return fit


def _from_softened(start: _Round, columns: IntArray, free: tuple[str, ...]) -> Fit | None:
    """Do the same from a softened minimum; None if that leads nowhere, or only with too many views left out."""
    # What lies behind the camera is infinitely far off.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _settled(start, columns, free)


def _settled(start: _Round, columns: IntArray, free: tuple[str, ...]) -> Fit | None:
    """Soften, drop the views that stand out, and go on as from any minimum."""
    most_misfits = _LARGEST_SHARE_OF_VIEWS * len(start.detections)
    current = replace(start, state=softened(start.state, start.seen, start.sigma_px, columns))
    misfits: list[Rejected] = []
    outliers: list[Outlier] = []
    # Here whole views stand out by themselves, before anything is solved again.
    while (worst := _worst(current)) is not None and len(misfits) <= most_misfits:
        misfits.append(_misfit(current, worst))
        outliers.extend(_outliers(current, current.seen.view == worst))
        current = current.without(worst)
    current = replace(current, kept=belonging(*current.known))
    try:
        fit = _without_outliers(*current.solved(columns, free), columns, free, drop_views=True)
    except SolveError:
        return None
    fit = replace(fit, outliers=(*outliers, *fit.outliers), misfits=(*misfits, *fit.misfits))
    return fit if len(fit.misfits) <= most_misfits else None


@dataclass(frozen=True, slots=True, eq=False)
class _Round:
    """The views that are still in, all their corners, and which of these are kept."""

    state: State
    seen: Observations
    detections: tuple[Detection, ...]
    kept: BoolArray

    @property
    def known(self) -> tuple[State, Observations, FloatArray, BoolArray]:
        """What a corner is judged by: the state, all corners, their standard deviations, and which are kept."""
        return self.state, self.seen, self.sigma_px, self.kept

    @property
    def sigma_px(self) -> FloatArray:
        """Standard deviation (M,) of every corner; NaN where it is not known."""
        return np.concatenate([detection.sigma_px for detection in self.detections])

    def solved(self, columns: IntArray, free: tuple[str, ...]) -> tuple[_Round, Observations]:
        """Descend to the minimum of the kept corners, each with its own weight where these are known.

        What the corners have in common is only seen where the exact ones have had their say, so it is worked out again.
        """
        kept, sigma_px, state = self.seen.only(self.kept), self.sigma_px[self.kept], self.state
        before = np.zeros(1)
        for _ in range(_MOST_WEIGHINGS):
            total = total_sigma_px(sigma_px, residuals(state, kept), columns.size + 6 * kept.starts.size)
            weighted = kept if total is None else kept.weighted(total)
            found = descend(state, weighted, columns)
            if found.failure:
                raise SolveError(_failed(found, kept, self.detections, free))
            state = found.state
            if total is None or (np.abs(total - before) <= _SAME_WEIGHT * total).all():
                break
            before = total
        return replace(self, state=state), weighted

    def without(self, view: int) -> _Round:
        """Return the round without one view."""
        stay = self.seen.view != view
        views = np.delete(np.arange(len(self.detections)), view)
        detections = tuple(self.detections[index] for index in views)
        return _Round(self.state.of_views(views), self.seen.only(stay), detections, self.kept[stay])


def _without_outliers(
    current: _Round, weighted: Observations, columns: IntArray, free: tuple[str, ...], *, drop_views: bool
) -> Fit:
    """Choose the corners that belong, and solve again until the choice stands."""
    most_misfits = _LARGEST_SHARE_OF_VIEWS * len(current.detections)
    misfits: list[Rejected] = []
    outliers: list[Outlier] = []
    rounds = 0
    while True:
        chosen = belonging(*current.known) if rounds < _MOST_ROUNDS else current.kept
        if (chosen != current.kept).any():
            rounds += 1
            current = replace(current, kept=chosen)
        elif drop_views and (worst := _worst(current)) is not None:
            # A single corner far off bends the pose of its view: only without it is the view judged as a whole.
            misfits.append(_misfit(current, worst))
            outliers.extend(_outliers(current, current.seen.view == worst))
            current = current.without(worst)
            if len(misfits) > most_misfits:
                break
        else:
            break
        current, weighted = current.solved(columns, free)
    detections = [seen.take(keep) for seen, keep in zip(current.detections, _by_view(current.kept, current), strict=True)]
    return Fit(current.state, weighted, tuple(detections), (*outliers, *_outliers(current, ~current.kept)), tuple(misfits))


def _worst(current: _Round) -> int | None:
    """Find the view that belongs least, if one does not and enough would be left."""
    return worst_misfit(*current.known) if len(current.detections) > FEWEST_VIEWS else None


def _by_view(values: NDArray[Any], current: _Round) -> list[NDArray[Any]]:
    """Split values of all corners (M, ...) by view."""
    return np.split(values, current.seen.starts[1:])


def _misfit(current: _Round, view: int) -> Rejected:
    """Say how much worse than the others a view fits."""
    rms = view_rms(current.state, replace(current.seen, weights=np.ones(current.seen.view.size)))
    others = float(np.median(np.delete(rms, view)))
    return Rejected(
        current.detections[view].source,
        f"does not fit the other views (RMS {rms[view]:.3g} px, {others:.3g} px in the median view): look at its corners",
    )


def _outliers(current: _Round, left_out: BoolArray) -> tuple[Outlier, ...]:
    """Name the corners (M,) that are left out."""
    off = residuals(current.state, current.seen)
    sigmas = distances_in_sigmas(current.state, current.seen, current.sigma_px, current.kept)
    by_view = (_by_view(values, current) for values in (left_out, off, sigmas))
    return tuple(
        named_outlier(detection, row, vectors[row], far[row])
        for detection, gone, vectors, far in zip(current.detections, *by_view, strict=True)
        for row in np.flatnonzero(gone).tolist()
    )
