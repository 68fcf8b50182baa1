"""Boards that are not found because another one is asked for or the image is mirrored: the reason says so."""

from __future__ import annotations

import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_images import pose_of, shoot
from capture_scenes import GRID
from scenes import BOARD
from unfound_boards import FAMILIES, TRANSFORMS, reason, scaled, views_of

from camcal.boards.checkerboard import Checkerboard
from camcal.detection.detect import detect_board
from camcal.detection.picture import picture_fault
from camcal.detection.reading import read_tags
from camcal.observations import Detection
from camcal.threads import single_threaded


@pytest.mark.parametrize(("asked", "fitting"), [((10, 7), "9x6"), ((7, 10), "6x9")])
def test_squares_counted(asked, fitting):
    """10x7 squares are 9x6 inner corners: the reason gives the SPEC that fits, side included, however it is held."""
    for image, _ in views_of(BOARD):
        told = reason(image, Checkerboard(*asked, 0.025))
        assert "were squares counted instead of inner corners?" in told
        assert told.endswith(f"checkerboard:{fitting}:25mm")


@pytest.mark.parametrize("asked", [(8, 6), (9, 5), (7, 6), (9, 7), (11, 8)])
def test_other_size_is_named_with_its_spec(asked):
    """Smaller and larger boards than the one that is there: the SPEC that fits is the guess."""
    image, _ = views_of(BOARD)[0]
    told = reason(image, Checkerboard(*asked, 0.025))
    assert "9x6 inner corners" in told
    assert told.endswith("is it checkerboard:9x6:25mm?")


def test_part_that_is_seen_unclearly_is_no_guess():
    """A board whose last columns are hidden is asked about; a size is guessed only if all of the rest is clear."""
    image, truth = shoot(BOARD, pose_of(BOARD, turn_deg=0, tilt_deg=0, fill=0.6))
    image[:, int(truth.corners_px[5, 0]) :] = 128
    told = reason(image, BOARD)
    assert "is part of the board hidden or in glare" in told


@pytest.mark.parametrize("asked", FAMILIES)
@pytest.mark.parametrize("printed", FAMILIES)
@pytest.mark.parametrize("border", [1, 2])
def test_other_family_is_named(printed, border, asked):
    """Tags of any family for any other: both are named, and what to set, with the border where that differs too."""
    if printed == asked:
        return
    image, _ = shoot(replace(GRID, family=printed, border_bits=border), pose_of(GRID))
    told = reason(image, replace(GRID, family=asked))
    assert told.startswith(f"tags of {printed} were seen, {asked} was asked for: set family={printed}")
    assert told.endswith(" and border=1") is (border == 1)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("flip", ["mirrored", "upside down mirrored"])
def test_mirrored_image_is_named(flip, family):
    """Tags that can be read only in the mirror image: the image is mirrored, however the board is held."""
    board = replace(GRID, family=family)
    for image, _ in views_of(board):
        assert reason(TRANSFORMS[flip](image), board).startswith("the image is mirrored: ")


def test_mirrored_image_of_another_family():
    """Two causes at once are both told."""
    told = reason(TRANSFORMS["mirrored"](views_of(GRID)[0][0]), replace(GRID, family="tag36h10"))
    assert "tags of tag36h11 were seen, tag36h10 was asked for" in told
    assert "the image is mirrored" in told


@pytest.mark.parametrize("squares", [True, False])
def test_inverted_tags_are_named(squares):
    """White tags on black: said as such, with and without corner squares."""
    board = replace(GRID, squares=squares)
    for image, _ in views_of(board):
        assert reason(TRANSFORMS["inverted"](image), board).startswith("the tags are white on black: ")


def test_checkerboard_for_an_aprilgrid():
    """A checkerboard where tags are looked for: its inner corners are counted in the guess."""
    for image, _ in views_of(BOARD):
        assert reason(image, GRID).endswith("(checkerboard:9x6:SIDE)?")


@pytest.mark.parametrize(
    ("change", "options"), [({}, ""), ({"border_bits": 1}, ":border=1"), ({"family": "tag25h9"}, ":family=tag25h9")]
)
def test_aprilgrid_for_a_checkerboard(change, options):
    """Tags where a checkerboard is looked for: the guess has their family and border as a SPEC spells them."""
    image, _ = shoot(replace(GRID, **change), pose_of(GRID))
    assert reason(image, BOARD).endswith(f"(aprilgrid:COLUMNSxROWS:TAG:SPACING{options})?")


def test_other_markers_for_either_board():
    """Squares of an ArUco dictionary are no AprilTags and no checkerboard: a guess for both."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    image = np.full((480, 640), 220, np.uint8)
    for n in range(20):
        row, column = divmod(n, 5)
        image[40 + 100 * row :, 60 + 100 * column :][:70, :70] = cv2.aruco.generateImageMarker(dictionary, n, 70)
    assert "is it a ChArUco board, or a grid of markers?" in reason(image, BOARD)
    assert reason(image, GRID).endswith("or other markers?")


def test_tags_beyond_the_board_are_named():
    """A board of 2x2 asked for where only the tags 12 to 29 are seen: the ids say so."""
    image, truth = shoot(GRID, pose_of(GRID))
    for tag in range(12):
        cv2.fillConvexPoly(image, np.round(truth.corners_px[truth.ids // 4 == tag]).astype(np.int32), 90)
    told = reason(image, replace(GRID, columns=2, rows=2))
    assert "its tags are not on the board (ids 12 to 29, expected 0 to 3)" in told


@pytest.mark.parametrize("board", [BOARD, GRID], ids=["checkerboard", "aprilgrid"])
def test_turned_and_enlarged_images_are_fine(board):
    """A quarter turn and four times the size hide nothing: every corner that the original shows is found."""
    image, truth = views_of(board)[0]
    for changed in (TRANSFORMS["turned"](image), scaled(image, 4)):
        found = detect_board(changed, board, "view.png")
        assert isinstance(found, Detection)
        assert len(found) >= 0.95 * len(truth)


def test_causes_cost_little():
    """Looking for causes in a picture without a board adds less than half of what the search costs (0.25 s, CPU)."""
    rng = np.random.default_rng(1)
    street = cv2.GaussianBlur(rng.integers(0, 256, (800, 1280)).astype(np.uint8), (0, 0), 5)
    street = cv2.normalize(street, None, 0, 255, cv2.NORM_MINMAX)
    with single_threaded():
        start = time.thread_time()
        read_tags(street)
        picture_fault(street)
        causes = time.thread_time() - start
        start = time.thread_time()
        detect_board(street, BOARD, "street.png")
        whole = time.thread_time() - start
    assert causes < 0.5 * (whole - causes)
