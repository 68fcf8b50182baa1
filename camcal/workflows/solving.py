"""Corners or images to a calibration: found, refined, solved, refined again by what was found, and solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from camcal.boards.base import Board
from camcal.calibration.causes import solve_board
from camcal.calibration.views import FEWEST_VIEWS, usable_views
from camcal.errors import SolveError
from camcal.formats.images import ImageFile
from camcal.observations import Calibration, Detection, Rejected
from camcal.trust.fisheye import ADVICE, fit_fisheye
from camcal.trust.gates import gate_findings
from camcal.trust.models import choose_distortion
from camcal.workflows.inputs import images_to_work_on, warn_of_each
from camcal.workflows.observe import Refined, observe, observe_again, of_one_size, tell_refused
from camcal.workflows.reporting import ProgressOnly, Reporter
from camcal.workflows.telling import tell_solution, tell_unrefined

if TYPE_CHECKING:
    from camcal.workflows.twin import Twin


@dataclass(frozen=True, slots=True)
class Solver:
    """Takes corners or images to a calibration, one way for all of them.

    Attributes
    ----------
    board : Board
    distortion : tuple of str
        The free coefficients.
    choose : bool
        Whether they are only where the choice begins.
    shape : tuple of str
        What is solved for of the board's own shape.
    refine : str
        One of `REFINEMENTS`.
    anamorphic : bool
        Whether pixels far from square are expected.
    jobs : int or None
        Images worked on at once; None is one per processor.
    reporter : Reporter
    """

    board: Board
    distortion: tuple[str, ...]
    choose: bool
    shape: tuple[str, ...]
    refine: str
    anamorphic: bool
    jobs: int | None
    reporter: Reporter

    def solve(self, views: Sequence[Refined], rejected: Sequence[Rejected]) -> Calibration:
        """Solve from views that have been seen, and pass on what is to be said of them."""
        detections, other_sizes = of_one_size([view.detection for view in views])
        every = sorted([*rejected, *other_sizes], key=lambda rejection: rejection.source)
        warn_of_each(((rejection.source, f"rejected: {rejection.reason}") for rejection in every), self.reporter)
        warn_of_each(((seen.source, note) for seen in detections for note in seen.notes), self.reporter)
        return self._solve_board(detections, every)

    def solve_images(self, found: Sequence[ImageFile]) -> tuple[Calibration, dict[str, tuple[str, ...]]]:
        """Find and refine the corners of images, and solve; by view, the corners that were refused come along."""
        views, rejected = observe(found, self.board, self.refine, self.jobs, self.reporter)
        calibration = self.solve(views, rejected)
        # A calibration that is not to be trusted predicts no edges either.
        doubts = gate_findings(calibration, self.board, anamorphic=self.anamorphic) if self.refine == "warped" else ()
        if doubts:
            tell_unrefined([str(doubt) for doubt in doubts], self.reporter)
        elif self.refine == "warped":
            size = calibration.camera.size
            same_size = [view for view in views if view.detection.size == size]
            views = observe_again(calibration, same_size, found, self.board, jobs=self.jobs, reporter=self.reporter)
            tried = {view.detection.source for view in same_size}
            passed_over = [rejection for rejection in calibration.rejected if rejection.source not in tried]
            calibration = self._solve_board([view.detection for view in views], passed_over)
        refused = {view.detection.source: view.refused for view in views}
        tell_refused(refused, self.reporter)
        return calibration, refused

    def twins(self, calibration: Calibration, found: Sequence[ImageFile], count: int) -> Twin:
        """Render the capture again with known truth, and calibrate it from pixels in just the same way."""
        # The renderer is only needed here.
        from camcal.workflows.twin import run_twins

        quiet = replace(self, reporter=ProgressOnly(self.reporter))

        def recalibrate(folder: Path) -> Calibration:
            return quiet.solve_images(images_to_work_on(folder, quiet.reporter))[0]

        return run_twins(calibration, self.board, found, recalibrate, count, jobs=self.jobs, reporter=self.reporter)

    def _solve_board(self, detections: Sequence[Detection], rejected: Sequence[Rejected]) -> Calibration:
        """Solve, and say what came of it."""
        with self.reporter.progress("Solving", None):
            solved = self._solve_chosen(detections, rejected)
        tell_solution(solved, self.reporter)
        return solved

    def _solve_chosen(self, detections: Sequence[Detection], rejected: Sequence[Rejected]) -> Calibration:
        """Solve, and once more with the coefficients that the views support if these are to be chosen."""
        try:
            found = solve_board(detections, self.board, distortion=self.distortion, shape=self.shape, rejected=rejected)
        except SolveError as error:
            views, _ = usable_views(detections, self.board.object_points)
            fisheye = fit_fisheye(views, self.board.object_points) if len(views) >= FEWEST_VIEWS else None
            if fisheye is None or not fisheye.is_fisheye:
                raise
            raise SolveError(f"solve: {fisheye.text}. {ADVICE}") from error
        chosen = choose_distortion(found, self.board) if self.choose else self.distortion
        if chosen == self.distortion:
            return found
        return solve_board(detections, self.board, distortion=chosen, shape=self.shape, rejected=rejected)
