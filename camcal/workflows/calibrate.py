"""`camcal calibrate`: photographs of a board to a camera that can be trusted, or the reason why not."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from camcal.boards.base import Board
from camcal.calibration.causes import quarter_turn, solve_board
from camcal.calibration.gates import quality_problems
from camcal.calibration.parameters import parse_distortion
from camcal.detection.blur import flag_blurred
from camcal.detection.detect import detect_board
from camcal.errors import InputError
from camcal.formats.board_file import load_board, save_board
from camcal.formats.camera_file import save_intrinsics
from camcal.formats.corners_file import load_corners, save_corners
from camcal.formats.images import ImageFile, read_gray
from camcal.formats.output import claim_folder
from camcal.formats.views_file import save_views
from camcal.observations import Calibration, Detection, Intrinsics, Rejected, ViewRecord
from camcal.workflows.inputs import Inputs, as_paths, images_to_work_on, warn_of_each
from camcal.workflows.parallel import each
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
    """

    calibration: Calibration
    intrinsics: Intrinsics
    board: Board
    folder: Path | None

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
    replay = _corners_file(as_paths(images))
    if undistort and (replay or output is None):
        raise InputError("--undistort: needs images and an output folder (got a corners file or no -o).")
    if only_used and not replay:
        raise InputError("--only-used: needs a corners.csv as the only input (got images).")
    found = () if replay else images_to_work_on(images, reporter)
    folder = None if output is None else claim_folder(output, force=force)
    views = _replayed(replay, target, only_used) if replay else _detected(found, target, jobs, reporter)
    detections, rejected = _of_one_size(views)
    warn_of_each(((rejection.source, f"rejected: {rejection.reason}") for rejection in rejected), reporter)
    warn_of_each(((detection.source, note) for detection in detections for note in detection.notes), reporter)
    calibration = solve_board(detections, target, distortion=free, rejected=rejected)
    if turned := quarter_turn(calibration, target):
        reporter.warn(turned)
    problems = quality_problems(calibration, target, anamorphic=anamorphic)
    run = CalibrationRun(calibration, _intrinsics(calibration, target, name, problems), target, folder)
    if folder is not None:
        _write(run, folder)
        if undistort:
            where, camera = folder / UNDISTORTED, folder / "camera.yaml"
            undistort_found(_unnamed(found), camera, where, force=force, jobs=jobs, reporter=reporter)
    return run


def _corners_file(images: Sequence[str | Path]) -> Path | None:
    """Return the corners file if that is what was named."""
    named = [Path(image) for image in images if str(image).lower().endswith(".csv")]
    if named and len(images) > 1:
        raise InputError(
            f"{named[0]}: a corners file stands alone (got {len(images)} inputs). Pass either images or one corners.csv."
        )
    return named[0] if named else None


def _replayed(path: Path, board: Board, only_used: bool) -> list[Detection | Rejected]:
    """Read detections from a corners file; every id must be one of the board's."""
    detections = load_corners(path, only_used=only_used)
    for detection in detections:
        if len(detection) and detection.ids[-1] >= board.feature_count:
            raise InputError(
                f"{path}: {detection.source}: id {detection.ids[-1]} is not on the board "
                f"({board.spec} has ids 0 to {board.feature_count - 1}). Pass the board that was detected with --board."
            )
    return list(detections)


def _detected(found: Sequence[ImageFile], board: Board, jobs: int | None, reporter: Reporter) -> list[Detection | Rejected]:
    """Look for the board in every image; a damaged file is an error if it was named, a rejection if a folder held it."""

    def work(image: ImageFile) -> Detection | Rejected:
        try:
            gray = read_gray(image.path)
        except InputError as error:
            if image.named:
                raise
            return Rejected(image.name, str(error).removeprefix(f"{image.path}: "))
        return detect_board(gray, board, image.name)

    with reporter.progress("Detecting", len(found)) as advance:
        return list(flag_blurred(each(work, found, jobs, advance)))


def _of_one_size(views: Sequence[Detection | Rejected]) -> tuple[list[Detection], list[Rejected]]:
    """Keep the views of the commonest image size (the larger of two equally common ones), and reject the others."""
    detections = [view for view in views if isinstance(view, Detection)]
    rejected = [view for view in views if isinstance(view, Rejected)]
    if not detections:
        return [], rejected
    counts = Counter(detection.size for detection in detections)
    size = max(counts, key=lambda each_size: (counts[each_size], each_size))
    for detection in detections:
        if detection.size != size:
            got, expected = ("{}x{}".format(*each_size) for each_size in (detection.size, size))
            rejected.append(Rejected(detection.source, f"another image size (got {got}, expected {expected} as most views)"))
    return [detection for detection in detections if detection.size == size], sorted(rejected, key=lambda r: r.source)


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


def view_records(calibration: Calibration) -> tuple[ViewRecord, ...]:
    """Return every view, used or rejected, sorted by source."""
    used = [
        ViewRecord(detection.source, T_cam_board=pose, rms_px=rms, corners=len(detection), notes=detection.notes)
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
    save_views(folder / "views.yaml", view_records(calibration))
    save_intrinsics(folder / "camera.yaml", run.intrinsics)
