"""Which views can be relied on: how many there are that differ, and which are blurred, misfit or full of outliers."""

from __future__ import annotations

from collections import Counter

import numpy as np

from camcal.boards.base import Board
from camcal.geometry.arrays import FloatArray
from camcal.observations import Calibration
from camcal.trust.wording import named, rounded
from camcal.verdict import Finding

# Views whose boards lie within this share of the image's diagonal of each other are one view; views of good captures,
# taken by hand, are 2 % and more apart.
_SAME_VIEW = 0.005
_MANY_REPEATED = 0.3
_FEW_VIEWS, _POOR_VIEWS, _FEWEST_VIEWS = 5, 3, 3
_MANY_BLURRED = 0.3
_LARGEST_SHARE_OUT, _POOR_SHARE_OUT = 0.03, 0.1
_COPY = "the same view as"


def view_findings(calibration: Calibration, board: Board) -> tuple[Finding, ...]:
    """Judge the views one by one and their number.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.

    Returns
    -------
    tuple of Finding
        Some of `repeated_views`, `few_views`, `blurred_views`, `bad_view` and `outliers`.
    """
    apart = _distances_px(calibration, board)
    limit = _SAME_VIEW * float(np.hypot(*calibration.camera.size))
    distinct = _distinct(apart, limit)
    checks = (
        _repeated(calibration, apart, limit, distinct),
        _few(calibration, distinct),
        _blurred(calibration),
        _bad(calibration),
        _outliers(calibration),
    )
    return tuple(finding for finding in checks if finding)


def _distances_px(calibration: Calibration, board: Board) -> FloatArray:
    """Root mean square distance of the board's outer features between each two views, (V, V) pixels; NaN if behind."""
    points = board.object_points
    across = points[:, :2] @ [[1, 1], [1, -1]]
    outer = points[np.concatenate([across.argmin(axis=0), across.argmax(axis=0)])]
    seen = np.array([pose.apply(outer) for pose in calibration.poses])
    depth = np.where(seen[..., 2:] > 0, seen[..., 2:], np.nan)
    pixels = seen[..., :2] / depth * np.diag(calibration.camera.K)[:2]
    apart: FloatArray = np.sqrt(((pixels[:, None] - pixels) ** 2).sum(axis=-1).mean(axis=-1))
    return apart


def _distinct(apart_px: FloatArray, limit_px: float) -> list[int]:
    """Choose views that all are farther apart than a limit: every view is as near as that to one of them."""
    chosen: list[int] = []
    for view in range(len(apart_px)):
        if not (apart_px[view, chosen] < limit_px).any():
            chosen.append(view)
    return chosen


def _repeated(calibration: Calibration, apart_px: FloatArray, limit_px: float, distinct: list[int]) -> Finding | None:
    copies = [rejection.source for rejection in calibration.rejected if rejection.reason.startswith(_COPY)]
    count, left = len(apart_px) + len(copies), len(distinct)
    if count == left:
        return None
    again = sorted({*copies, *(calibration.detections[view].source for view in set(range(len(apart_px))) - set(distinct))})
    if left < _FEWEST_VIEWS:
        level = "rejected"
    elif left <= _POOR_VIEWS:
        level = "poor"
    else:
        level = "usable" if len(again) > _MANY_REPEATED * count else "note"
    return Finding(
        "repeated_views",
        level,
        len(again) / count,
        f"{len(again)} of {count} views show the board where another one does, within {rounded(limit_px)} px ({named(again)}): "
        f"{left} distinct views are left",
        "Move and tilt the board between the photographs; repeated views count once.",
    )


def _few(calibration: Calibration, distinct: list[int]) -> Finding | None:
    left = len(distinct)
    if left > _FEW_VIEWS:
        return None
    which = "distinct views" if left < len(calibration.poses) else "views"
    return Finding(
        "few_views",
        "poor" if left <= _POOR_VIEWS else "usable",
        1 / left,
        f"the calibration rests on {left} {which} (10 to 20 are usual)",
        "Take more photographs: 10 to 20, with the board tilted 20-45° in different directions, all over the image.",
    )


def _blurred(calibration: Calibration) -> Finding | None:
    views = calibration.detections
    blurred = [seen.source for seen in views if any(note.startswith("blurred") for note in seen.notes)]
    if not blurred:
        return None
    return Finding(
        "blurred_views",
        "usable" if len(blurred) > _MANY_BLURRED * len(views) else "note",
        len(blurred) / len(views),
        f"{len(blurred)} of {len(views)} views {'is' if len(blurred) == 1 else 'are'} blurred ({named(blurred)})",
        f"Retake {'it' if len(blurred) == 1 else 'them'}: hold camera and board still, focus, and use more light.",
    )


def _bad(calibration: Calibration) -> Finding | None:
    used = {seen.source for seen in calibration.detections}
    misfits = {outlier.source for outlier in calibration.outliers} - used
    reasons = {rejection.source: rejection.reason for rejection in calibration.rejected if rejection.source in misfits}
    if not reasons:
        return None
    first, reason = next(iter(reasons.items()))
    count = len(used) + len(reasons)
    text = (
        f"{first} {reason.partition(': ')[0]}"
        if len(reasons) == 1
        else f"{len(reasons)} of {count} views do not fit the others and were left out ({named(list(reasons))})"
    )
    advice = (
        "Look at these images and their corners: wrong corners, another board or another camera; leave them out or retake them."
    )
    return Finding("bad_view", "usable", len(reasons) / count, text, advice)


def _outliers(calibration: Calibration) -> Finding | None:
    used = {seen.source for seen in calibration.detections}
    by_view = Counter(outlier.source for outlier in calibration.outliers if outlier.source in used)
    dropped = by_view.total()
    share = dropped / (dropped + calibration.corner_count)
    if share <= _LARGEST_SHARE_OUT:
        return None
    worst, most = by_view.most_common(1)[0]
    return Finding(
        "outliers",
        "poor" if share > _POOR_SHARE_OUT else "usable",
        share,
        f"{rounded(100 * share)} % of the corners were left out as outliers (expected at most {100 * _LARGEST_SHARE_OUT:g} %), "
        f"{most} of them in {worst}",
        f"Look at the corners of {worst}; check the board's SPEC, and that nothing covers or mirrors in the board.",
    )
