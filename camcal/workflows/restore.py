"""A calibration read back from the folder that it was written to, linearised where it stands instead of solved anew."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from camcal.boards.base import Board
from camcal.calibration.normal_equations import NormalEquations, residuals
from camcal.errors import InputError
from camcal.formats.board_file import BOARD_FILE_NAME, load_board
from camcal.formats.camera_file import CAMERA_FILE_NAME, load_intrinsics
from camcal.formats.corners_file import CornersTable, load_corner_table
from camcal.formats.views_file import load_views_and_options
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.observations import Calibration, Detection, Outlier, Rejected
from camcal.records import Intrinsics, ViewRecord
from camcal.threads import single_threaded
from camcal.trust.minimum import Minimum

FILES = (BOARD_FILE_NAME, "corners.csv", "views.yaml", CAMERA_FILE_NAME)
"""What a calibration's folder must hold."""

# Stored floats are exact; what remains is the arithmetic of a projection. Files of two runs differ by far more.
_SAME_PX = 1e-3
_LEFT_OUT = "corner {}: left out, "


@dataclass(frozen=True, slots=True, eq=False)
class Restored:
    """What a calibration's folder tells.

    Attributes
    ----------
    calibration : Calibration
        Its outliers are sorted by image and id. The notes of its detections are those of `views`.
    intrinsics : Intrinsics
    board : Board
    views : tuple of ViewRecord
        Every view, used or rejected.
    options : tuple of str
        Options of `camcal calibrate` that it was made with, where they are not the defaults.
    """

    calibration: Calibration
    intrinsics: Intrinsics
    board: Board
    views: tuple[ViewRecord, ...]
    options: tuple[str, ...]


def restore(folder: str | Path) -> Restored:
    """Read a calibration back.

    Parameters
    ----------
    folder : path
        A folder that `calibrate` wrote.

    Raises
    ------
    InputError
        If a file is missing or wrong, the camera is not of a calibration, or the files do not belong together.
    """
    where = Path(folder)
    check_is_calibration(where)
    intrinsics = load_intrinsics(where / CAMERA_FILE_NAME)
    if intrinsics.verdict is None or intrinsics.uncertainty is None or not intrinsics.free:
        raise InputError(
            f"{where / CAMERA_FILE_NAME}: a camera without its calibration (expected standard deviations, uncertainty and "
            "verdict). Name a folder that `camcal calibrate` wrote."
        )
    board = load_board(str(where / BOARD_FILE_NAME))
    views, options = load_views_and_options(where)
    table = load_corner_table(where / "corners.csv")
    _check_ids(where, table, board)
    known = _gathered(where, intrinsics, views, table)
    return Restored(_with_covariance(where, known, board), intrinsics, board, views, options)


def check_is_calibration(folder: Path) -> None:
    """Refuse what is not a folder with all files of a calibration, naming the first that is missing.

    Raises
    ------
    InputError
    """
    if not folder.is_dir():
        got = "a file" if folder.exists() else "no such folder"
        raise InputError(f"{folder}: {got} (expected a calibration's folder). Name a folder that `camcal calibrate` wrote.")
    missing = next((name for name in FILES if not (folder / name).is_file()), None)
    if missing:
        raise InputError(f"{folder / missing}: no such file. Name a folder that `camcal calibrate` wrote.")


def _check_ids(folder: Path, table: CornersTable, board: Board) -> None:
    """Refuse corners of another board."""
    largest = max((int(seen.ids[-1]) for seen in table.detections), default=0)
    if largest >= board.feature_count:
        raise InputError(
            f"{folder / 'corners.csv'}: id {largest} is not on the board of {BOARD_FILE_NAME} (got ids up to {largest}, "
            f"expected at most {board.feature_count - 1}). The files are of different calibrations: calibrate again."
        )


