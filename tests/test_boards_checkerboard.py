"""The checkerboard: features and colours at places worked by hand, and its symmetries against brute force."""

from __future__ import annotations

import numpy as np
import pytest

from camcal.boards.checkerboard import Checkerboard

BOARD = Checkerboard(columns=9, rows=6, square_m=0.025)


def turn_about_centre(board: Checkerboard, points: np.ndarray, quarters: int) -> np.ndarray:
    """Points (N, 2) turned by quarters about the board's centre, from x towards y, with complex numbers."""
    centre = complex(board.columns - 1, board.rows - 1) / 2 * board.square_m
    turned = (points[:, 0] + 1j * points[:, 1] - centre) * 1j**quarters + centre
    return np.stack([turned.real, turned.imag], axis=1)


def test_features_stand_where_row_times_columns_plus_column_says():
    """Feature 0 is the origin, 8 ends the first row, 9 starts the second, 53 is the last."""
    assert BOARD.feature_count == 54
    expected = {0: [0, 0, 0], 1: [0.025, 0, 0], 8: [0.2, 0, 0], 9: [0, 0.025, 0], 53: [0.2, 0.125, 0]}
    for feature, point in expected.items():
        assert BOARD.object_points[feature] == pytest.approx(point, abs=1e-15)


def test_derived_arrays_are_read_only_and_shared():
    """Equal boards share one array, which nobody can change."""
    again = Checkerboard(columns=9, rows=6, square_m=0.025)
    assert again == BOARD
    assert hash(again) == hash(BOARD)
    assert again.object_points is BOARD.object_points
    assert again.pattern is BOARD.pattern
    with pytest.raises(ValueError, match="read-only"):
        BOARD.object_points[0, 0] = 1


@pytest.mark.parametrize(
    ("x_mm", "y_mm", "ink"),
    [
        (-1, -1, 1),  # up-left of feature 0: black
        (1, 1, 1),
        (1, -1, 0),
        (-1, 1, 0),
        (-24, -24, 1),  # still the top-left square
        (-26, -26, 0),  # quiet zone
        (-49, -49, 0),
        (201, 126, 0),  # beyond feature 53: 9 + 6 squares away from a black one
        (201, 124, 1),
        (224, 149, 0),
        (226, 151, 0),  # quiet zone
        (249, 174, 0),
    ],
)
def test_colours_at_picked_points(x_mm, y_mm, ink):
    """Colours counted by hand from the black square up-left of feature 0."""
    assert BOARD.pattern.ink_at([x_mm / 1e3, y_mm / 1e3]) == ink


def test_quiet_zone_is_one_square():
    """Printed squares reach one square beyond the outer corners, the white border one more; nothing is known beyond."""
    assert BOARD.pattern.extent_m == pytest.approx((-0.05, -0.05, 0.25, 0.175), abs=1e-15)
    assert np.isnan(BOARD.pattern.ink_at([-0.0501, 0]))


def test_every_feature_is_a_crossing_of_grid_lines():
    """The pattern's lines are the very floats of the features, so no sliver can open between them."""
    assert np.isin(BOARD.object_points[:, 0], BOARD.pattern.x_edges_m).all()
    assert np.isin(BOARD.object_points[:, 1], BOARD.pattern.y_edges_m).all()


@pytest.mark.parametrize("columns", [3, 4, 5, 6])
@pytest.mark.parametrize("rows", [3, 4, 5, 6])
def test_symmetries_are_exactly_the_turns_that_keep_the_print(columns, rows):
    """Of the three turns, those listed leave the ink at random points alone, and the others do not."""
    board = Checkerboard(columns, rows, square_m=0.03)
    left, top, right, bottom = board.pattern.extent_m
    points = np.random.default_rng(5).uniform((left, top), (right, bottom), (500, 2))
    before = board.pattern.ink_at(points)
    expected = {
        quarters for quarters in (1, 2, 3) if (board.pattern.ink_at(turn_about_centre(board, points, quarters)) == before).all()
    }
    found = {
        round(symmetry.T_board_board.angle_deg * np.sign(symmetry.T_board_board.R[1, 0] + 0.5)) % 360 // 90
        for symmetry in board.symmetries
    }
    assert found == expected
    assert len(board.symmetries) == len(expected)


@pytest.mark.parametrize(("columns", "rows", "turns"), [(9, 6, 0), (8, 6, 1), (7, 5, 1), (5, 5, 1), (6, 6, 3)])
def test_symmetries_permute_the_features(columns, rows, turns):
    """The feature that takes a feature's place stands where the motion takes it; the ink follows the motion too."""
    board = Checkerboard(columns, rows, square_m=0.0271)
    assert len(board.symmetries) == turns
    left, top, right, bottom = board.pattern.extent_m
    points = np.random.default_rng(6).uniform((left, top, 0), (right, bottom, 0), (300, 3))
    for symmetry in board.symmetries:
        assert sorted(symmetry.ids) == list(range(board.feature_count))
        moved = symmetry.T_board_board.apply(board.object_points)
        assert board.object_points[symmetry.ids] == pytest.approx(moved, abs=1e-15)
        turned = symmetry.T_board_board.apply(points)
        assert (board.pattern.ink_at(turned[:, :2]) == board.pattern.ink_at(points[:, :2])).all()


def test_half_turn_of_a_7x5_board_by_hand():
    """Feature 0 goes where 34 was, 6 (end of the first row) where 28 (start of the last) was."""
    (symmetry,) = Checkerboard(7, 5, square_m=0.03).symmetries
    assert [symmetry.ids[0], symmetry.ids[6], symmetry.ids[17]] == [34, 28, 17]


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ((2, 6, 0.025), "columns of inner corners: too few"),
        ((9, 2, 0.025), "rows of inner corners: too few"),
        ((9, 101, 0.025), "rows of inner corners: too many"),
        ((9.5, 6, 0.025), "not a whole number"),
        ((9, 6, 0.0), "must be positive"),
        ((9, 6, -0.025), "must be positive"),
        ((9, 6, float("nan")), "must be positive"),
        ((9, 6, float("inf")), "absurd size"),
        ((9, 6, 25.0), "absurd size"),
    ],
)
def test_values_that_make_no_sense_are_refused(values, problem):
    """Each wrong value is named."""
    with pytest.raises(ValueError, match=problem):
        Checkerboard(*values)
