"""The AprilGrid: Kalibr's layout at places worked by hand, and tags against the official codes."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from camcal.boards.aprilgrid import FAMILIES, AprilGrid, tag_ink

KALIBR = AprilGrid(columns=3, rows=2, tag_m=0.1, gap_m=0.03)
TOP_LEFT = AprilGrid(columns=3, rows=2, tag_m=0.1, gap_m=0.03, first="top-left")
# Corners BL, BR, TR, TL of a tag whose top-left corner is the origin.
CORNERS = np.array([[0, 0.1, 0], [0.1, 0.1, 0], [0.1, 0, 0], [0, 0, 0]])


@pytest.mark.parametrize(
    ("board", "tag", "x", "y"),
    [
        (KALIBR, 0, 0.0, 0.13),
        (KALIBR, 2, 0.26, 0.13),
        (KALIBR, 3, 0.0, 0.0),
        (KALIBR, 5, 0.26, 0.0),
        (TOP_LEFT, 0, 0.0, 0.0),
        (TOP_LEFT, 2, 0.26, 0.0),
        (TOP_LEFT, 3, 0.0, 0.13),
        (TOP_LEFT, 5, 0.26, 0.13),
    ],
)
def test_tags_run_right_then_up_or_down(board, tag, x, y):
    """Kalibr's tag 0 is at the bottom left and ids run up; from the top left they run down. Corners are BL, BR, TR, TL."""
    assert board.feature_count == 24
    assert board.object_points[4 * tag : 4 * tag + 4] == pytest.approx(np.add(CORNERS, [x, y, 0]), abs=1e-15)


# Official tags row by row from the top left, most significant bit first, 1 white: the families' first codes as first published
# (tag36h10's from the code 1a42f9469 of the AprilTag 3 library, whose bits run in a spiral).
@pytest.mark.parametrize(
    ("family", "code"), [("tag36h11", 0xD5D628584), ("tag16h5", 0x231B), ("tag25h9", 0x155CBF1), ("tag36h10", 0x1CA92A687)]
)
@pytest.mark.parametrize("border_bits", [1, 2])
def test_tag_0_is_the_official_one_upright(family, code, border_bits):
    """The data bits spell the family's published code, within a black border of the asked width."""
    bits = FAMILIES[family][0]
    (ink,) = tag_ink(family, 1, border_bits)
    data = ink[border_bits:-border_bits, border_bits:-border_bits]
    assert data.shape == (bits, bits)
    assert int("".join(str(1 - int(value)) for value in data.ravel()), 2) == code
    border = np.ones_like(ink, dtype=bool)
    border[border_bits:-border_bits, border_bits:-border_bits] = False
    assert (ink[border] == 1).all()


@pytest.mark.parametrize("family", FAMILIES)
def test_families_have_the_size_that_the_dictionary_says(family):
    """Bits and number of tags agree with OpenCV's dictionary, and the last tag can be drawn."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_APRILTAG_{family[3:]}"))
    assert FAMILIES[family] == (dictionary.markerSize, len(dictionary.bytesList))
    assert tag_ink(family, FAMILIES[family][1], 1).shape[0] == FAMILIES[family][1]


def test_tag_cells_are_what_a_large_drawing_shows_at_its_cell_centres():
    """One pixel a cell loses nothing: the same tag drawn at 11 pixels a cell has these values at the cells' centres."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    drawn = cv2.aruco.generateImageMarker(dictionary, 17, 110, borderBits=2)
    upright = cv2.rotate(drawn, cv2.ROTATE_180)
    assert np.array_equal(tag_ink("tag36h11", 18, 2)[17], upright[5::11, 5::11] < 128)