def _gathered(folder: Path, known: Intrinsics, views: Sequence[ViewRecord], table: CornersTable) -> Calibration:
    """Put the parts together; what is not known of the poses yet is zero."""
    used = {view.source: view for view in views if view.used and view.T_cam_board is not None}
    kept = [(seen, residual, mask) for seen, residual, mask in _rows(table) if seen.source in used and mask.any()]
    if {seen.source for seen, _, _ in kept} != used.keys() or not kept:
        odd = sorted(used.keys() ^ {seen.source for seen, _, _ in kept})
        which = odd[0] if odd else "all"
        raise InputError(
            f"{folder / 'views.yaml'}: used views without used corners in corners.csv (first: {which}). "
            "The files are of different calibrations: calibrate again."
        )
    sizes = {seen.size for seen, _, _ in kept}
    if sizes != {known.camera.size}:
        got, expected = ("{}x{}".format(*size) for size in (min(sizes - {known.camera.size}), known.camera.size))
        raise InputError(
            f"{folder / 'corners.csv'}: another image size than camera.yaml's (got {got}, "
            f"expected {expected}). The files are of different calibrations: calibrate again."
        )
    poses = [used[seen.source].T_cam_board for seen, _, _ in kept]
    return Calibration(
        camera=known.camera,
        free=known.free,
        joint_covariance=np.zeros((len(known.free) + 6, len(known.free) + 6)),
        detections=tuple(seen.take(mask) for seen, _, mask in kept),
        poses=tuple(pose for pose in poses if pose is not None),
        pose_sigmas=np.zeros((len(kept), 6)),
        residuals_px=tuple(residual[mask] for _, residual, mask in kept),
        shape=known.shape,
        outliers=_outliers(table, {view.source: view for view in views}),
        rejected=tuple(Rejected(view.source, view.reason) for view in views if not view.used),
    )


def _rows(table: CornersTable) -> Iterator[tuple[Detection, FloatArray, BoolArray]]:
    """Each view's corners, residuals and which of them were used."""
    yield from zip(table.detections, table.residuals_px, table.used, strict=True)


def _outliers(table: CornersTable, views: Mapping[str, ViewRecord]) -> tuple[Outlier, ...]:
    """Corners that were left out, each with its reason as far as views.yaml names it."""
    found = []
    for seen, residual, used in _rows(table):
        notes = views[seen.source].notes if seen.source in views else ()
        for row in np.flatnonzero(~used).tolist():
            id_ = int(seen.ids[row])
            prefix = _LEFT_OUT.format(id_)
            reason = next((note.removeprefix(prefix) for note in notes if note.startswith(prefix)), "its view does not fit")
            x, y = seen.corners_px[row].tolist()
            off_x, off_y = residual[row].tolist()
            found.append(Outlier(seen.source, id_, (x, y), float(seen.sigma_px[row]), (off_x, off_y), reason))
    return tuple(found)


def _with_covariance(folder: Path, calibration: Calibration, board: Board) -> Calibration:
    """Add what the corners leave undetermined, by linearising the residuals at the stored solution."""
    with single_threaded():
        minimum = Minimum.of(calibration, board)
        _check_residuals(folder, calibration, residuals(minimum.state, minimum.seen))
        try:
            equations = NormalEquations.build(minimum.state, minimum.seen, minimum.columns)
            found = equations.covariances(minimum.state, minimum.variance_px2)
        except np.linalg.LinAlgError:
            raise InputError(
                f"{folder}: the views do not determine the camera (singular system). Calibrate again with more views."
            ) from None
    first, shapes = len(calibration.free), len(calibration.shape.names)
    beside_shape = np.delete(np.arange(len(found.joint)), first + np.arange(shapes))
    joint = found.joint[np.ix_(beside_shape, beside_shape)]
    return replace(calibration, joint_covariance=joint, pose_sigmas=found.pose_sigmas)


def _check_residuals(folder: Path, calibration: Calibration, expected: FloatArray) -> None:
    """Refuse files that are not of one run: residuals that camera, poses and corners do not give."""
    stored = np.concatenate(calibration.residuals_px)
    off = np.abs(stored - expected).max()
    if not off <= _SAME_PX:
        raise InputError(
            f"{folder / 'corners.csv'}: residuals that camera.yaml and views.yaml do not give (off by up to {off:.3g} px). "
            "The files are of different calibrations: calibrate again."
        )
