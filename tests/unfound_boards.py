"""Pictures in which a board is not found, spoilt in every way, and the reason that is told."""

from __future__ import annotations

import re

import cv2
import numpy as np
from board_images import pose_of, shoot

from camcal.detection.detect import detect_board
from camcal.observations import Rejected
from camcal.threads import single_threaded

FAMILIES = ("tag36h11", "tag36h10", "tag25h9", "tag16h5")
# Several ways to hold a board: tilt, turn, share of the image's width.
HELD = ((20, 0, 0.6), (35, 30, 0.5), (5, 90, 0.55), (25, 200, 0.45))
TRANSFORMS = {
    "mirrored": lambda gray: np.ascontiguousarray(gray[:, ::-1]),
    "upside down mirrored": lambda gray: np.ascontiguousarray(gray[::-1]),
    "turned": lambda gray: np.ascontiguousarray(np.rot90(gray)),
    "inverted": lambda gray: 255 - gray,
    "dark": lambda gray: (gray * 0.03).astype(np.uint8),
    "black": np.zeros_like,
    "overexposed": lambda gray: np.clip(gray * 8.0 + 60, 0, 255).astype(np.uint8),
    "faint": lambda gray: (100 + gray * 0.05).astype(np.uint8),
    "blurred": lambda gray: cv2.GaussianBlur(gray, (0, 0), 6),
    "shaken": lambda gray: cv2.blur(gray, (25, 1)),
}


def scaled(gray, factor: float):
    """The image at another size, averaged where it shrinks."""
    interpolation = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    return cv2.resize(gray, None, fx=factor, fy=factor, interpolation=interpolation)


def views_of(board):
    """A few rendered images of a board, each with its truth."""
    return [
        shoot(board, pose_of(board, tilt_deg=tilt, turn_deg=turn, fill=fill), seed=n)
        for n, (tilt, turn, fill) in enumerate(HELD)
    ]


def reason(image, board) -> str:
    """Why a board is rejected; one clause, with something to do or a guess after its finding."""
    with single_threaded():
        found = detect_board(image, board, "view.png")
    assert isinstance(found, Rejected)
    assert "\n" not in found.reason
    assert found.reason[0].islower()
    assert ": " in re.sub(r"\([^()]*\)", "", found.reason), found.reason
    return found.reason
