"""What the print looks like around each feature, by hand for both kinds of board."""

from __future__ import annotations

import numpy as np
import pytest

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.refinement.corner_shapes import corner_shapes


def test_a_checkerboard_is_all_saddles():
    """Colours alternate, a square is clear around every corner, and neighbours follow the numbering."""
    shapes = corner_shapes(Checkerboard(4, 3, 0.02))
    assert not shapes.has_l_corners
    assert np.abs(shapes.mix[:, 2]).tolist() == [1.0] * 12
    assert (shapes.mix[0, 2], shapes.mix[1, 2], shapes.mix[4, 2]) == (
        -shapes.mix[5, 2] * -1,
        -shapes.mix[0, 2],
        -shapes.mix[0, 2],
    )
    assert shapes.clear_m == pytest.approx(0.02)
    assert shapes.pitch_m == pytest.approx(0.02)
    assert shapes.neighbours[5].tolist() == [4, 6, 1, 9]
    assert shapes.neighbours[0].tolist() == [-1, 1, -1, 4]


def test_the_sign_of_a_checkerboard():
    """Feature 0 has ink up-left and down-right: product of the step down and the step left is negative there, so -(-1)."""
    shapes = corner_shapes(Checkerboard(4, 3, 0.02))
    # Quadrants: up-left and down-right ink (-1), others paper (+1). Step of edge 1: +1 below; of edge 2: +1 left.
    # Down-left is paper with both steps +1: the weight of the product is +1.
    assert shapes.mix[0].tolist() == [0, 0, 1, 0]


def test_an_aprilgrid_with_squares_is_all_saddles():
    """Clear up to the gap or the border, whichever ends first; the gap's corners are next to each other."""
    board = AprilGrid(3, 2, tag_m=0.06, gap_m=0.018)
    shapes = corner_shapes(board)
    assert not shapes.has_l_corners
    assert np.abs(shapes.mix[:, 2]).tolist() == [1.0] * 24
    # 36h11 with a border of 2 bits has 10 cells of 6 mm: data begin 12 mm inside, unless the first bits are black.
    assert (shapes.clear_m >= 0.012 - 1e-9).all()
    assert (shapes.clear_m <= 0.018 + 1e-9).all()
    assert shapes.pitch_m.min() == pytest.approx(0.018)


def test_isolated_tags_have_l_corners():
    """One quadrant of ink: each weight is a half, and the mix is -1 in that quadrant and +1 in the others."""
    shapes = corner_shapes(AprilGrid(3, 2, tag_m=0.06, gap_m=0.03, border_bits=1, squares=False))
    assert shapes.has_l_corners
    assert np.abs(shapes.mix).tolist() == [[0.5] * 4] * 24
    # Corner 0 is bottom-left: ink is up-right, where the steps are -1 (up) and -1 (right).
    below, left, product, constant = shapes.mix[0]
    assert constant - below - left + product == -1
    assert constant + below - left - product == 1
    assert constant - below + left - product == 1
    assert constant + below + left + product == 1
    # A border of 1 bit is an eighth of the tag.
    assert shapes.clear_m.min() == pytest.approx(0.0075)
