"""What a lens does to an image, in words and in pixels at the corner."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.trust.wording import rounded

_NOTHING_PX = 0.5
"""Less than this is no distortion that anybody could see."""

_STEPS = 200


@dataclass(frozen=True, slots=True)
class LensWords:
    """A lens in words.

    Attributes
    ----------
    kind : str
        `barrel`, `pincushion`, `moustache` or `next to none`.
    corner_px : float
        How far from its undistorted place the image's corner is seen, negative towards the middle, at the corner where it is
        most; where no corner has a ray, at the farthest valid place on the way to one.
    text : str
        Both, as a clause.
    """

    kind: str
    corner_px: float
    text: str


def lens_words(camera: Camera) -> LensWords:
    """Describe the distortion of a camera.

    Along the way from the principal point to each outer corner of the image, what is seen at a distance r from the principal
    point would be at a distance r' without the lens: r < r' is a barrel, r > r' a pincushion, some of both a moustache.
    """
    width, height = camera.size
    corners = np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5], [-0.5, height - 0.5]])
    centre = camera.K[:2, 2]
    shares = np.linspace(0, 1, _STEPS + 1)[1:]
    seen = centre + shares[:, None, None] * (corners - centre)
    moved = _radial_shift(camera, seen, centre)
    valid = np.isfinite(moved)
    last = np.where(valid.any(axis=0), _STEPS - 1 - valid[::-1].argmax(axis=0), 0)
    at_end = np.nan_to_num(moved[last, np.arange(4)])
    corner = int(np.abs(at_end).argmax())
    shift = float(at_end[corner])
    reach = float(shares[last[corner]] * np.linalg.norm(corners[corner] - centre))
    whole = bool((last == _STEPS - 1).all())
    kind = _kind(moved[:, corner])
    return LensWords(kind, shift, f"{kind}: {_sentence(kind, shift, reach, whole)}")


def _radial_shift(camera: Camera, pixels: FloatArray, centre: FloatArray) -> FloatArray:
    """Distance from the principal point as seen, less the distance without the lens: pixels; NaN without a ray."""
    ideal = camera.pixels_from_normalised(camera.unproject(pixels)[..., :2])
    shift: FloatArray = np.linalg.norm(pixels - centre, axis=-1) - np.linalg.norm(ideal - centre, axis=-1)
    return shift


def _kind(shift_px: FloatArray) -> str:
    """Name the distortion along one way outwards."""
    shift = shift_px[np.isfinite(shift_px)]
    inwards, outwards = bool((shift < -_NOTHING_PX).any()), bool((shift > _NOTHING_PX).any())
    if inwards and outwards:
        return "moustache"
    if inwards or outwards:
        return "barrel" if inwards else "pincushion"
    return "next to none"


def _sentence(kind: str, shift: float, reach: float, whole: bool) -> str:
    """Say what is seen where."""
    last = f"{reach:.0f} px from the principal point, the last valid place on the way to a corner,"
    where = "at the image's corners" if whole else last
    if kind == "next to none":
        return f"{where} points are seen within {rounded(max(abs(shift), 0.01))} px of where a lens without distortion has them"
    way = "inwards" if shift < 0 else "outwards"
    bows = {
        "barrel": "straight lines bow outwards",
        "pincushion": "straight lines bow inwards",
        "moustache": "straight lines bow one way near the middle and the other way farther out",
    }[kind]
    ideal = reach - shift
    share = f", {rounded(100 * abs(shift) / ideal)} % of its distance from the middle" if ideal > 0 else ""
    return f"{bows}; {where} a point is moved {rounded(abs(shift))} px {way}{share}"
