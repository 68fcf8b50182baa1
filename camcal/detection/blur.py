"""Tells blurred views: how many pixels wide the edges of the pattern are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from camcal.detection.sampling import Gray, sample
from camcal.geometry.arrays import FloatArray
from camcal.observations import Detection, Rejected

# Profiles are read in steps of a quarter pixel, up to 8 pixels to either side of an edge.
_STEP_PX = 0.25
_PIXEL = round(1 / _STEP_PX)
_FARTHEST_PX = 8.0
_LEAST_CONTRAST = 10.0
_MOST_EDGES = 40

# Motion widens the edges across it: two thirds of that width weigh as much as blur in every direction.
_MOTION_WEIGHT = 2 / 3

_BLURRED_PX = 4.0
_BLURRED_AMONG_PX = 1.9
_BLURRED_AMONG_RATIO = 1.3
_FEWEST_TO_COMPARE = 5


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """Straight pieces of the pattern's edges with nothing but paper on one side and ink on the other.

    Attributes
    ----------
    starts_px, ends_px : ndarray of shape (E, 2)
        Where each piece begins and ends, in pixels.
    reach_px : ndarray of shape (E,)
        How far to either side of it the paper and the ink go.
    """

    starts_px: FloatArray
    ends_px: FloatArray
    reach_px: FloatArray

    def some(self) -> Edges:
        """At most a few dozen of them, evenly chosen: enough for a median."""
        step = -(-len(self.reach_px) // _MOST_EDGES)
        return Edges(self.starts_px[::step], self.ends_px[::step], self.reach_px[::step]) if step > 1 else self


def edge_width_px(gray: Gray, families: Sequence[Edges]) -> float:
    """Typical width of the pattern's edges in pixels.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    families : sequence of Edges
        The edges by direction: a shaken camera widens those across its motion only.

    Returns
    -------
    float
        Width of the sharpest family or, if that is more, two thirds of the widest family's; NaN if none can be measured.
        A width is contrast over the steepest change per pixel: 1 for an edge on pixel borders, 2.5 σ for a Gaussian blur.
    """
    with np.errstate(invalid="ignore"):
        medians = [np.nanmedian(widths) for edges in families if np.isfinite(widths := _widths(gray, edges)).any()]
    return float(max(min(medians), _MOTION_WEIGHT * max(medians))) if medians else float("nan")


def _widths(gray: Gray, edges: Edges) -> FloatArray:
    """Width of each edge in pixels, shape (E,); NaN where the contrast is too small or the image ends."""
    edges = edges.some()
    direction = edges.ends_px - edges.starts_px
    normal = np.stack([-direction[:, 1], direction[:, 0]], axis=1) / np.linalg.norm(direction, axis=1)[:, None]
    offsets = np.arange(-_FARTHEST_PX, _FARTHEST_PX + _STEP_PX, _STEP_PX)
    middle = (edges.starts_px + edges.ends_px) / 2
    profile = sample(gray, middle[:, None] + normal[:, None] * offsets[:, None]).astype(np.float64)
    reach = np.minimum(edges.reach_px, _FARTHEST_PX)[:, None]
    near, plateau = np.abs(offsets) <= reach, (np.abs(offsets) >= 0.6 * reach) & (np.abs(offsets) <= reach)
    before, after = _mean(profile, plateau & (offsets < 0)), _mean(profile, plateau & (offsets > 0))
    step = np.abs(profile[:, _PIXEL:] - profile[:, :-_PIXEL])
    inside = near[:, _PIXEL:] & near[:, :-_PIXEL]
    contrast = np.abs(after - before)
    # A step of 0 stands where nothing is known; it makes the width infinite, and the contrast NaN there anyway.
    steepest = np.where(inside & np.isfinite(step), step, 0.0).max(axis=1)
    widths: FloatArray = np.where(contrast >= _LEAST_CONTRAST, contrast / np.maximum(steepest, 1e-9), np.nan)
    return widths


def _mean(values: FloatArray, chosen: FloatArray) -> FloatArray:
    """Mean along each row over the chosen values; NaN where one of them is NaN or none is chosen."""
    with np.errstate(invalid="ignore", divide="ignore"):
        mean: FloatArray = np.where(chosen, values, 0.0).sum(axis=1) / chosen.sum(axis=1)
    return mean


def blur_notes(width_px: float) -> tuple[str, ...]:
    """What a single view's edge width tells, whatever the other views look like."""
    return (f"blurred: its edges are {width_px:.1f} pixels wide",) if width_px > _BLURRED_PX else ()


def flag_blurred(found: Sequence[Detection | Rejected]) -> tuple[Detection | Rejected, ...]:
    """Note which views are blurred compared with the others of the same camera.

    Sharpness in pixels differs from camera to camera, so a moderately blurred view shows only beside its neighbours.

    Parameters
    ----------
    found : sequence of Detection or Rejected
        All views, in any order.

    Returns
    -------
    tuple of Detection or Rejected
        The same views in the same order; the blurred ones carry one more note, unless they have one about blur already.
    """
    widths = np.array([view.edge_width_px for view in found if isinstance(view, Detection)])
    known = widths[np.isfinite(widths)]
    if known.size < _FEWEST_TO_COMPARE:
        return tuple(found)
    typical = float(np.median(known))
    limit = max(_BLURRED_AMONG_PX, _BLURRED_AMONG_RATIO * typical)
    return tuple(_flagged(view, limit, typical) for view in found)


def _flagged(view: Detection | Rejected, limit_px: float, typical_px: float) -> Detection | Rejected:
    if (
        isinstance(view, Rejected)
        or not view.edge_width_px > limit_px
        or any(note.startswith("blurred") for note in view.notes)
    ):
        return view
    note = f"blurred: its edges are {view.edge_width_px:.1f} pixels wide, {typical_px:.1f} in most other views"
    return replace(view, notes=(*view.notes, note))
