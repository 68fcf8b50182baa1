"""`camcal calibrate`: photographs of a board to a camera that can be trusted, or the reason why not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

from camcal.boards.base import Board
from camcal.calibration.board_shape import BOW, STRETCH
from camcal.calibration.causes import quarter_turn
from camcal.calibration.parameters import DEFAULT_DISTORTION, parse_distortion
from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.formats.camera_file import uncertainty_values
from camcal.formats.corner_exchange.table import is_corners_path
from camcal.formats.images import ImageFile
from camcal.formats.output import claim_folder
from camcal.observations import Calibration
from camcal.records import Intrinsics
from camcal.trust.assess import NO_GATES, Assessment, Gates, assess
from camcal.verdict import Verdict
from camcal.workflows.calibration_files import Origin, write_calibration
from camcal.workflows.inputs import Images, Seen, as_paths, images_to_work_on, views_seen
from camcal.workflows.observe import (
    REFINEMENTS,
    Refined,
    refuse_other_board,
    replay,
    tell_left_out,
)
from camcal.workflows.report import PLOT_FORMATS, claim_figures, show_calibration
from camcal.workflows.reporting import LogReporter, Reporter
from camcal.workflows.solving import Solver
from camcal.workflows.telling import tell_views
from camcal.workflows.undistort import undistort_found

if TYPE_CHECKING:
    from camcal.workflows.twin import Twin

UNDISTORTED = "undistorted"
AUTO = "auto"
"""The distortion whose coefficients are chosen by how well they predict views that they were not solved with."""


_DEFAULTS = {"--distortion": ",".join(DEFAULT_DISTORTION), "--refine": REFINEMENTS[0]}


@dataclass(frozen=True, slots=True)
class CalibrationRun:
    """What `calibrate` found.

    Attributes
    ----------
    calibration : Calibration
    assessment : Assessment
        How far it can be trusted.
    intrinsics : Intrinsics
        What camera.yaml holds.
    board : Board
    folder : Path or None
        Where the files were written.
    refused : dict of str to tuple of str
        By view, a clause for each corner that was refused: its id and why.
    twin : Twin or None
        What the same capture gives when it is rendered with known truth, if that was asked for.
    """

    calibration: Calibration
    assessment: Assessment
    intrinsics: Intrinsics
    board: Board
    folder: Path | None
    refused: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    twin: Twin | None = None

    @property
    def verdict(self) -> Verdict:
        """How far the result can be trusted, and why."""
        return self.assessment.verdict

    def as_dict(self) -> dict[str, object]:
        """Return the result as plain values, for JSON."""
        known, calibration = self.intrinsics, self.calibration
        values = dict(zip(known.camera.intrinsic_names, known.camera.intrinsics.tolist(), strict=True))
        return {
            "size": list(known.camera.size),
            "intrinsics": values,
            "standard_deviations": known.sigma,
            "rms_px": known.rms_px,
            "views": known.views,
            "corners": known.corners,
            "verdict": self.verdict.word,
            "findings": [asdict(finding) for finding in self.verdict.findings],
            "uncertainty": uncertainty_values(self.assessment.uncertainty),
            "cross_validation": known.cross_validation,
            "board_shape": dict(zip(known.shape.names, known.shape.values.tolist(), strict=True)),
            "board_shape_standard_deviations": dict(zip(known.shape.names, known.shape.sigma.tolist(), strict=True)),
            "outliers": [{"image": o.source, "id": o.id, "reason": o.reason} for o in calibration.outliers],
            "twin": None if self.twin is None else self.twin.as_dict(),
            "rejected": {rejection.source: rejection.reason for rejection in calibration.rejected},
            "notes": {d.source: list(d.notes) for d in calibration.detections if d.notes},
            "folder": None if self.folder is None else str(self.folder),
        }


def calibrate(
    images: Images | Seen,
    board: str | Board,
    output: str | Path | None = None,
    *,
    distortion: str = "k1,k2,k3",
    refine: str = "warped",
    warp: bool = False,
    scale: bool = False,
    gates: Gates = NO_GATES,
    twin: int = 0,
    anamorphic: bool = False,
    only_used: bool = False,
    size: tuple[int, int] | None = None,
    undistort: bool = False,
    report: bool = True,
    plots: str | Path | None = None,
    plot_formats: Sequence[str] = PLOT_FORMATS,
    name: str = "camera",
    force: bool = False,
    jobs: int | None = None,
    reporter: Reporter | None = None,
) -> CalibrationRun:
    """Find the board in every image and solve for the camera.

    Parameters
    ----------
    images : path, sequence of path, sequence of ndarray, dict of str to ndarray, or sequence of Detection
        Image files, folders or globs; or images in memory of shape (height, width) or (height, width, 3), uint8, uint16 or
        float32, blue first; or one file of corners (camcal's corners.csv, mrcal's .vnl, MATLAB's image points or another
        CSV) or the views that `detect` or `detect_corners` returns, then nothing is detected.
    board : str or Board
        A one-liner such as `checkerboard:9x6:25mm`, the name of a sample board, or a board file; or the board itself.
    output : path, optional
        Folder for camera.yaml, views.yaml, corners.csv, board.yaml and report.html; nothing is written without it.
    distortion : str
        The free distortion coefficients, e.g. `k1,k2,k3`; the others stay 0. `auto` chooses the simplest lens that predicts
        held-out views as well as any.
    refine : str
        How corners are refined: `warped` (a blurred saddle is fitted to each; after a first solve, the template that the
        calibration itself predicts), `saddle` (the first of the two) or `opencv` (cv2.cornerSubPix).
    warp : bool
        Whether the board's bow is solved for as well: two parameters, one along each of its axes.
    scale : bool
        Whether a stretch of the board's y axis against its x axis is solved for as well.
    gates : Gates
        What the result must reach, beyond not being rejected.
    twin : int
        How often the capture is rendered again from what was found, with known truth, and calibrated from its pixels, to
        compare the errors actually made with the predicted ones. A rejected calibration has no twin.
    anamorphic : bool
        Whether pixels far from square are expected.
    only_used : bool
        With a corners.csv: keep its choice of corners instead of taking each as a candidate again.
    size : tuple of int, optional
        With a file of corners that does not tell: (width, height) of the images in pixels; else the images are looked at.
    undistort : bool
        Whether the undistorted images are written as well, to `undistorted/` in the output folder.
    report : bool
        Whether the page `report.html` is written with the other files, which takes a second or two.
    plots : path, optional
        Folder to which the figures of the report are written as files, for papers.
    plot_formats : sequence of str
        Formats of these: some of `png`, `svg` and `pdf`.
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
        Look at its `verdict` before using it: the files are written and marked even if it is `rejected`.

    Raises
    ------
    InputError
        If a file, the board or an option cannot be used.
    DetectionError
        If fewer than three views are usable.
    SolveError
        If the views do not determine the camera.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> turns = [(0.5, 0, 0), (-0.5, 0, 0), (0, 0.5, 0), (0, -0.5, 0), (0.4, 0.4, 0), (-0.4, 0.3, 0.1)]
    >>> poses = [camcal.Pose.from_rvec(turn, (-0.06, -0.05, 0.25)) for turn in turns]
    >>> images = [camcal.render(camera, "checkerboard:7x6:20mm", pose) for pose in poses]
    >>> run = camcal.calibrate(images, "checkerboard:7x6:20mm", distortion="k1,k2")
    >>> run.intrinsics.camera.K.round(1).tolist()
    [[520.0, 0.0, 322.0], [0.0, 523.0, 236.0], [0.0, 0.0, 1.0]]
    >>> run.verdict.word, [finding.code for finding in run.verdict.findings]
    ('usable', ['central_only'])
    """
    reporter = reporter or LogReporter()
    target = load_board(board) if isinstance(board, str) else board
    free = DEFAULT_DISTORTION if distortion == AUTO else parse_distortion(distortion)
    replay_file, seen = _corners_file(as_paths(images)), views_seen(images)
    are_corners = replay_file is not None or seen is not None
    if undistort and (are_corners or output is None or not as_paths(images)):
        raise InputError("--undistort: needs image files and an output folder (got corners, arrays or no -o).")
    if twin and are_corners:
        raise InputError("--twin: needs images, whose blur and noise are measured (got corners).")
    if only_used and not replay_file:
        raise InputError("--only-used: needs a corners.csv as the only input (got images).")
    if size is not None and not replay_file:
        raise InputError("--size: needs a file of corners as the only input (got images, which tell their size).")
    if refine not in REFINEMENTS:
        raise InputError(f"--refine: unknown (got {refine!r}, expected one of {', '.join(REFINEMENTS)}).")
    found = () if are_corners else images_to_work_on(cast(Images, images), reporter)
    folder = None if output is None else claim_folder(output, force=force)
    figures = claim_figures(folder, plots=plots, formats=plot_formats, force=force)
    shape = (BOW if warp else ()) + (STRETCH if scale else ())
    solver = Solver(target, free, distortion == AUTO, shape, refine, anamorphic, jobs, reporter)
    refused: dict[str, tuple[str, ...]] = {}
    if replay_file:
        calibration = solver.solve([Refined(view) for view in replay(replay_file, target, only_used=only_used, size=size)], [])
    elif seen is not None:
        detections, rejected = seen
        refuse_other_board(detections, target, "images")
        calibration = solver.solve([Refined(view) for view in detections], rejected)
    else:
        calibration, refused = solver.solve_images(found)
    note = quarter_turn(calibration, target)
    if note:
        reporter.warn(note)
    tell_left_out(calibration, reporter)
    tell_views(calibration, refused, target, reporter)
    with reporter.progress("Cross-validating", None):
        assessment = assess(calibration, target, anamorphic=anamorphic, gates=gates)
    known = _intrinsics(calibration, assessment, target, name)
    twins = solver.twins(calibration, found, twin) if twin and not known.problems else None
    run = CalibrationRun(calibration, assessment, known, target, folder, refused, twins)
    options = _options(
        gates,
        {"--distortion": distortion, "--refine": refine},
        {"--warp": warp, "--scale": scale, "--anamorphic": anamorphic, "--only-used": only_used},
    )
    origin = Origin.of_corners(replay_file, options) if replay_file else Origin.of_images(found, options)
    if folder is not None:
        write_calibration(run, origin, folder)
        if undistort:
            where, camera_file = folder / UNDISTORTED, folder / "camera.yaml"
            undistort_found(_unnamed(found), camera_file, where, force=force, jobs=jobs, reporter=reporter)
        show_calibration(folder, page=report, figures=figures, formats=plot_formats, jobs=jobs, reporter=reporter)
    return run


def _corners_file(images: Sequence[str | Path]) -> Path | None:
    """Return the corners file if that is what was named."""
    named = [Path(image) for image in images if is_corners_path(image)]
    if named and len(images) > 1:
        raise InputError(
            f"{named[0]}: a corners file stands alone (got {len(images)} inputs). Pass either images or one corners.csv."
        )
    return named[0] if named else None


def _intrinsics(calibration: Calibration, assessment: Assessment, board: Board, name: str) -> Intrinsics:
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
        shape=calibration.shape,
        uncertainty=assessment.uncertainty,
        cross_validation=assessment.cross_validation.ratio,
        verdict=assessment.verdict,
    )


def _options(gates: Gates, values: Mapping[str, str], flags: Mapping[str, bool]) -> tuple[str, ...]:
    """Return the options that led to a result, as the command line takes them, where they are not the defaults."""
    limits = {"--max-rms": gates.max_rms_px, "--max-sigma-px": gates.max_sigma_px}
    chosen = {option: value for option, value in values.items() if value != _DEFAULTS[option]}
    chosen |= {"--require": gates.require} if gates.require else {}
    chosen |= {option: f"{limit:g}" for option, limit in limits.items() if not math.isnan(limit)}
    named = [part for option, value in chosen.items() for part in (option, value)]
    return (*named, *(option for option, given in flags.items() if given))


def _unnamed(found: Sequence[ImageFile]) -> tuple[ImageFile, ...]:
    """Return the images as if a folder had held them: one of another size than the camera's is passed over by name."""
    return tuple(replace(image, named=False) for image in found)
