"""Reads squares as tags of every family, either border, mirrored or inverted: what an AprilGrid is that was not found."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from camcal.boards.aprilgrid import BORDER_BITS, FAMILIES, tag_ink
from camcal.detection.sampling import Gray, reduced, sample
from camcal.detection.tags import Tags, find_squares
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray

# Longer side of the image that is read; smaller ones are enlarged up to another size.
_SEARCH_PX = 1600
_ENLARGED_TO_PX = 640
_MOST_ENLARGED = 4.0
# Tags are the larger ones of the squares in an image.
_MOST_SQUARES = 400
_MOST_IDS = 600

# Correlation of a tag's data cells with its code. Other squares pass for a tag of the smallest family once or twice an image.
_LEAST_LIKENESS = 0.9
_LEAST_CONTRAST = 3.0
# Standard deviation of what is in a square over the contrast of the image: squares of checkerboards stay below .07, tags and
# markers have .17 and more.
_PLAIN_SPREAD = 0.1
_INNER_CELLS = 6
_FEWEST_TAGS = 4


@dataclass(frozen=True, slots=True)
class Print:
    """One way in which tags may be printed and photographed."""

    family: str
    border_bits: int
    mirrored: bool = False
    inverted: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """What the squares in an image say.

    Attributes
    ----------
    printed : Print or None
        How the tags are printed; None if hardly any of the squares is a tag.
    tags : Tags
        The tags, with corners BL, BR, TR, TL in full-size pixels.
    plain : int
        How many other squares have nothing in them, as those of a checkerboard.
    marked_px : ndarray of shape (Q,)
        Typical side of each square that has something in it, tag or not, in full-size pixels.
    """

    printed: Print | None
    tags: Tags
    plain: int
    marked_px: FloatArray


def read_tags(gray: Gray) -> Reading:
    """Find out which tags an image shows, if it shows any: at least four different ones, printed alike.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    """
    enlarge = min(max(_ENLARGED_TO_PX / max(gray.shape), 1.0), _MOST_ENLARGED)
    search = reduced(gray, _SEARCH_PX, enlarge)
    squares = _largest(find_squares(search.gray))
    marked = _marked(search.gray, squares)
    printed, tags = _commonest(search.gray, squares)
    if printed is None:
        inverted: Gray = np.bitwise_not(search.gray)
        printed, tags = _commonest(inverted, _largest(find_squares(inverted)))
        printed = replace(printed, inverted=True) if printed else None
    full = replace(tags, corners_px=search.to_full(tags.corners_px))
    sides = np.sqrt(_areas(search.to_full(squares[marked])))
    return Reading(printed, full, int((~marked).sum()), sides)


def _marked(gray: Gray, squares: FloatArray) -> BoolArray:
    """Which of the squares (Q, 4, 2) have something in them."""
    low, high = np.percentile(gray[::4, ::4], (1, 99))
    spread = _cells(gray, squares, _INNER_CELLS, 1).std(axis=(1, 2))
    marked: BoolArray = spread > _PLAIN_SPREAD * (high - low)
    return marked


def _commonest(gray: Gray, squares: FloatArray) -> tuple[Print | None, Tags]:
    """The print as which most of the squares (Q, 4, 2) can be read."""
    best: tuple[Print | None, Tags] = (None, Tags.none())
    strongest = 0.0
    if len(squares) < _FEWEST_TAGS:
        return best
    for family, border_bits, mirrored in product(FAMILIES, BORDER_BITS, (False, True)):
        # Upright corners are BL, BR, TR, TL, clockwise ones from anywhere; counter-clockwise ones read the mirror image.
        turned = squares[:, ::-1] if mirrored else squares
        ids, likeness, corners = _read(gray, turned, family, border_bits)
        good = likeness >= _LEAST_LIKENESS
        strength = float(sum(likeness[good & (ids == one)].max() for one in np.unique(ids[good])))
        if np.unique(ids[good]).size >= _FEWEST_TAGS and strength > strongest:
            strongest = strength
            best = Print(family, border_bits, mirrored), Tags(ids[good], corners[good])
    return best


def _read(gray: Gray, squares: FloatArray, family: str, border_bits: int) -> tuple[IntArray, FloatArray, FloatArray]:
    """Most similar tag of each square (Q, 4, 2): ids (Q,), likeness (Q,), corners BL, BR, TR, TL (Q, 4, 2)."""
    bits = FAMILIES[family][0]
    cells = _cells(gray, squares, bits, border_bits)
    seen = cells.mean(axis=(1, 2), keepdims=True) - cells
    turns = np.stack([np.rot90(seen, quarter, axes=(1, 2)) for quarter in range(4)], axis=1).reshape(len(seen), 4, -1)
    norms = np.linalg.norm(turns, axis=2, keepdims=True)
    with np.errstate(invalid="ignore"):
        turns = np.where(norms > _LEAST_CONTRAST * bits, turns / norms, 0.0)
    likeness = turns @ _codes(family).T
    best = likeness.reshape(len(seen), -1).argmax(axis=1)
    quarter, ids = np.divmod(best, likeness.shape[2])
    # A quarter turn of the cells against the clock brings the next corner clockwise to the top left.
    order = (quarter[:, None] + np.array([3, 2, 1, 0])) % 4
    return ids, likeness.reshape(len(seen), -1).max(axis=1), np.take_along_axis(squares, order[..., None], axis=1)


def _cells(gray: Gray, squares: FloatArray, bits: int, border_bits: int) -> FloatArray:
    """Grey values (Q, bits, bits) of the data cells of squares (Q, 4, 2) with corners TL, TR, BR, BL; NaN outside the image.

    Unit square to quadrangle: Heckbert 1989, "Fundamentals of Texture Mapping and Image Warping", section 2.2.3.
    """
    top_left, top_right, bottom_right, bottom_left = np.moveaxis(squares, 1, 0)
    right, bottom = top_right - bottom_right, bottom_left - bottom_right
    skew = top_left - top_right + bottom_right - bottom_left
    places = (border_bits + np.arange(bits) + 0.5) / (bits + 2 * border_bits)
    y, x = (axis.ravel()[:, None] for axis in np.meshgrid(places, places, indexing="ij"))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        g, h = (_cross(*pair)[:, None] / _cross(right, bottom)[:, None] for pair in ((skew, bottom), (right, skew)))
        along, down = top_right - top_left + g * top_right, bottom_left - top_left + h * bottom_left
        above = x * along[:, None] + y * down[:, None] + top_left[:, None]
        points = above / (1 + x * g[:, None] + y * h[:, None])
    return sample(gray, points).astype(np.float64).reshape(-1, bits, bits)


@lru_cache(maxsize=len(FAMILIES))
def _codes(family: str) -> FloatArray:
    """Darkness of a family's data cells, shape (T, bits²): of mean 0 and length 1, so that a product is a correlation."""
    ink = tag_ink(family, min(FAMILIES[family][1], _MOST_IDS), 1)[:, 1:-1, 1:-1]
    code = ink.reshape(len(ink), -1)
    code = code - code.mean(axis=1, keepdims=True)
    unit: FloatArray = code / np.linalg.norm(code, axis=1, keepdims=True)
    unit.flags.writeable = False
    return unit


def _largest(squares: FloatArray) -> FloatArray:
    return squares[np.argsort(-_areas(squares), kind="stable")[:_MOST_SQUARES]]


def _areas(squares: FloatArray) -> FloatArray:
    """Areas (Q,) of convex quadrangles (Q, 4, 2)."""
    area: FloatArray = np.abs(_cross(squares[:, 2] - squares[:, 0], squares[:, 3] - squares[:, 1])) / 2
    return area


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Component along z of the cross product of vectors (..., 2)."""
    value: FloatArray = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return value
