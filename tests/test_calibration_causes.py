"""Rows and columns that change places: which board fits better, and when that is worth a note."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import BOARD, detections, poses

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.causes import quarter_turn, solve_board
from camcal.calibration.solve import solve
from camcal.errors import SolveError
from camcal.geometry.pose import Pose
from camcal.trust.gates import gate_findings


@pytest.mark.parametrize(
    ("board", "spec"),
    [
        (BOARD, "checkerboard:6x9:25mm"),
        (AprilGrid(5, 4, 0.03, 0.009, family="tag25h9"), "aprilgrid:4x5:30mm:0.3:family=tag25h9"),
    ],
)
def test_transposed_boards(board, spec):
    """Rows and columns change places, everything else stays; a board with as many of both has no other."""
    assert board.transposed.spec == spec
    assert board.transposed.transposed == board
    assert replace(board, columns=4, rows=4).transposed is None


@pytest.mark.parametrize(("turn_deg", "noted"), [(0, False), (90, True), (180, False), (-90, True)])
def test_quarter_turn_is_noted(turn_deg, noted):
    """A 6x9 board whose long side runs across the image may be meant as 9x6; one that stands upright may not."""
    board = Checkerboard(6, 9, 0.025)
    solved = solve(detections(poses(8, 6, board=board), board=board), board.object_points)
    turned = [Pose.from_rvec([0, 0, np.radians(turn_deg)], pose.t) for pose in solved.poses]
    note = quarter_turn(replace(solved, poses=tuple(turned)), board)
    assert (note is not None) == noted
    assert note is None or "checkerboard:9x6:25mm" in note
    assert quarter_turn(replace(solved, poses=tuple(turned)), BOARD) is None


@pytest.mark.parametrize("seed", [16, 21, 22])
def test_swapped_rows_and_columns_are_recognised(seed):
    """Corners labelled for 6x9 but solved as 9x6 never pass: an error or a problem that names the board that fits."""
    other = Checkerboard(6, 9, 0.025)
    views = detections(poses(10, seed, board=other), board=other, noise_px=0.02)
    try:
        solved = solve_board(views, BOARD)
    except SolveError as error:
        message = str(error)
    else:
        assert solved.rms_px > 3
        message = str(gate_findings(solved, BOARD)[0])
    assert "checkerboard:6x9:25mm" in message
    assert "rows and columns are swapped" in message


def test_unsolvable_views_of_the_right_board_are_not_called_swapped():
    """A degenerate capture stays an error of its own."""
    with pytest.raises(SolveError) as caught:
        solve_board(detections(poses(8, 12, tilt=0.0), noise_px=0.02), BOARD)
    assert "swapped" not in str(caught.value)
