"""The four files of a calibration: where every view stood, every corner, the board, and last the camera."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from camcal.errors import InputError
from camcal.formats.board_file import save_board
from camcal.formats.camera_file import CAMERA_FILE_NAME, save_intrinsics
from camcal.formats.corners_file import save_corners
from camcal.formats.images import ImageFile
from camcal.formats.output import remove_file
from camcal.formats.views_file import VIEWS_FILE_NAME, load_views_and_options, save_views
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.observations import Calibration, Detection, Outlier
from camcal.records import ViewRecord
from camcal.workflows.report import REPORT_FILE_NAME

if TYPE_CHECKING:
    from camcal.workflows.calibrate import CalibrationRun

_REFINE = "--refine"


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a calibration comes from, as its files tell.

    Attributes
    ----------
    paths : dict of str to Path
        Where the images are, by name, as far as that is known.
    options : tuple of str
        Options of `camcal calibrate` where they are not the defaults.
    """

    paths: Mapping[str, Path] = field(default_factory=dict)
    options: tuple[str, ...] = ()

    @classmethod
    def of_images(cls, found: Sequence[ImageFile], options: Sequence[str]) -> Origin:
        """Remember images; those in memory are nowhere."""
        return cls({image.name: image.path for image in found if image.pixels is None}, tuple(options))

    @classmethod
    def of_corners(cls, file: Path, options: Sequence[str]) -> Origin:
        """Take over what a views file beside a corners file tells: where the images are and how corners were refined."""
        if not (file.parent / VIEWS_FILE_NAME).is_file():
            return cls({}, tuple(options))
        try:
            views, before = load_views_and_options(file.parent)
        except InputError:
            # Whoever made it, it is not what was asked for.
            return cls({}, tuple(options))
        refined = before[before.index(_REFINE) :][:2] if _REFINE in before else ()
        return cls({view.source: file.parent / view.path for view in views if view.path}, (*refined, *options))


def write_calibration(run: CalibrationRun, origin: Origin, folder: Path) -> None:
    """Write the four files; the camera is removed first and written last, so that its presence says that all are there.

    The page of an earlier calibration is removed with it.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    calibration = run.calibration
    remove_file(folder / CAMERA_FILE_NAME)
    # A folder of that name is no earlier page: who writes the page tells of it, and the calibration is not lost for it.
    if (folder / REPORT_FILE_NAME).is_file():
        remove_file(folder / REPORT_FILE_NAME)
    save_board(folder / "board.yaml", run.board)
    save_corners(folder / "corners.csv", *candidates(calibration))
    save_views(folder / VIEWS_FILE_NAME, view_records(run, origin.paths, folder), origin.options)
    save_intrinsics(folder / CAMERA_FILE_NAME, run.intrinsics)


def view_records(run: CalibrationRun, paths: Mapping[str, Path], folder: Path) -> tuple[ViewRecord, ...]:
    """Return every view, used or rejected, sorted by source; images' paths are relative to a folder."""
    calibration = run.calibration
    where = {name: path_seen_from(folder, path) for name, path in paths.items()}
    left_out: dict[str, tuple[str, ...]] = {}
    for outlier in calibration.outliers:
        clause = f"corner {outlier.id}: left out, {outlier.reason}"
        left_out[outlier.source] = (*left_out.get(outlier.source, ()), clause)
    used = [
        ViewRecord(
            detection.source,
            T_cam_board=pose,
            rms_px=rms,
            corners=len(detection),
            notes=(*detection.notes, *run.refused.get(detection.source, ()), *left_out.get(detection.source, ())),
            path=where.get(detection.source, ""),
        )
        for detection, pose, rms in zip(calibration.detections, calibration.poses, calibration.view_rms_px, strict=True)
    ]
    rejected = [
        ViewRecord(rejection.source, reason=rejection.reason, path=where.get(rejection.source, ""))
        for rejection in calibration.rejected
    ]
    return tuple(sorted(used + rejected, key=lambda record: record.source))


def path_seen_from(folder: Path, path: Path) -> str:
    """Return the way from a folder to a file, so that both can be moved together; empty if text cannot hold it."""
    real = os.path.join(os.path.realpath(path.parent), path.name)  # noqa: PTH118 - text in, text out
    try:
        way = os.path.relpath(real, os.path.realpath(folder))
    except ValueError:
        # On another drive.
        way = real
    return Path(way).as_posix() if way.isprintable() else ""


def candidates(
    calibration: Calibration,
) -> tuple[tuple[Detection, ...], tuple[FloatArray, ...], tuple[BoolArray, ...]]:
    """Put the corners that were left out back among the others.

    Returns
    -------
    detections : tuple of Detection
        Every view with all its corners, sorted by source; also the views that did not fit.
    residuals_px : tuple of ndarray of shape (N, 2)
    used : tuple of ndarray of shape (N,)
        Which of the corners were solved with.
    """
    size = calibration.camera.size
    nothing = Detection("", size, np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros(0))
    used = {seen.source: (seen, off) for seen, off in zip(calibration.detections, calibration.residuals_px, strict=True)}
    outliers: dict[str, list[Outlier]] = {}
    for outlier in calibration.outliers:
        outliers.setdefault(outlier.source, []).append(outlier)
    merged = []
    for source in sorted(used.keys() | outliers.keys()):
        seen, off = used.get(source, (nothing, np.zeros((0, 2))))
        others = outliers.get(source, [])
        ids = np.append(seen.ids, [other.id for other in others]).astype(np.int64)
        order = np.argsort(ids)
        corners = np.concatenate([seen.corners_px, np.reshape([other.corner_px for other in others], (-1, 2))])
        residuals = np.concatenate([off, np.reshape([other.residual_px for other in others], (-1, 2))])
        sigma = np.append(seen.sigma_px, [other.sigma_px for other in others])
        every = Detection(source, size, ids[order], corners[order], sigma[order])
        merged.append((every, residuals[order], (np.arange(ids.size) < len(seen))[order]))
    detections, residuals_px, chosen = zip(*merged, strict=True)
    return detections, residuals_px, chosen
