"""Tags and squares counted in any picture: right where there are some, none where there are none."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_images import errors_px, pose_of, shoot
from capture_scenes import GRID
from scenes import BOARD
from unfound_boards import FAMILIES, scaled, views_of

from camcal.detection.detect import detect_board
from camcal.detection.reading import Print, read_tags
from camcal.detection.survey import survey
from camcal.observations import Detection


@pytest.mark.parametrize("printed", [Print(family, border) for family in FAMILIES for border in (1, 2)], ids=str)
def test_tags_are_read_with_their_corners(printed):
    """Every family and border is told from half of the tags at least, and corners BL, BR, TR, TL are true to a cell's width."""
    board = replace(GRID, family=printed.family, border_bits=printed.border_bits)
    for image, truth in views_of(board):
        reading = read_tags(image)
        assert reading.printed == printed
        assert len(reading.tags) >= 0.5 * board.tag_count
        corners = truth.corners_px.reshape(-1, 4, 2)[reading.tags.ids]
        cell = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1).min() / 10
        assert np.abs(reading.tags.corners_px - corners).max() < cell


def test_nothing_is_read_into_other_pictures():
    """Checkerboards, noise and blank images hold no tags; squares of a checkerboard have nothing in them."""
    for image, _ in views_of(BOARD):
        reading = read_tags(image)
        assert reading.printed is None
        assert reading.plain >= 20
        assert reading.marked_px.size <= 2
    noise = np.random.default_rng(3).integers(0, 256, (480, 640)).astype(np.uint8)
    for image in (noise, cv2.GaussianBlur(noise, (0, 0), 3), np.full((480, 640), 90, np.uint8), np.zeros((2, 3), np.uint8)):
        assert read_tags(image).printed is None


def test_blurred_tags_that_are_read_are_used():
    """Tags of 18 pixels with one-bit borders, which OpenCV does not decode, are used, each id at its own corner."""
    board = replace(GRID, border_bits=1)
    image, truth = shoot(board, pose_of(board, fill=0.6))
    found = detect_board(scaled(image, 0.4), board, "view.png")
    assert isinstance(found, Detection)
    halved = replace(truth, corners_px=(truth.corners_px + 0.5) * 0.4 - 0.5)
    assert np.abs(errors_px(found, halved)).max() < 1


def test_survey_sees_small_boards():
    """A board with squares of 4 pixels in an image of 80x60 is counted right."""
    image, _ = shoot(BOARD, pose_of(BOARD, tilt_deg=0, turn_deg=0, fill=0.45))
    seen = survey(scaled(image, 1 / 8))
    assert seen.sides == (6, 9)
    assert seen.size((9, 6)) == (9, 6)
    assert seen.size((6, 9)) == (6, 9)
