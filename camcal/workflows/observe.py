"""Images, or a corners file, to the detections of one board: found, refined, and of one image size."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from camcal.boards.base import Board
from camcal.calibration.views import FEWEST_CORNERS
from camcal.detection.blur import flag_blurred
from camcal.detection.detect import detect_board
from camcal.errors import InputError
from camcal.formats.corner_exchange.columns import Size
from camcal.formats.corner_exchange.table import read_corners
from camcal.formats.images import ImageFile
from camcal.observations import Calibration, Detection, Rejected
from camcal.refinement.saddle import refine_saddle
from camcal.refinement.verdicts import Refinement
from camcal.refinement.warped import refine_warped
from camcal.workflows.parallel import each
from camcal.workflows.reporting import Reporter

REFINEMENTS = ("warped", "saddle", "opencv")
"""How corners are refined: by the template that a first calibration gives, by a blurred saddle, by cv2.cornerSubPix."""


@dataclass(frozen=True, slots=True)
class Refined:
    """A view after refinement.

    Attributes
    ----------
    detection : Detection
        With the corners that were accepted.
    refused : tuple of str
        One clause for each corner that was not: its id and why.
    refused_px : tuple of (float, float)
        Where each of those had been found, pixels.
    """

    detection: Detection
    refused: tuple[str, ...] = ()
    refused_px: tuple[tuple[float, float], ...] = ()


def observe(
    found: Sequence[ImageFile], board: Board, refine: str, jobs: int | None, reporter: Reporter
) -> tuple[list[Refined], list[Rejected]]:
    """Look for the board in every image, and fit a blurred saddle to each corner unless OpenCV's corners are asked for.

    A damaged file is an error if it was named, a rejection if a folder held it.
    """

    def work(image: ImageFile) -> Refined | Rejected:
        try:
            gray = image.gray()
        except InputError as error:
            if image.named:
                raise
            return Rejected(image.name, str(error).removeprefix(f"{image.path}: "))
        seen = detect_board(gray, board, image.name)
        if isinstance(seen, Rejected):
            return seen
        return Refined(seen) if refine == "opencv" else _applied(refine_saddle(gray, seen.ids, seen.corners_px, board), seen)

    with reporter.progress("Detecting", len(found)) as advance:
        views = each(work, found, jobs, advance)
    kept = [view for view in views if isinstance(view, Refined)]
    flagged = flag_blurred([view.detection for view in kept])
    refined = [replace(view, detection=seen) for seen, view in zip(flagged, kept, strict=True) if isinstance(seen, Detection)]
    return refined, [view for view in views if isinstance(view, Rejected)]


def observe_again(
    first: Calibration,
    views: Sequence[Refined],
    found: Sequence[ImageFile],
    board: Board,
    *,
    jobs: int | None,
    reporter: Reporter,
) -> list[Refined]:
    """Refine the corners of every view with the edges that a first calibration predicts.

    Every corner is a candidate again, also one that did not fit the first calibration; a view that has no pose in it stays
    as it is. The images are read once more, so that memory does not grow with their number.
    """
    images = {image.name: image for image in found}
    poses = {seen.source: pose for seen, pose in zip(first.detections, first.poses, strict=True)}

    def work(view: Refined) -> Refined:
        detection = view.detection
        if detection.source not in poses:
            return view
        gray = images[detection.source].gray()
        pose = poses[detection.source]
        fit = refine_warped(gray, detection.ids, detection.corners_px, board, camera=first.camera, T_cam_board=pose)
        again = _applied(fit, detection)
        return replace(again, refused=(*view.refused, *again.refused))

    with reporter.progress("Refining", len(views)) as advance:
        return each(work, views, jobs, advance)


def replay(path: Path, board: Board, *, only_used: bool, size: Size | None = None) -> list[Detection]:
    """Read detections from a corners file, camcal's or another tool's; every id must be one of the board's.

    Raises
    ------
    InputError
        If the file cannot be used or holds corners of another board.
    """
    detections = read_corners(path, board, size=size, only_used=only_used)
    refuse_other_board(detections, board, str(path))
    return list(detections)


def refuse_other_board(detections: Sequence[Detection], board: Board, where: str) -> None:
    """Refuse views with ids that the board does not have.

    Raises
    ------
    InputError
        If there are some.
    """
    for detection in detections:
        if len(detection) and detection.ids[-1] >= board.feature_count:
            raise InputError(
                f"{where}: {detection.source}: id {detection.ids[-1]} is not on the board "
                f"({board.spec} has ids 0 to {board.feature_count - 1}). Pass the board that was detected with --board."
            )


def of_one_size(detections: Sequence[Detection]) -> tuple[list[Detection], list[Rejected]]:
    """Keep the views of the commonest image size (the larger of two equally common ones), and reject the others."""
    if not detections:
        return [], []
    counts = Counter(detection.size for detection in detections)
    size = max(counts, key=lambda each_size: (counts[each_size], each_size))
    expected = "{}x{}".format(*size)
    rejected = [
        Rejected(d.source, "another image size (got {}x{}, expected {} as most views)".format(*d.size, expected))
        for d in detections
        if d.size != size
    ]
    return [detection for detection in detections if detection.size == size], rejected


def tell_refused(refused: Mapping[str, Sequence[str]], reporter: Reporter) -> None:
    """Say in one line how many corners were refused; views.yaml names each."""
    first = next(((source, clauses[0]) for source, clauses in sorted(refused.items()) if clauses), None)
    if first is not None:
        count = sum(len(clauses) for clauses in refused.values())
        reporter.warn(f"{count} corners refused in all, each named in views.yaml (first: {first[0]}: {first[1]})")


def tell_left_out(calibration: Calibration, reporter: Reporter) -> None:
    """Say in one line how many corners do not fit the others; views.yaml names each."""
    if calibration.outliers:
        first, count = calibration.outliers[0], len(calibration.outliers)
        reporter.warn(
            f"{count} {'corner' if count == 1 else 'corners'} left out, each named in views.yaml "
            f"(first: {first.source}: corner {first.id}: {first.reason})"
        )


def _applied(fit: Refinement, detection: Detection) -> Refined:
    """Keep the corners whose fit looks like a corner, and name the others; a view is not lost for its refinement."""
    if fit.ok.sum() < FEWEST_CORNERS <= len(detection):
        note = f"corners as detected: only {fit.ok.sum()} of {len(detection)} could be refined"
        return Refined(replace(detection, notes=(*detection.notes, note)))
    named = zip(detection.ids.tolist(), fit.ok.tolist(), fit.reasons, strict=True)
    clauses = tuple(f"corner {id_}: {reason}" for id_, ok, reason in named if not ok)
    return Refined(fit.applied(detection), clauses, tuple((x, y) for x, y in detection.corners_px[~fit.ok].tolist()))
