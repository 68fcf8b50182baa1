"""`camcal calibrate`: photographs of a board to a camera that can be trusted, or the reason why not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from camcal.boards.base import Board
from camcal.calibration.causes import quarter_turn, solve_board
from camcal.calibration.gates import capture_warnings, quality_problems
from camcal.calibration.parameters import parse_distortion
from camcal.errors import InputError
from camcal.formats.board_file import load_board, save_board
from camcal.formats.camera_file import save_intrinsics
from camcal.formats.corners_file import save_corners
from camcal.formats.images import ImageFile
from camcal.formats.output import claim_folder
from camcal.formats.views_file import save_views
from camcal.observations import Calibration, Intrinsics, Rejected, ViewRecord
from camcal.workflows.inputs import Inputs, as_paths, images_to_work_on, warn_of_each
from camcal.workflows.observe import REFINEMENTS, Refined, observe, observe_again, of_one_size, replay, tell_refused
from camcal.workflows.reporting import LogReporter, Reporter
from camcal.workflows.undistort import undistort_found

UNDISTORTED = "undistorted"


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """What `calibrate` found.

    Attributes
    ----------
    calibration : Calibration
    intrinsics : Intrinsics
        What camera.yaml holds; its `problems` say why the result must not be trusted, if so.
    board : Board
    folder : Path or None
        Where the files were written.
    refused : dict of str to tuple of str
        By view, a clause for each corner that was refused: its id and why.
    """

    calibration: Calibration
    intrinsics: Intrinsics
    board: Board
    folder: Path | None
    refused: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def as_dict(self) -> dict[str, object]:
        """Return the result as plain values, for JSON."""
        known = self.intrinsics
        values = dict(zip(known.camera.intrinsic_names, known.camera.intrinsics.tolist(), strict=True))
        return {
            "size": list(known.camera.size),
            "intrinsics": values,
            "standard_deviations": known.sigma,
            "rms_px": known.rms_px,
            "views": known.views,
            "corners": known.corners,
            "rejected": {rejection.source: rejection.reason for rejection in self.calibration.rejected},
            "notes": {d.source: list(d.notes) for d in self.calibration.detections if d.notes},
            "trusted": not known.problems,
            "problems": list(known.problems),
            "folder": None if self.folder is None else str(self.folder),
        }


def calibrate(
    images: Inputs,
    board: str,
    output: str | Path | None = None,
    *,
    distortion: str = "k1,k2,k3",
    refine: str = "warped",
    anamorphic: bool = False,
    only_used: bool = False,
    undistort: bool = False,
    name: str = "camera",
    force: bool = False,
    jobs: int | None = None,
    reporter: Reporter | None = None,
) -> CalibrationRun:
    """Find the board in every image and solve for the camera.

    Parameters
    ----------
    images : path or sequence of path
        Image files, folders or globs; or one corners.csv, then nothing is detected.
    board : str
        A one-liner such as `checkerboard:9x6:25mm`, the name of a sample board, or a board file.
    output : path, optional
        Folder for camera.yaml, views.yaml, corners.csv and board.yaml; nothing is written without it.
    distortion : str
        The free distortion coefficients, e.g. `k1,k2,k3`; the others stay 0.
    refine : str
        How corners are refined: `warped` (a blurred saddle is fitted to each; after a first solve, the template that the
        calibration itself predicts), `saddle` (the first of the two) or `opencv` (cv2.cornerSubPix).
    anamorphic : bool
        Whether pixels far from square are expected.
    only_used : bool
        With a corners.csv: keep its choice of corners instead of taking each as a candidate again.
    undistort : bool
        Whether the undistorted images are written as well, to `undistorted/` in the output folder.
    name : str
        Name of the camera in camera.yaml.
    force : bool
        Whether a folder that exists is written into.
    jobs : int, optional
        Images worked on at once; all processors by default. It changes no bit of the result.
    reporter : Reporter, optional

    Returns
    -------
    CalibrationRun
        Look at `intrinsics.problems` before using it: the files are written and marked even if a gate fails.

    Raises
    ------
    InputError
        If a file, the board or an option cannot be used.
    DetectionError
        If fewer than three views are usable.
    SolveError
        If the views do not determine the camera.
    """
    reporter = reporter or LogReporter()
    target = load_board(board)
    free = parse_distortion(distortion)
    replay_file = _corners_file(as_paths(images))
    if undistort and (replay_file or output is None):
        raise InputError("--undistort: needs images and an output folder (got a corners file or no -o).")
    if only_used and not replay_file:
        raise InputError("--only-used: needs a corners.csv as the only input (got images).")
    if refine not in REFINEMENTS:
        raise InputError(f"--refine: unknown (got {refine!r}, expected one of {', '.join(REFINEMENTS)}).")
    found = () if replay_file else images_to_work_on(images, reporter)
    folder = None if output is None else claim_folder(output, force=force)
    task = _Task(target, free, refine, anamorphic, jobs, reporter)
    if replay_file:
        calibration = task.solve([Refined(seen) for seen in replay(replay_file, target, only_used=only_used)], [])
        refused: dict[str, tuple[str, ...]] = {}
    else:
        calibration, refused = task.solve_images(found)
    for warning in (quarter_turn(calibration, target), *capture_warnings(calibration)):
        if warning:
            reporter.warn(warning)
    problems = quality_problems(calibration, target, anamorphic=anamorphic)
    run = CalibrationRun(calibration, _intrinsics(calibration, target, name, problems), target, folder, refused)
    if folder is not None:
        _write(run, folder)
        if undistort:
            where, camera_file = folder / UNDISTORTED, folder / "camera.yaml"
            undistort_found(_unnamed(found), camera_file, where, force=force, jobs=jobs, reporter=reporter)
    return run


@dataclass(frozen=True, slots=True)
class _Task:
    """What to solve and how."""

    board: Board
    distortion: tuple[str, ...]
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
        return solve_board(detections, self.board, distortion=self.distortion, rejected=every)

    def solve_images(self, found: Sequence[ImageFile]) -> tuple[Calibration, dict[str, tuple[str, ...]]]:
        """Find and refine the corners of images, and solve; by view, the corners that were refused come along."""
        views, rejected = observe(found, self.board, self.refine, self.jobs, self.reporter)
        calibration = self.solve(views, rejected)
        refused = {view.detection.source: view.refused for view in views}
        # A calibration that is not to be trusted predicts no edges either.
        if self.refine == "warped" and not quality_problems(calibration, self.board, anamorphic=self.anamorphic):
            again = observe_again(calibration, found, self.board, self.jobs, self.reporter)
            refused |= {view.detection.source: (*refused[view.detection.source], *view.refused) for view in again}
            warped = [view.detection for view in again]
            calibration = solve_board(warped, self.board, distortion=self.distortion, rejected=calibration.rejected)
        tell_refused(refused, self.reporter)
        return calibration, refused


def _corners_file(images: Sequence[str | Path]) -> Path | None:
    """Return the corners file if that is what was named."""
    named = [Path(image) for image in images if str(image).lower().endswith(".csv")]
    if named and len(images) > 1:
        raise InputError(
            f"{named[0]}: a corners file stands alone (got {len(images)} inputs). Pass either images or one corners.csv."
        )
    return named[0] if named else None


def _intrinsics(calibration: Calibration, board: Board, name: str, problems: tuple[str, ...]) -> Intrinsics:
    """Return what camera.yaml is to hold."""
    return Intrinsics(
        camera=calibration.camera,
        name=name,
        board=board.spec,
        free=calibration.free,
        covariance=calibration.covariance,
        rms_px=calibration.rms_px,
        views=len(calibration.detections),
        corners=calibration.corner_count,
        problems=problems,
    )


def view_records(run: CalibrationRun) -> tuple[ViewRecord, ...]:
    """Return every view, used or rejected, sorted by source."""
    calibration = run.calibration
    used = [
        ViewRecord(
            detection.source,
            T_cam_board=pose,
            rms_px=rms,
            corners=len(detection),
            notes=(*detection.notes, *run.refused.get(detection.source, ())),
        )
        for detection, pose, rms in zip(calibration.detections, calibration.poses, calibration.view_rms_px, strict=True)
    ]
    rejected = [ViewRecord(rejection.source, reason=rejection.reason) for rejection in calibration.rejected]
    return tuple(sorted(used + rejected, key=lambda record: record.source))


def _unnamed(found: Sequence[ImageFile]) -> tuple[ImageFile, ...]:
    """Return the images as if a folder had held them: one of another size than the camera's is passed over by name."""
    return tuple(replace(image, named=False) for image in found)


def _write(run: CalibrationRun, folder: Path) -> None:
    """Write the four files; the camera is removed first and written last, so that its presence says that all are there."""
    calibration = run.calibration
    (folder / "camera.yaml").unlink(missing_ok=True)
    save_board(folder / "board.yaml", run.board)
    save_corners(folder / "corners.csv", calibration.detections, calibration.residuals_px)
    save_views(folder / "views.yaml", view_records(run))
    save_intrinsics(folder / "camera.yaml", run.intrinsics)
