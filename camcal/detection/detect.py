"""Image in, detection or rejection out: the one table that joins a kind of board with its detector."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.detection.aprilgrid import detect_aprilgrid
from camcal.detection.checkerboard import detect_checkerboard
from camcal.detection.sampling import Gray, gray8
from camcal.observations import Detection, Image, Rejected

Detector = Callable[[Gray, Any, str], Detection | Rejected]

DETECTORS: dict[type, Detector] = {Checkerboard: detect_checkerboard, AprilGrid: detect_aprilgrid}
"""Detector by type of board: (8-bit gray image, board of that type, source) -> Detection or Rejected."""


def detect_board(image: Image, board: Board, source: str) -> Detection | Rejected:
    """Find a board's features in an image.

    Parameters
    ----------
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float; 1, 3 (BGR) or 4 (BGRA) channels. 16-bit and float images are stretched to their own range.
    board : Board
        Of a type in `DETECTORS`.
    source : str
        Name of the image.

    Returns
    -------
    Detection or Rejected
        Every view ends as one of them; a rejection carries a reason that a person can act on. The result depends on the
        image and the board alone. Safe to call from several threads, with OpenCV's own threads set to one.

    Raises
    ------
    ValueError
        If the array is no image of these kinds.
    TypeError
        If there is no detector for the type of board.
    """
    detector = DETECTORS.get(type(board))
    if detector is None:
        known = ", ".join(kind.__name__ for kind in DETECTORS)
        raise TypeError(f"board: no detector for it (got {type(board).__name__}, expected one of {known})")
    return detector(gray8(image), board, source)
