"""Whether all views are of one and the same camera: several cameras mixed, or one that changed in the course of the views.

What one camera may show by itself is taken out first: every coefficient of the lens and the board's shape are freed, so
that a model that is too simple, or a bent board, is not taken for two cameras.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np

from camcal.boards.base import Board
from camcal.calibration.board_shape import SHAPE_NAMES, shape_basis
from camcal.calibration.finish import descend
from camcal.calibration.normal_equations import Observations, State, view_costs
from camcal.calibration.parameters import PINHOLE, distortion_names
from camcal.calibration.restart import nonsense
from camcal.calibration.solve import solve
from camcal.calibration.views import FEWEST_CORNERS
from camcal.errors import CamcalError
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.geometry.camera import Camera
from camcal.observations import Calibration, Detection
from camcal.trust.grouping import FEWEST_IN_A_GROUP, Scores, best_change, best_partitions, in_course
from camcal.trust.likeness import described, likeness, median_difference_px
from camcal.trust.minimum import ONE_LENS, Minimum
from camcal.trust.wording import named, rounded
from camcal.verdict import Finding

# A camera that changes moves its K; another camera has another lens as well (k1 and k2 follow in the order of columns).
_OWN = len(PINHOLE)
_OWN_OF_ANOTHER = _OWN + 2

# Below both, before anything is freed, the views agree as far as it matters.
_DISPERSION = 2.0
_CHANCE_TO_LOOK = 0.01
# A change must be this unlikely to be one of chance; and still unlikely without the view that speaks for it most.
_CHANCE = 1e-3
_CHANCE_WITHOUT_ONE = 1e-2
# Share of the differences between the views that two groups must explain, to first order and once they are solved apart.
# Views that differ for other reasons reach 0.5 (photographs and made views) and 0.75 (a focus that is never the same); among
# few views chance alone explains more.
_SHARE_TO_LOOK = 0.5
_SHARE, _SHARE_PER_VIEW = 0.75, 1.5
# A change explains at least this part of what any two groups explain: else the groups are in no order.
_SHARE_IN_ORDER = 0.6
_MOST_ROUNDS = 6

# Median difference of the two cameras over the image; the calibration lies somewhere between them.
_USABLE_PX, _POOR_PX, _REJECTED_PX = 0.1, 1.0, 5.0
_LEAST_RMS_PX = 1e-6
_FITS_ALONE = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class _Split:
    """Two groups of views, each at its own minimum: the views of `mask`, and the others."""

    mask: BoolArray
    groups: tuple[Minimum, Minimum]

    @property
    def cameras(self) -> tuple[Camera, Camera]:
        return self.groups[0].state.camera, self.groups[1].state.camera

    @property
    def difference_px(self) -> float:
        """Median difference of the two cameras over the image, for far points."""
        return median_difference_px(*self.cameras)


def consistency(calibration: Calibration, board: Board) -> tuple[Finding, ...]:
    """Test whether the views are of one and the same camera.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.

    Returns
    -------
    tuple of Finding
        `mixed_cameras` if the views fall into two groups in no order, also where the smaller group was left out of the
        solve already; `drift` if they do so in the order of their names.
    """
    left_out = _another_camera_left_out(calibration, board)
    if left_out is not None:
        return (left_out,)
    plain = Minimum.of(calibration, board)
    if not plain.variance_px2 > _LEAST_RMS_PX**2 or not _suspicious(_scores(plain)):
        return ()
    freed = _as_much_as_one_camera_shows(plain, calibration, board)
    if freed is None:
        return ()
    split = _two_cameras(freed, plain) or _two_times(freed, plain)
    if split is None:
        return ()
    first = in_course(split.mask)
    found = _mixed(calibration, split) if first is None else _drift(calibration, split, first)
    return (found,)


def _suspicious(scores: Scores) -> bool:
    change = best_change(scores)
    return scores.dispersion > _DISPERSION or (change is not None and change.chance < _CHANCE_TO_LOOK)


def _scores(minimum: Minimum, own: int = _OWN) -> Scores:
    information, gradient = minimum.view_information()
    return Scores(information / minimum.variance_px2, gradient / minimum.variance_px2, own)


def _as_much_as_one_camera_shows(plain: Minimum, calibration: Calibration, board: Board) -> Minimum | None:
    """Free whatever one lens and one board may have; None if that leads nowhere."""
    names = tuple(name for name in SHAPE_NAMES if name not in calibration.shape.names)
    basis = shape_basis(board.object_points, names)
    rows = np.concatenate([detection.ids for detection in calibration.detections])
    freed = plain.freed(ONE_LENS, basis[rows]).descended()
    return freed if freed is not None and freed.variance_px2 > _LEAST_RMS_PX**2 else None


def _two_cameras(one: Minimum, plain: Minimum) -> _Split | None:
    """Split the views into two groups that each fit well alone; None if no two groups explain the differences."""
    needed = _SHARE + _SHARE_PER_VIEW / one.seen.starts.size
    for mask, share in best_partitions(_scores(one, _OWN_OF_ANOTHER)):
        split = _settled(one, mask) if share >= _SHARE_TO_LOOK else None
        if split is not None and _explained_share(one, split) > needed:
            first = in_course(split.mask)
            groups = split.mask if first is None else np.arange(split.mask.size) < first
            # What is reported are two calibrations of the kind that was asked for.
            return _solved_apart(plain, groups)
    return None


def _settled(one: Minimum, mask: BoolArray) -> _Split | None:
    """Solve for two groups apart and give each view to the camera that fits it better, until none changes."""
    split = None
    for _ in range(_MOST_ROUNDS):
        split = _solved_apart(one, mask)
        if split is None:
            break
        mask = _costs(one, split.groups[0]) < _costs(one, split.groups[1])
        if (mask == split.mask).all() or min(mask.sum(), (~mask).sum()) < FEWEST_IN_A_GROUP:
            break
    return split


def _solved_apart(one: Minimum, mask: BoolArray) -> _Split | None:
    groups = one.only(mask).descended(), one.only(~mask).descended()
    return None if groups[0] is None or groups[1] is None else _Split(mask, (groups[0], groups[1]))


def _explained_share(one: Minimum, split: _Split) -> float:
    """Share of the differences between the views that is gone once the two groups are solved apart."""
    gain = one.cost - sum(group.cost for group in split.groups)
    left = sum(float(Scores(*group.view_information(), _OWN_OF_ANOTHER).gains.sum()) for group in split.groups)
    return gain / (gain + left)


def _costs(one: Minimum, group: Minimum) -> FloatArray:
    """Sum of squares (V,) of every view, posed anew under the camera of a group."""
    start = replace(group.state, rvecs=one.state.rvecs, ts=one.state.ts)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        posed: State = descend(start, one.seen, np.zeros(0, dtype=np.int64)).state
        return view_costs(posed, one.seen)


def _two_times(one: Minimum, plain: Minimum) -> _Split | None:
    """Split the views in their order where the camera changed; None if it did not."""
    scores = _scores(one)
    change = best_change(scores)
    if change is None or change.chance > _CHANCE or change.chance_without_one > _CHANCE_WITHOUT_ONE:
        return None
    most = max((share for _, share in best_partitions(scores)), default=0.0)
    if most > _SHARE_TO_LOOK and change.share < _SHARE_IN_ORDER * most:
        return None
    mask = np.arange(one.seen.starts.size) < change.first
    # A few views need not determine a whole lens; then only what may have changed is solved for.
    return _solved_apart(plain, mask) or _solved_apart(replace(plain, columns=plain.columns[:_OWN]), mask)


def _level(difference_px: float) -> str:
    for limit, level in ((_REJECTED_PX, "rejected"), (_POOR_PX, "poor"), (_USABLE_PX, "usable")):
        if difference_px >= limit:
            return level
    return "note"


def _drift(calibration: Calibration, split: _Split, first: int) -> Finding:
    sources = [detection.source for detection in calibration.detections]
    before, after = split.groups if split.mask[0] else split.groups[::-1]
    text = (
        f"{_largest_change(before, after, sources[first - 1], sources[first])}, {rounded(split.difference_px)} px apart in the "
        f"median{likeness(after.state.camera, before.state.camera)}"
    )
    advice = (
        "Lock focus and zoom, fix lens and sensor, let no image be cropped, rescaled or stabilised, and take all views anew "
        "or calibrate from one of the two parts."
    )
    return Finding("drift", _level(split.difference_px), _saturated(split.difference_px), text, advice)


def _mixed(calibration: Calibration, split: _Split) -> Finding:
    smaller = split.mask if split.mask.mean() <= 0.5 else ~split.mask
    few, many = split.cameras if smaller is split.mask else split.cameras[::-1]
    odd = [detection.source for detection, chosen in zip(calibration.detections, smaller, strict=True) if chosen]
    text = (
        f"{len(odd)} of {smaller.size} views are of another camera than the others ({named(odd)}): {described(few)} against "
        f"{described(many)}, {rounded(split.difference_px)} px apart in the median{likeness(few, many)}"
    )
    advice = "Calibrate each camera from its own images, unchanged and of one size."
    return Finding("mixed_cameras", _level(split.difference_px), _saturated(split.difference_px), text, advice)


def _another_camera_left_out(calibration: Calibration, board: Board) -> Finding | None:
    """Say so if the views that were left out as a whole fit a camera of their own."""
    views = _left_out(calibration, board)
    if len(views) < FEWEST_IN_A_GROUP:
        return None
    try:
        other = solve(views, board.object_points, distortion=distortion_names(calibration.free))
    except CamcalError:
        return None
    if other.rms_px > _FITS_ALONE * calibration.rms_px or len(other.detections) < FEWEST_IN_A_GROUP:
        return None
    odd = [view.source for view in other.detections]
    return Finding(
        "mixed_cameras",
        "usable",
        len(odd) / (len(odd) + len(calibration.detections)),
        f"{len(odd)} of {len(odd) + len(calibration.detections)} views were left out because they are of another camera "
        f"({named(odd)}): {described(other.camera)} against {described(calibration.camera)}"
        f"{likeness(other.camera, calibration.camera)}",
        "Leave these images out if the others are of the camera that is meant, else calibrate from these alone.",
    )


def _left_out(calibration: Calibration, board: Board) -> list[Detection]:
    """Views that were left out as a whole but do look like the board, put together again from their corners."""
    used = {detection.source for detection in calibration.detections}
    corners = defaultdict(list)
    for outlier in calibration.outliers:
        if outlier.source not in used:
            corners[outlier.source].append((outlier.id, *outlier.corner_px, outlier.sigma_px))
    views = []
    for source, rows in corners.items():
        ids, x, y, sigma = np.array(sorted(rows)).T
        if ids.size >= FEWEST_CORNERS:
            found = np.stack([x, y], axis=1)
            views.append(Detection(source, calibration.camera.size, ids.astype(np.int64), found, sigma))
    if not views:
        return []
    # What does not is of no other camera either, and takes long to fail as one.
    is_nonsense = nonsense(Observations.gather(views, board.object_points))
    return [view for view, unlike in zip(views, is_nonsense, strict=True) if not unlike]


def _largest_change(before: Minimum, after: Minimum, last: str, first: str) -> str:
    """Name the intrinsic that changed most for its uncertainty, and its values up to one view and from another one on."""
    values = np.array([group.state.camera.intrinsics[:_OWN] for group in (before, after)])
    sigmas = np.array([_sigmas(group) for group in (before, after)])
    most = int(np.argmax(np.abs(values[1] - values[0]) / np.hypot(*sigmas)))
    was, became = (f"{value:.1f} ± {sigma:.2g}" for value, sigma in zip(values[:, most], sigmas[:, most], strict=True))
    return f"{PINHOLE[most]} is {was} up to {last} and {became} from {first} on"


def _sigmas(group: Minimum) -> FloatArray:
    """Standard deviations of fx, fy, cx and cy of a group."""
    information, _ = group.view_information()
    sigmas: FloatArray = np.sqrt(group.variance_px2 * np.diag(np.linalg.pinv(information.sum(axis=0), hermitian=True)))
    return sigmas[:_OWN]


def _saturated(difference_px: float) -> float:
    """Weight among findings of one kind, from 0 to 1."""
    return 1 - 1 / (1 + difference_px)
