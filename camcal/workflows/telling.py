"""What is told of a calibration to who asks for details: what was solved and decided, and one line for each view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from camcal.workflows.reporting import Reporter

if TYPE_CHECKING:
    from camcal.boards.base import Board
    from camcal.observations import Calibration


def tell_solution(calibration: Calibration, reporter: Reporter) -> None:
    """Say what was solved for, from what, and how well it fits."""
    views, left_out = len(calibration.detections), len(calibration.outliers)
    reporter.detail(
        f"solved {', '.join(calibration.free)} from {calibration.corner_count} corners of {views} views, "
        f"{left_out} left out: RMS {calibration.rms_px:.4g} px"
    )


def tell_unrefined(reasons: Sequence[str], reporter: Reporter) -> None:
    """Say why corners are not refined with a first calibration."""
    reporter.detail(f"corners stay as they were fitted, because the first calibration is not to be trusted: {reasons[0]}")


def tell_views(calibration: Calibration, refused: Mapping[str, Sequence[str]], board: Board, reporter: Reporter) -> None:
    """Say of each view whether it is used, with how many of the board's corners, and how well it fits."""
    lines = {rejection.source: f"rejected: {rejection.reason}" for rejection in calibration.rejected}
    for seen, rms_px in zip(calibration.detections, calibration.view_rms_px, strict=True):
        count = f"{len(seen)} of {board.feature_count} corners"
        others = len(refused.get(seen.source, ()))
        lines[seen.source] = f"used, {count}{f', {others} refused' if others else ''}, RMS {rms_px:.3g} px"
    for source in sorted(lines):
        reporter.detail(f"{source}: {lines[source]}")
