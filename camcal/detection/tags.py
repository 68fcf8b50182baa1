"""Single AprilTags: OpenCV's detector held to the board's tags, and a look-up of a tag where one is expected."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from camcal.boards.aprilgrid import FAMILIES, tag_ink
from camcal.detection.sampling import Gray, sample
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.geometry.homography import apply_homography, homography_from_points

TAG_CORNERS = np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]])
"""Corners BL, BR, TR, TL of an upright tag in tag sides, x right and y down from its top left."""

# Windows of the adaptive threshold in pixels: the smallest parts tags from the corner squares that touch them, the widest
# fills large tags.
_THRESHOLD_WINDOWS = (3, 33, 15)
# Perimeter over the longer side of the image. Fine textures are thousands of squares, whose number costs time squared.
_LEAST_PERIMETER = 0.05
_PROBE_CELL_PX = 10
_SAMPLES_PER_CELL = (0.3, 0.5, 0.7)


@dataclass(frozen=True, slots=True, eq=False)
class Tags:
    """Tags seen in an image, the same id possibly more than once.

    Attributes
    ----------
    ids : ndarray of shape (T,)
        Tag ids, int64.
    corners_px : ndarray of shape (T, 4, 2)
        Corners BL, BR, TR, TL as printed upright, most of them a pixel or two off.
    others : int
        How many other quadrangles were looked at and are no tags.
    """

    ids: IntArray
    corners_px: FloatArray
    others: int = 0

    @classmethod
    def none(cls, others: int = 0) -> Tags:
        """Build the result of an image without tags."""
        return cls(np.zeros(0, dtype=np.int64), np.zeros((0, 4, 2)), others)

    def __len__(self) -> int:
        """Return the number of tags."""
        return int(self.ids.size)

    def chosen(self, which: BoolArray) -> Tags:
        """Some of the tags, by a mask of shape (T,)."""
        return Tags(self.ids[which], self.corners_px[which])


def find_tags(gray: Gray, family: str, border_bits: int, count: int) -> Tags:
    """Find a family's first `count` tags.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    family : str
        One of `FAMILIES`.
    border_bits : int
        Width of the black border in bits.
    count : int
        How many ids, from 0 on, are looked for; the detector's time and its mistakes grow with them.
    """
    corners, ids, others = _detector(family, border_bits, count).detectMarkers(gray)
    if len(corners) == 0:
        return Tags.none(len(others))
    order = _corner_order(family)
    ordered = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 2)[:, order]
    return Tags(np.asarray(ids, dtype=np.int64).ravel(), ordered, len(others))


def find_squares(gray: Gray) -> FloatArray:
    """Every dark quadrangle that might be a tag, whatever is in it, but for small ones.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.

    Returns
    -------
    ndarray of shape (Q, 4, 2)
        Corners in pixels, clockwise from any of them.
    """
    detector = _detector("tag16h5", 1, 1)
    parameters = detector.getDetectorParameters()
    parameters.minMarkerPerimeterRate = _LEAST_PERIMETER
    detector.setDetectorParameters(parameters)
    tags, _, others = detector.detectMarkers(gray)
    squares = np.asarray([*tags, *others], dtype=np.float64).reshape(-1, 4, 2)
    diagonals = squares[:, 2:] - squares[:, :2]
    clockwise = diagonals[:, 0, 0] * diagonals[:, 1, 1] > diagonals[:, 0, 1] * diagonals[:, 1, 0]
    ordered: FloatArray = np.where(clockwise[:, None, None], squares, squares[:, ::-1])
    return ordered


def _detector(family: str, border_bits: int, count: int) -> cv2.aruco.ArucoDetector:
    """Build a detector; each call has its own, because threads must not share one."""
    full = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_APRILTAG_{family.removeprefix('tag')}"))
    dictionary = cv2.aruco.Dictionary(full.bytesList[:count], full.markerSize, full.maxCorrectionBits)
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = border_bits
    smallest, largest, step = _THRESHOLD_WINDOWS
    parameters.adaptiveThreshWinSizeMin = smallest
    parameters.adaptiveThreshWinSizeMax = largest
    parameters.adaptiveThreshWinSizeStep = step
    return cv2.aruco.ArucoDetector(dictionary, parameters)


@lru_cache(maxsize=len(FAMILIES))
def _corner_order(family: str) -> IntArray:
    """Which of the detector's four corners is BL, BR, TR, TL: learnt from an upright tag, as it differs between versions."""
    tag = tag_ink(family, 1, 1)[0]
    cells = tag.shape[0]
    image = np.kron(1 - np.pad(tag, 2), np.ones((_PROBE_CELL_PX, _PROBE_CELL_PX))) * 255
    corners, _, _ = _detector(family, 1, 1).detectMarkers(image.astype(np.uint8))
    if len(corners) != 1:
        raise RuntimeError(f"OpenCV {cv2.__version__} does not detect its own {family} tag")
    found = np.asarray(corners[0], dtype=np.float64).reshape(4, 2)
    truth = (2 + TAG_CORNERS * cells) * _PROBE_CELL_PX - 0.5
    order: IntArray = np.linalg.norm(truth[:, None] - found[None], axis=2).argmin(axis=1)
    return order


def tag_likeness(gray: Gray, ink: FloatArray, corners_px: FloatArray, border_bits: int) -> float:
    """How much the image at a place looks like a given tag.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    ink : ndarray of shape (n, n)
        Cells of the tag, border included: 1 black, 0 white.
    corners_px : ndarray of shape (4, 2)
        Where its corners BL, BR, TR, TL should be.
    border_bits : int
        Width of the black border in bits.

    Returns
    -------
    float
        Correlation, -1..1, between the darkness of the data cells and their ink; -1 if the tag is not all in the image or
        the place has no contrast. Another tag of the family stays below 1 - 2 d / bits, d its Hamming distance.
    """
    H = homography_from_points(TAG_CORNERS, corners_px)
    if not np.isfinite(H).all():
        return -1.0
    n = ink.shape[0]
    data = slice(border_bits, n - border_bits)
    places = ((np.arange(n)[:, None] + np.array(_SAMPLES_PER_CELL)) / n)[data].ravel()
    y, x = np.meshgrid(places, places, indexing="ij")
    values = sample(gray, apply_homography(H, np.stack([x, y], axis=-1)))
    if not np.isfinite(values).all():
        return -1.0
    size, per_cell = n - 2 * border_bits, len(_SAMPLES_PER_CELL)
    cells = values.reshape(size, per_cell, size, per_cell).mean(axis=(1, 3), dtype=np.float64)
    seen, expected = cells.mean() - cells, ink[data, data] - ink[data, data].mean()
    norm = float(np.sqrt((seen**2).sum() * (expected**2).sum()))
    return float((seen * expected).sum() / norm) if norm > 0 else -1.0
