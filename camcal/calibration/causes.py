"""The likely cause of a solve that fails or fits nothing: the commonest mix-ups are tried, not guessed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.limits import LARGEST_RMS_PX
from camcal.calibration.parameters import DEFAULT_DISTORTION
from camcal.calibration.solve import solve
from camcal.errors import CamcalError, SolveError
from camcal.geometry.arrays import BoolArray
from camcal.observations import Calibration, Detection, Rejected

_MAJORITY = 0.5


def solve_board(
    detections: Sequence[Detection],
    board: Board,
    *,
    distortion: tuple[str, ...] = DEFAULT_DISTORTION,
    shape: tuple[str, ...] = (),
    rejected: Sequence[Rejected] = (),
) -> Calibration:
    """Do what `solve` does for a board; an unsolvable one is tried with the commonest mix-ups before it is given up.

    Parameters
    ----------
    detections, distortion, shape, rejected
        As `solve` takes them.
    board : Board

    Raises
    ------
    DetectionError, SolveError
        As `solve` does, a SolveError with the board that would fit if rows and columns are swapped. Also a SolveError
        if most boards are seen from behind: mirrored corners fit perfectly, but to the wrong poses.
    """
    try:
        calibration = solve(detections, board.object_points, distortion=distortion, shape=shape, rejected=rejected)
    except SolveError as error:
        swapped = swapped_board(detections, board, distortion)
        if swapped is None:
            raise
        raise SolveError(f"{error} {swapped}") from error
    behind = seen_from_behind(calibration)
    if calibration.rms_px <= LARGEST_RMS_PX and behind.mean() > _MAJORITY:
        raise SolveError(
            f"solve: the boards are seen from behind in {behind.sum()} of {behind.size} views: the ids or the images are "
            "mirrored. Number the corners as they are printed, and do not flip the images."
        )
    return calibration


def seen_from_behind(calibration: Calibration) -> BoolArray:
    """Tell which views look at the back of the board, shape (V,)."""
    # z points into the board, so its front is seen while z points away from the camera, wherever in the plane.
    return np.array([pose.R[:, 2] @ pose.t < 0 for pose in calibration.poses])


def swapped_board(detections: Sequence[Detection], board: Board, distortion: tuple[str, ...]) -> str | None:
    """Say so if the corners fit the board with rows and columns swapped; None if they do not."""
    other = board.transposed
    if other is None:
        return None
    try:
        rms_px = solve(detections, other.object_points, distortion=distortion).rms_px
    except CamcalError:
        return None
    if rms_px > LARGEST_RMS_PX:
        return None
    return f"The corners fit {other.spec} (RMS {rms_px:.3g} px): rows and columns are swapped."


def quarter_turn(calibration: Calibration, board: Board) -> str | None:
    """Say so if the SPEC of a checkerboard seems to name its rows as columns, which changes nothing.

    The sign is a board with more rows than columns whose long side runs across the image in more than half of the views.
    Nothing tells a mix-up from a board held on its side, so the note does no harm where it is wrong; and it keeps silent
    about a mix-up where the camera or the board is turned by 90° in half of the views.
    """
    other = board.transposed
    if other is None or not isinstance(board, Checkerboard) or board.columns > board.rows:
        return None
    # The long side is along the board's y axis.
    across = np.array([abs(pose.R[0, 1]) > abs(pose.R[1, 1]) for pose in calibration.poses])
    if across.mean() <= _MAJORITY:
        return None
    return (
        f"the board lies on its long side in most views: {other.spec} may be meant (the same board, and the same "
        "camera: nothing needs to be done)"
    )
