"""The search for the lowest minimum: one start and one descent as a rule, more of both where the answer is suspicious."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from camcal.calibration.branches import reposed
from camcal.calibration.closed_form import closed_form_camera, facing
from camcal.calibration.finish import Descent, descend
from camcal.calibration.normal_equations import Observations, State, view_rms
from camcal.calibration.parameters import first_stage, places
from camcal.calibration.start import opencv_start
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.observations import Detection

# Real corners fit within a few tenths of a pixel, every view about as well as the next. A false minimum shows in one of
# the two: a board in the wrong pose stands out, a camera in the wrong place fits nothing. A false alarm costs only time.
_SUSPICIOUS_RMS_PX = 1.0
_SUSPICIOUS_RATIO = 3.0
# Below this the corners are perfect (made, not seen), and the ratios of their last bits mean nothing.
_PERFECT_RMS_PX = 1e-3
# Among so few views one in the wrong pose bends the camera until it no longer stands out; they are quickly solved again.
_FEW_VIEWS = 5
_MOST_REPOSINGS = 4


def lowest_minimum(
    detections: Sequence[Detection], object_points: FloatArray, seen: Observations, free: tuple[str, ...]
) -> Descent:
    """Find the camera and the poses that fit the corners best.

    Parameters
    ----------
    detections : sequence of Detection
        Usable views of one image size.
    object_points : ndarray of shape (N, 3)
        The board's features in metres, by id.
    seen : Observations
        The same views, gathered.
    free : tuple of str
        Names of the free intrinsics.

    Returns
    -------
    Descent
        Its failure says why if no start leads to a minimum; then it is the lowest state that one of them led to.
    """
    found: list[Descent] = []
    # Trial steps far from any camera may overflow; their cost is infinite then, and they are not taken.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for start, stages in _starts(detections, object_points, seen, free):
            found.append(_descend_in_stages(start, seen, stages))
            if not _suspicious(found[-1], seen):
                break
    return min(found, key=lambda descent: (bool(descent.failure), descent.cost))


def _starts(
    detections: Sequence[Detection], object_points: FloatArray, seen: Observations, free: tuple[str, ...]
) -> Iterator[tuple[State, tuple[IntArray, ...]]]:
    """Yield starts, the most robust first, each with the free intrinsics of every stage of its descent."""
    for staged in (True, False):
        start = opencv_start(detections, object_points, free, staged=staged)
        if start is not None:
            yield start, (places(start.camera, free),)
    camera = closed_form_camera(seen, detections[0].size)
    blank = facing(camera, seen)
    yield reposed(blank, seen) or blank, (places(camera, first_stage(free)), places(camera, free))


def _descend_in_stages(start: State, seen: Observations, stages: Sequence[IntArray]) -> Descent:
    """Descend with a few free intrinsics, then with more; boards that ended in the wrong pose are put right between."""
    found = Descent(start, np.inf, "not started")
    for columns in stages:
        found = descend(found.state, seen, columns)
        for _ in range(_MOST_REPOSINGS):
            better = reposed(found.state, seen) if _suspicious(found, seen) else None
            if better is None:
                break
            found = descend(better, seen, columns)
    return found


def _suspicious(found: Descent, seen: Observations) -> bool:
    """Tell whether a descent may have ended elsewhere than in the lowest minimum."""
    if found.failure or seen.starts.size <= _FEW_VIEWS:
        return True
    rms, each = np.sqrt(found.cost / seen.view.size), view_rms(found.state, seen)
    uneven = each.max() > max(_PERFECT_RMS_PX, _SUSPICIOUS_RATIO * float(np.median(each)))
    return bool(rms > _SUSPICIOUS_RMS_PX or uneven)
