"""The likely cause of a solve that fails or fits nothing: the commonest mix-ups are tried, not guessed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.parameters import DEFAULT_DISTORTION
from camcal.calibration.solve import solve
from camcal.errors import CamcalError, SolveError
from camcal.observations import Calibration, Detection, Rejected

LARGEST_RMS_PX = 3.0
"""Above this the model does not describe the corners: real corners are found within a few tenths of a pixel."""

_MOST = 0.8


def solve_board(
    detections: Sequence[Detection],
    board: Board,
    *,
    distortion: tuple[str, ...] = DEFAULT_DISTORTION,
    rejected: Sequence[Rejected] = (),
) -> Calibration:
    """Do what `solve` does for a board; an unsolvable one is tried with the commonest mix-ups before it is given up.

    Parameters
    ----------
    detections, distortion, rejected
        As `solve` takes them.
    board : Board

    Raises
    ------
    DetectionError, SolveError
        As `solve` does, a SolveError with the board that would fit if rows and columns are swapped.
    """
    try:
        return solve(detections, board.object_points, distortion=distortion, rejected=rejected)
    except SolveError as error:
        swapped = swapped_board(detections, board, distortion)
        if swapped is None:
            raise
        raise SolveError(f"{error} {swapped}") from error


def swapped_board(detections: Sequence[Detection], board: Board, distortion: tuple[str, ...]) -> str | None:
    """Say so if the corners fit the board with rows and columns swapped; None if they do not."""
    columns, rows = getattr(board, "columns", None), getattr(board, "rows", None)
    if columns is None or rows is None or columns == rows:
        return None
    other: Board = replace(board, columns=rows, rows=columns)  # type: ignore[type-var]
    try:
        rms_px = solve(detections, other.object_points, distortion=distortion).rms_px
    except CamcalError:
        return None
    if rms_px > LARGEST_RMS_PX:
        return None
    return f"The corners fit {other.spec} (RMS {rms_px:.3g} px): rows and columns are swapped."


def quarter_turn(calibration: Calibration, board: Board) -> str | None:
    """Say so if a checkerboard's columns run down most images: its SPEC then names rows as columns, which is harmless."""
    if not isinstance(board, Checkerboard) or board.columns >= board.rows:
        return None
    down = [abs(pose.R[1, 0]) > abs(pose.R[0, 0]) for pose in calibration.poses]
    if sum(down) <= _MOST * len(down):
        return None
    other = replace(board, columns=board.rows, rows=board.columns)
    return f"the board lies on its long side in most views: {other.spec} is meant? (harmless: it is the same board)"
