"""Leave one out: which view moves the answer most, and by how much."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from camcal.calibration.views import FEWEST_VIEWS
from camcal.compare.projection import projection_shifts
from camcal.geometry.arrays import FloatArray
from camcal.trust.linearised import Linearised, inverse
from camcal.trust.wording import rounded
from camcal.verdict import Finding

# In an honest capture the weightiest view moves the camera by 0.4 to 1.4 of its standard deviations.
_NOTABLE = 2.0
_EXTREME = 4.0
# Below this the answer is good enough with or without the view.
_HARMFUL_PX = 1.0
_CELLS = 40


@dataclass(frozen=True, slots=True)
class Influence:
    """What the calibration would be without the view that moves it most.

    Attributes
    ----------
    source : str
        Name of the view; empty if it is not known.
    sigmas : float
        How far the camera moves in units of its predicted standard deviation, root mean square over the independent ways in
        which it can move: the square root of Cook's distance (Cook 1977, "Detection of influential observation in linear
        regression").
    shift_px : float
        How far the projection of a far point moves where that is most, among the places where any view has corners; pixels.
    place_px : tuple of float
        The pixel where it is.
    typical : float
        `sigmas` of the median view.
    """

    source: str
    sigmas: float
    shift_px: float
    place_px: tuple[float, float]
    typical: float

    @property
    def findings(self) -> tuple[Finding, ...]:
        """`influential_view` if the answer hangs on one view."""
        if not self.sigmas > _NOTABLE:
            return ()
        x, y = self.place_px
        text = (
            f"{self.source}: this view alone moves the projection by {rounded(self.shift_px)} px at ({x:.0f}, {y:.0f}), the "
            f"camera by {self.sigmas:.1f} times its standard deviation ({self.typical:.1f} in the median view)"
        )
        advice = (
            "Look at that image and its corners; if they are right, add views like it, so that the answer rests on several."
        )
        level = "usable" if self.sigmas > _EXTREME and self.shift_px > _HARMFUL_PX else "note"
        return (Finding("influential_view", level, self.sigmas, text, advice),)


def influence(linearised: Linearised, sources: Sequence[str], corners_px: FloatArray) -> Influence:
    """Find the view whose loss would change the camera most.

    Parameters
    ----------
    linearised : Linearised
        The calibration's minimum. Each view is left out by one Newton step from it.
    sources : sequence of str
        Names of the views.
    corners_px : ndarray of shape (M, 2)
        All corners.

    Returns
    -------
    Influence
        Without a name and NaN for fewer than four views: without one of them the others determine no camera.
    """
    if len(sources) < FEWEST_VIEWS + 1:
        unknown = float("nan")
        return Influence("", unknown, unknown, (unknown, unknown), unknown)
    S, G = linearised.information.sum(axis=0), linearised.gradient.sum(axis=0)
    without = S - linearised.information
    moves = (inverse(without) @ (G - linearised.gradient)[..., None])[..., 0]
    sigmas = np.sqrt(np.maximum((moves * (moves @ S)).sum(axis=1), 0) / S.shape[0])
    most = int(np.argmax(sigmas))
    places = _seen_places(linearised.camera.size, corners_px)
    names = linearised.names
    shifts = projection_shifts(linearised.camera, names, moves[most : most + 1, : len(names)], places)
    lengths = np.nan_to_num(np.linalg.norm(shifts[0], axis=1), nan=-1.0)
    at = int(np.argmax(lengths))
    x, y = places[at].tolist()
    return Influence(sources[most], float(sigmas[most]), float(lengths[at]), (x, y), float(np.median(sigmas)))


def _seen_places(size: tuple[int, int], corners_px: FloatArray) -> FloatArray:
    """Centres (M, 2) of the square cells of an image in which any corner lies."""
    side = max(size) / _CELLS
    centres: FloatArray = (np.unique(np.floor((corners_px + 0.5) / side), axis=0) + 0.5) * side - 0.5
    return np.clip(centres, 0, np.array(size) - 1.0)