@pytest.mark.parametrize(
    ("x", "y", "ink"),
    [
        (0.001, 0.001, 1),  # border of tag 3
        (0.019, 0.099, 1),  # still its two-bit border
        (-0.001, -0.001, 1),  # corner square touching the tag's corner
        (-0.029, -0.029, 1),
        (-0.031, -0.001, 0),  # quiet zone
        (-0.059, -0.059, 0),
        (0.05, -0.001, 0),  # outer gap between two corner squares
        (0.115, 0.115, 1),  # inner corner square
        (0.115, 0.05, 0),  # gap between two tags
        (0.375, 0.245, 1),  # bottom-right corner square
        (0.375, 0.115, 1),
        (0.391, 0.245, 0),  # quiet zone
    ],
)
def test_colours_at_picked_points(x, y, ink):
    """Tags of 100 mm with 30 mm between: squares at every crossing, the outer ring's included."""
    assert KALIBR.pattern.ink_at([x, y]) == ink


def test_data_bits_stand_upright_in_their_tag():
    """Tag 0 (36h11, code d5d628584) starts 1101 01, so its top row is white white black white black white."""
    centres = np.array([[0.025 + 0.01 * i, 0.13 + 0.025] for i in range(6)])
    assert KALIBR.pattern.ink_at(centres).tolist() == [0, 0, 1, 0, 1, 0]


def test_without_squares_the_gaps_are_white():
    """Only the tags are printed, on the same grid."""
    bare = AprilGrid(columns=3, rows=2, tag_m=0.1, gap_m=0.03, squares=False)
    assert bare.pattern.ink_at([[-0.001, -0.001], [0.115, 0.115], [0.001, 0.001]]).tolist() == [0, 0, 1]
    assert bare.pattern.extent_m == KALIBR.pattern.extent_m == pytest.approx((-0.06, -0.06, 0.42, 0.29), abs=1e-15)


@pytest.mark.parametrize(("tag_m", "gap_m"), [(0.088, 0.0264), (0.0333, 0.00999), (1 / 3, 1 / 7)])
def test_every_feature_is_a_crossing_of_grid_lines(tag_m, gap_m):
    """The pattern's lines are the very floats of the features; no cell is thinner than a tag's cell or a gap."""
    board = AprilGrid(columns=7, rows=5, tag_m=tag_m, gap_m=gap_m)
    x, y = board.pattern.x_edges_m, board.pattern.y_edges_m
    assert np.isin(board.object_points[:, 0], x).all()
    assert np.isin(board.object_points[:, 1], y).all()
    assert np.diff(x).min() == pytest.approx(min(tag_m / 10, gap_m), rel=1e-12)
    assert (x.size, y.size) == (7 * 11 + 4, 5 * 11 + 4)


def test_no_turn_keeps_the_print():
    """Tags tell which way is up."""
    assert KALIBR.symmetries == ()


def test_boards_compare_by_value():
    """Equal values are one board with one pattern; another border is another board."""
    same = AprilGrid(columns=3, rows=2, tag_m=0.1, gap_m=0.03)
    assert same == KALIBR
    assert same.pattern is KALIBR.pattern
    assert AprilGrid(columns=3, rows=2, tag_m=0.1, gap_m=0.03, border_bits=1) != KALIBR


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"columns": 1}, "columns of tags: too few"),
        ({"rows": 0}, "rows of tags: too few"),
        ({"tag_m": 0}, "tag: must be positive"),
        ({"gap_m": 0}, "spacing: must be positive"),
        ({"gap_m": 0.3}, "spacing: absurd"),
        ({"family": "tag36h12"}, "Did you mean 'tag36h1[01]'"),
        ({"first": "top-right"}, "first: unknown"),
        ({"border_bits": 3}, "border: .*got 3, expected 1 or 2"),
        ({"family": "tag16h5", "columns": 6, "rows": 6}, r"6x6 = 36, expected at most 30"),
        ({"family": "tag25h9", "columns": 6, "rows": 6}, r"expected at most 35"),
        ({"columns": 25, "rows": 24}, r"expected at most 587"),
    ],
)
def test_values_that_make_no_sense_are_refused(values, problem):
    """Each wrong value is named."""
    with pytest.raises(ValueError, match=problem):
        AprilGrid(**({"columns": 6, "rows": 5, "tag_m": 0.1, "gap_m": 0.03} | values))
