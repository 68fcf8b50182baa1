"""AprilGrids: every corner under its own id, whatever part of the board is seen, and wrong tags told apart."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_images import CAMERA, errors_px, pose_of, shoot

from camcal.boards.aprilgrid import AprilGrid
from camcal.detection.detect import detect_board
from camcal.detection.layout import fitting_tags
from camcal.detection.tags import TAG_CORNERS, Tags, find_tags
from camcal.geometry.camera import Camera
from camcal.geometry.homography import apply_homography, homography_from_points
from camcal.observations import Detection, Rejected

KALIBR = AprilGrid(6, 5, tag_m=0.03, gap_m=0.009)
# Gaps of 13 px leave half-windows of 6 px: half of the 11 px that reach .02-.024 px, so at least twice the error.
VGA_RMS_PX = 0.06
MIXED_UP_PX = 0.5
# Code of tag36h11 id 0 as the AprilTag library's first C and Java versions list it: rows from the top, 1 is white.
OFFICIAL_TAG_0 = 0xD5D628584


def found_on(image, board) -> Detection:
    """Detect and insist on a detection."""
    found = detect_board(image, board, "view.png")
    assert isinstance(found, Detection), found
    return found


def ids_and_order_are_right(found, truth) -> bool:
    """Whether every id that was found stands at its own corner (neighbouring corners are 20 and more pixels apart)."""
    return bool(np.abs(errors_px(found, truth)).max() < MIXED_UP_PX)


@pytest.mark.parametrize("turn_deg", [0, 90, 180, 270, 30])
@pytest.mark.parametrize("first", ["bottom-left", "top-left"])
def test_ids_and_corner_order(first, turn_deg):
    """Every corner BL, BR, TR, TL of every tag stands under its own id, for both first tags and every way to hold the board."""
    board = replace(KALIBR, first=first)
    image, truth = shoot(board, pose_of(board, turn_deg=turn_deg, fill=0.6))
    found = found_on(image, board)
    assert found.ids.tolist() == truth.ids.tolist()
    assert np.sqrt((errors_px(found, truth) ** 2).mean()) < VGA_RMS_PX


@pytest.mark.parametrize("family", ["tag36h11", "tag36h10", "tag25h9", "tag16h5"])
@pytest.mark.parametrize("border_bits", [1, 2])
def test_families_and_borders(family, border_bits):
    """Every family of OpenCV is read with both border widths."""
    board = AprilGrid(4, 3, tag_m=0.03, gap_m=0.009, family=family, border_bits=border_bits)
    image, truth = shoot(board, pose_of(board))
    found = found_on(image, board)
    assert len(found) >= 0.95 * len(truth)
    assert ids_and_order_are_right(found, truth)
    assert not found.notes


@pytest.mark.parametrize(("printed", "asked"), [(1, 2), (2, 1)])
def test_other_border_is_used_and_noted(printed, asked):
    """Tags with the other border width are found, and a note says which border fits."""
    board = replace(KALIBR, border_bits=printed)
    image, truth = shoot(board, pose_of(board))
    found = found_on(image, replace(board, border_bits=asked))
    assert ids_and_order_are_right(found, truth)
    assert f"{printed}-bit border" in found.notes[0]
    assert f"border={printed}" in found.notes[0]


def test_official_tag_is_read_upright():
    """An official tag, drawn from its published code, has its corners BL, BR, TR, TL where they are."""
    bits = np.array([int(bit) for bit in f"{OFFICIAL_TAG_0:036b}"]).reshape(6, 6)
    bordered = np.pad(np.pad(bits, 1), 2, constant_values=1)
    image = np.kron(bordered, np.ones((12, 12))).astype(np.uint8) * 255
    tags = find_tags(image, "tag36h11", 1, 587)
    assert tags.ids.tolist() == [0]
    assert tags.corners_px[0] == pytest.approx((2 + TAG_CORNERS * 8) * 12 - 0.5, abs=1.5)


def test_board_without_squares():
    """Without corner squares the tags' own corners are used: five times less precise, but in place."""
    board = replace(KALIBR, squares=False)
    image, truth = shoot(board, pose_of(board))
    found = found_on(image, board)
    assert found.ids.size >= 0.95 * truth.ids.size
    assert np.sqrt((errors_px(found, truth) ** 2).mean()) < 0.3


