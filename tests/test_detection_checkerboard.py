"""Checkerboards: found, read the way they are printed, and never mistaken for boards of another size."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from board_images import CAMERA, errors_px, pose_of, shoot

from camcal.boards.checkerboard import Checkerboard
from camcal.detection.detect import detect_board
from camcal.geometry.camera import Camera
from camcal.observations import Detection, Rejected

# Per axis, blur .7 px, noise 2 of 180 levels: cornerSubPix with a window of 11 px reaches .020 px without smoothing.
RMS_PX = 0.020


def handedness(found: Detection, board: Checkerboard) -> float:
    """Positive where x right and y down as printed turn clockwise in the image, as seen from the front."""
    grid = np.full((board.feature_count, 2), np.nan)
    grid[found.ids] = found.corners_px
    grid = grid.reshape(board.rows, board.columns, 2)
    along, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    return float(along[0] * down[1] - along[1] * down[0])


@pytest.mark.parametrize("turn_deg", [0, 90, 180, 270, 37])
@pytest.mark.parametrize("size", [(9, 6), (6, 9), (4, 3)])
def test_odd_by_even_board_has_one_reading(size, turn_deg):
    """A board of odd x even corners is read the same way however it is held: every id at its own corner."""
    board = Checkerboard(*size, 0.025)
    image, truth = shoot(board, pose_of(board, turn_deg=turn_deg, fill=0.5))
    found = detect_board(image, board, "view.png")
    assert isinstance(found, Detection)
    assert found.ids.tolist() == truth.ids.tolist()
    assert np.sqrt((errors_px(found, truth) ** 2).mean()) < RMS_PX


@pytest.mark.parametrize("turn_deg", [0, 90, 180, 270])
@pytest.mark.parametrize("size", [(8, 6), (7, 5), (6, 6), (5, 5), (3, 3)])
def test_symmetric_board_is_read_up_to_its_symmetry(size, turn_deg):
    """A board that looks the same when turned is read in one of its own turns, never mirrored or by a quarter too many."""
    board = Checkerboard(*size, 0.025)
    image, truth = shoot(board, pose_of(board, turn_deg=turn_deg, fill=0.45))
    found = detect_board(image, board, "view.png")
    assert isinstance(found, Detection)
    assert handedness(found, board) > 0
    readings = [np.arange(board.feature_count), *(turn.ids for turn in board.symmetries)]
    differences = [np.abs(found.corners_px - truth.corners_px[ids][found.ids]).max() for ids in readings]
    assert min(differences) < 0.1


def test_inverted_print_is_read_unmirrored():
    """Black and white swapped on a 9x6 board: the corner that has black up-left is the other one, handedness stays."""
    board = Checkerboard(9, 6, 0.025)
    image, truth = shoot(board, pose_of(board, turn_deg=10, fill=0.7))
    inside = np.zeros(image.shape, np.uint8)
    outer = CAMERA.project(pose_of(board, turn_deg=10, fill=0.7).apply(board.object_points[[0, 8, 53, 45]]))
    grown = outer + 1.0 * (outer - outer.mean(axis=0))
    cv2.fillConvexPoly(inside, grown.astype(np.int32), 1)
    inverted = np.where(inside == 1, 255 - image, 220).astype(np.uint8)
    found = detect_board(inverted, board, "view.png")
    assert isinstance(found, Detection)
    assert handedness(found, board) > 0
    assert np.abs(found.corners_px - truth.corners_px[::-1]).max() < 0.5


def test_rows_and_columns_swapped_are_the_same_board():
    """A 9x6 board asked for as 6x9 is found, with a right-handed reading."""
    board, swapped = Checkerboard(9, 6, 0.025), Checkerboard(6, 9, 0.025)
    image, _ = shoot(board, pose_of(board))
    found = detect_board(image, swapped, "view.png")
    assert isinstance(found, Detection)
    assert len(found) == 54
    assert handedness(found, swapped) > 0


def test_strong_barrel_and_tilt():
    """A wide lens (k1 = -.3) and 50° of tilt neither hide the board nor spoil its corners."""
    camera = Camera((1280, 960), [[560, 0, 650], [0, 561, 499], [0, 0, 1]], [-0.24, 0.07, 0, 0, -0.009])
    board = Checkerboard(9, 6, 0.025)
    image, truth = shoot(board, pose_of(board, fill=0.5, tilt_deg=50, camera=camera), camera=camera)
    found = detect_board(image, board, "view.png")
    assert isinstance(found, Detection)
    assert np.sqrt((errors_px(found, truth) ** 2).mean()) < RMS_PX


def test_large_image_is_searched_small_and_refined_at_full_size():
    """On 12 MP the corners are as good as on small images: the search at a fifth of the size does not show."""
    camera = Camera((4000, 3000), [[3200, 0, 2010], [0, 3205, 1490], [0, 0, 1]], [-0.1])
    board = Checkerboard(9, 6, 0.025)
    image, truth = shoot(board, pose_of(board, turn_deg=15, camera=camera), camera=camera)
    found = detect_board(image, board, "view.png")
    assert isinstance(found, Detection)
    assert np.sqrt((errors_px(found, truth) ** 2).mean()) < RMS_PX


@pytest.mark.parametrize("asked", [(10, 7), (7, 10)])
def test_squares_counted_instead_of_corners(asked):
    """A 9x6 board has 10x7 squares; asking for those says which size was seen and what went wrong."""
    board = Checkerboard(9, 6, 0.025)
    image, _ = shoot(board, pose_of(board))
    found = detect_board(image, Checkerboard(*asked, 0.025), "view.png")
    assert isinstance(found, Rejected)
    seen = "x".join(str(n - 1) for n in asked)
    assert f"a board of {seen} inner corners was seen, {asked[0]}x{asked[1]} was asked for" in found.reason
    assert "squares counted" in found.reason


@pytest.mark.parametrize("asked", [(5, 4), (8, 5), (9, 5), (3, 3)])
def test_part_of_a_larger_board_is_no_board(asked):
    """A finder that is content with a part of the board (5x4 of 9x6, say) is overruled, and the true size named."""
    board = Checkerboard(9, 6, 0.025)
    image, _ = shoot(board, pose_of(board))
    found = detect_board(image, Checkerboard(*asked, 0.025), "view.png")
    assert isinstance(found, Rejected)
    assert "a board of 9x6 inner corners was seen" in found.reason


def test_larger_board_asked_for():
    """A 7x5 board where 11x8 is asked for: what was seen is named."""
    board = Checkerboard(7, 5, 0.025)
    image, _ = shoot(board, pose_of(board))
    found = detect_board(image, Checkerboard(11, 8, 0.025), "view.png")
    assert isinstance(found, Rejected)
    assert "only 7x5 inner corners of 11x8 were seen" in found.reason


def test_board_cut_by_the_frame():
    """A board that is partly outside the image is rejected, and the reason says where the rest is."""
    board = Checkerboard(9, 6, 0.025)
    image, truth = shoot(board, pose_of(board, shift=(0.35, 0.0)))
    assert len(truth) < board.feature_count
    found = detect_board(image, board, "view.png")
    assert isinstance(found, Rejected)
    assert "cut by the frame" in found.reason


def test_board_too_small_in_the_image():
    """Squares of 5 pixels: found or not, the corners are not good enough to be used."""
    board = Checkerboard(9, 6, 0.025)
    image, _ = shoot(board, pose_of(board, fill=40 / 640, tilt_deg=0), noise=0)
    assert isinstance(detect_board(image, board, "view.png"), Rejected)


@pytest.mark.parametrize("cover_px", [20, 80])
def test_covered_corners_are_left_out(cover_px):
    """Something over the last corners: a finder may make them up, but none of them is reported, and the others are right."""
    board = Checkerboard(9, 6, 0.025)
    image, truth = shoot(board, pose_of(board, turn_deg=0, fill=0.75))
    x, y = truth.corners_px[-1].astype(int)
    image[y - cover_px : y + cover_px, x - cover_px : x + cover_px] = 128
    covered = truth.ids[(np.abs(truth.corners_px - [x, y]) < cover_px).all(axis=1)]
    found = detect_board(image, board, "view.png")
    assert isinstance(found, Detection)
    assert not set(found.ids.tolist()) & set(covered.tolist())
    assert np.abs(errors_px(found, truth)).max() < 0.1


def test_mostly_covered_board_is_rejected():
    """With a third of the board covered it is rejected, and the reason says what may be the matter."""
    board = Checkerboard(9, 6, 0.025)
    image, truth = shoot(board, pose_of(board, turn_deg=0, fill=0.6))
    image[:, int(truth.corners_px[5, 0]) :] = 128
    found = detect_board(image, board, "view.png")
    assert isinstance(found, Rejected)
    assert "is part of the board hidden" in found.reason
