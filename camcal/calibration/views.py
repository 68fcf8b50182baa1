"""Which views can be used: enough corners, spread over the board and the image, and no view twice."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from camcal.geometry.arrays import FloatArray
from camcal.observations import Detection, Rejected

FEWEST_VIEWS = 3
"""Two planar views leave K undetermined with the principal point free (Zhang 2000, section 3.2)."""

_MORE_VIEWS = "Take more photographs that show the whole board."

FEWEST_CORNERS = 6
# Corners that were seen lie in the image. A fit may end a little outside; a tenth of the image is no such slip.
_MARGIN = 0.1
# Standard deviation across the line that fits the corners best. Finders need several pixels between two rows.
_NARROWEST_PX = 0.5


def usable_views(
    detections: Sequence[Detection], object_points: FloatArray
) -> tuple[tuple[Detection, ...], tuple[Rejected, ...]]:
    """Sort out the views that give a pose.

    Parameters
    ----------
    detections : sequence of Detection
    object_points : ndarray of shape (N, 3)
        The board's features in metres, by id.

    Returns
    -------
    used : tuple of Detection
        Sorted by source.
    rejected : tuple of Rejected
        The others, each with its reason.
    """
    used: list[Detection] = []
    rejected: list[Rejected] = []
    first: dict[tuple[bytes, bytes], str] = {}
    for detection in sorted(detections, key=lambda d: d.source):
        reason = _defect(detection, object_points)
        if not reason:
            twin = first.setdefault((detection.ids.tobytes(), detection.corners_px.tobytes()), detection.source)
            # A copy holds no information of its own, so it must neither count as a view nor shrink the uncertainty.
            reason = f"the same view as {twin}" if twin != detection.source else ""
        if reason:
            rejected.append(Rejected(detection.source, reason))
        else:
            used.append(detection)
    return tuple(used), tuple(rejected)


def too_few_views(count: int, rejected: Sequence[Rejected]) -> str:
    """Say that too few views are left, and the commonest reason for which the others were rejected.

    Reasons count as the same if they differ only in what stands in parentheses: the figures of one image.
    """
    text = f"calibrate: too few usable views (got {count}, expected at least {FEWEST_VIEWS})."
    if not rejected:
        return f"{text} {_MORE_VIEWS}"
    alike: dict[str, list[Rejected]] = {}
    for each in rejected:
        alike.setdefault(_without_figures(each.reason), []).append(each)
    clause, commonest = max(alike.items(), key=lambda item: len(item[1]))
    first = commonest[0]
    where = (
        f"{len(commonest)} of {len(rejected)} rejected images (first: {first.source})" if len(rejected) > 1 else first.source
    )
    reason = first.reason.rstrip(".")
    # After a colon a reason says itself what to do.
    advice = "" if ": " in clause else f" {_MORE_VIEWS}"
    return f"{text} {where}: {reason}{'' if reason.endswith('?') else '.'}{advice}"


def _without_figures(reason: str) -> str:
    return re.sub(r" ?\([^()]*\)", "", reason)


def _defect(detection: Detection, object_points: FloatArray) -> str:
    """Return the reason for a view that gives no pose; empty for one that does."""
    if len(detection) < FEWEST_CORNERS:
        return f"too few corners for a pose (got {len(detection)}, expected at least {FEWEST_CORNERS})"
    length, width = _spread(object_points[detection.ids, :2])
    if width <= 1e-6 * length:
        return "all corners lie on one line"
    margin = _MARGIN * max(detection.size)
    corners = detection.corners_px
    outside = ((corners < -margin) | (corners > np.array(detection.size) + margin)).any(axis=1)
    if outside.any():
        x, y = corners[outside][0]
        return f"a corner lies far outside the image (got {x:.4g}, {y:.4g}, expected inside {'{}x{}'.format(*detection.size)})"
    if _spread(corners)[1] < _NARROWEST_PX:
        return "all corners lie on one line or point of the image"
    return ""


def _spread(points: FloatArray) -> tuple[float, float]:
    """Standard deviations of points (N, 2) along the line that fits them best, and across it."""
    along, across = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) / np.sqrt(len(points))
    return float(along), float(across)