def test_corner_accuracy():
    """With 88 px tags and corner squares, blur .7 and noise 2: as good as checkerboards (.02 px per axis)."""
    camera = Camera((1280, 960), [[900, 0, 645.3], [0, 905, 470.2], [0, 0, 1]], [-0.25, 0.08])
    image, truth = shoot(KALIBR, pose_of(KALIBR, camera=camera), camera=camera)
    found = found_on(image, KALIBR)
    assert len(found) >= 0.95 * len(truth)
    assert np.sqrt((errors_px(found, truth) ** 2).mean()) < 0.02


@pytest.mark.parametrize("shift", [(0.4, 0.0), (-0.4, 0.2), (0.0, 0.4), (0.25, -0.3)])
def test_partial_boards(shift):
    """Boards that leave the frame are used as far as they are seen, with nothing outside the image and no id mixed up."""
    pose = pose_of(KALIBR, shift=shift, fill=0.7, turn_deg=20)
    image, truth = shoot(KALIBR, pose)
    assert len(truth) < KALIBR.feature_count
    found = found_on(image, KALIBR)
    assert set(found.ids.tolist()) <= set(truth.ids.tolist())
    assert ids_and_order_are_right(found, truth)


def test_strong_barrel_over_the_whole_image():
    """Under strong barrel no single homography fits the board; the local ones find every tag that is all in the image."""
    camera = Camera((1280, 960), [[560, 0, 650], [0, 561, 499], [0, 0, 1]], [-0.24, 0.07, 0, 0, -0.009])
    board = AprilGrid(8, 6, tag_m=0.03, gap_m=0.009)
    image, truth = shoot(board, pose_of(board, fill=1.1, tilt_deg=35, camera=camera), camera=camera)
    found = found_on(image, board)
    whole = np.bincount(truth.ids // 4, minlength=48) == 4
    assert np.unique(found.ids // 4).size >= 0.95 * whole.sum()
    assert ids_and_order_are_right(found, truth)


def test_transposed_board_is_rejected_with_the_guess():
    """A 6x5 board asked for as 5x6 is wrong, and the reason says what fits."""
    image, _ = shoot(KALIBR, pose_of(KALIBR))
    found = detect_board(image, replace(KALIBR, columns=5, rows=6), "view.png")
    assert isinstance(found, Rejected)
    assert "the tags fit an AprilGrid of 6x5" in found.reason
    assert "5x6" in found.reason


@pytest.mark.parametrize("first", ["bottom-left", "top-left"])
def test_other_first_tag_is_rejected_with_the_guess(first):
    """The wrong end for tag 0 is wrong even on a square board, where only the tags' own direction tells."""
    board = replace(KALIBR, rows=6, first=first)
    other = "top-left" if first == "bottom-left" else "bottom-left"
    image, _ = shoot(board, pose_of(board))
    found = detect_board(image, replace(board, first=other), "view.png")
    assert isinstance(found, Rejected)
    assert f"the tags fit an AprilGrid with the first tag at the {first}" in found.reason


def test_other_number_of_columns_is_rejected_with_the_guess():
    """A 6x5 board asked for as 7x5: the tags tell how many columns there are."""
    image, _ = shoot(KALIBR, pose_of(KALIBR))
    found = detect_board(image, replace(KALIBR, columns=7), "view.png")
    assert isinstance(found, Rejected)
    assert "the tags fit an AprilGrid with 6 columns" in found.reason


def test_wrong_family_is_named():
    """Tags of another family: the reason names both."""
    image, _ = shoot(KALIBR, pose_of(KALIBR))
    found = detect_board(image, replace(KALIBR, family="tag36h10"), "view.png")
    assert isinstance(found, Rejected)
    assert "tags of tag36h11 were seen, tag36h10 was asked for" in found.reason


def copied_tag(image, truth, source: int, target: int):
    """Paste the picture of one tag over another one."""
    corners = {i: truth.corners_px[np.isin(truth.ids, 4 * i + np.arange(4))] for i in (source, target)}
    H = homography_from_points(corners[source], corners[target])
    height, width = image.shape
    warped = cv2.warpPerspective(image, H, (width, height))
    mask = np.zeros_like(image)
    cv2.fillConvexPoly(mask, np.round(corners[target]).astype(np.int32), 1)
    return np.where(mask == 1, warped, image)


def test_duplicate_tag_is_sorted_out_by_geometry():
    """A second tag 3 in the place of tag 17: the true tag 3 stays, tag 17 is not there, the others are all right."""
    image, truth = shoot(KALIBR, pose_of(KALIBR))
    found = found_on(copied_tag(image, truth, 3, 17), KALIBR)
    assert ids_and_order_are_right(found, truth)
    assert 17 not in found.ids // 4
    assert 3 in found.ids // 4


def test_tag_in_the_wrong_place_is_left_out():
    """Tag 3 stands only where tag 17 should be: it gets no corners at all."""
    image, truth = shoot(KALIBR, pose_of(KALIBR))
    moved = copied_tag(image, truth, 3, 17)
    cv2.fillConvexPoly(moved, np.round(truth.corners_px[truth.ids // 4 == 3]).astype(np.int32), 90)
    found = found_on(moved, KALIBR)
    assert ids_and_order_are_right(found, truth)
    assert not {3, 17} & set((found.ids // 4).tolist())


def test_tags_beyond_the_board_are_ignored():
    """A board of 6x3 asked for, 6x5 seen: the ids that both have are used, the others ignored."""
    image, truth = shoot(KALIBR, pose_of(KALIBR))
    found = found_on(image, replace(KALIBR, rows=3))
    assert found.ids.max() < 72
    assert ids_and_order_are_right(found, truth)


def test_few_tags():
    """Four tags are enough for a view, two are not, and the reason counts them."""
    image, truth = shoot(KALIBR, pose_of(KALIBR))
    for keep, used in (((13, 14, 19, 20), True), ((13, 14), False)):
        covered = image.copy()
        for tag in set(range(30)) - set(keep):
            cv2.fillConvexPoly(covered, np.round(truth.corners_px[truth.ids // 4 == tag]).astype(np.int32), 90)
        found = detect_board(covered, KALIBR, "view.png")
        assert isinstance(found, Detection) is used
        if isinstance(found, Detection):
            assert set((found.ids // 4).tolist()) == set(keep)
        else:
            assert "too few tags of the board were found (got 2)" in found.reason


def test_mirrored_board_is_no_board():
    """A mirror image must not be read: its handedness is wrong."""
    image, _ = shoot(KALIBR, pose_of(KALIBR))
    assert isinstance(detect_board(np.ascontiguousarray(image[:, ::-1]), KALIBR, "view.png"), Rejected)


def test_checkerboard_in_the_place_of_tags():
    """Thousands of squares but no tag: rejected at once, with a guess."""
    row, column = np.indices((1200, 1600)) // 13
    image = ((row + column) % 2 * 200 + 20).astype(np.uint8)
    found = detect_board(image, KALIBR, "view.png")
    assert isinstance(found, Rejected)
    assert "is it another kind of board?" in found.reason


def test_fitting_tags_drops_the_farther_of_two_with_one_id():
    """Of two tags with one id the one that the others agree with fits."""
    H = np.array([[900.0, 20, 60], [-30, 880, 70], [0.1, 0.2, 1]])
    corners = apply_homography(H, KALIBR.object_points[:, :2]).reshape(-1, 4, 2)
    ids = np.array([0, 1, 2, 7, 8, 2])
    seen = np.concatenate([corners[ids[:-1]], corners[20:21]])
    assert fitting_tags(Tags(ids, seen), KALIBR).tolist() == [True, True, True, True, True, False]


def test_the_camera_of_these_tests_distorts():
    """The tests above run with lens distortion; without it a single homography would do."""
    assert CAMERA.dist[0] != 0
