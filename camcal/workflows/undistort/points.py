"""A CSV file of points through a lens, either way, exactly."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from camcal.errors import InputError
from camcal.formats.images import EXTENSIONS
from camcal.formats.imaging.unread import UNREAD
from camcal.formats.points_file import PointsTable, load_points, save_points
from camcal.formats.text import shown
from camcal.geometry.arrays import FloatArray
from camcal.records import Intrinsics
from camcal.undistortion.points import undistort_points
from camcal.workflows.reporting import Reporter
from camcal.workflows.undistort.companions import Companions, camera_of_results, warn_of_doubtful
from camcal.workflows.undistort.geometry import Geometry
from camcal.workflows.undistort.inputs import VIDEOS
from camcal.workflows.undistort.plan import Place, is_file_name, refuse_lost_cameras, refuse_mistyped, refuse_replacing
from camcal.workflows.undistort.run import Undistortion
from camcal.workflows.undistort.work import Job

POINTS_EXTENSION = ".csv"

_SIDES = ("width", "height")


def undistort_points_file(
    source: Path,
    output: str | Path,
    known: Intrinsics,
    geometry: Geometry,
    cameras_in_use: Iterable[Path | None],
    *,
    dry_run: bool,
    force: bool,
    reporter: Reporter,
) -> Undistortion:
    """Do what `undistort` does for a file of points.

    Raises
    ------
    InputError
        If the file cannot be used, is of images of another size than the camera's, or the result cannot be written.
    """
    table = load_points(source)
    cameras = geometry.cameras(known.camera)
    _check_size(table, cameras.source.size)
    place = _place(output)
    refuse_lost_cameras(place, cameras_in_use)
    target = place.file or place.folder / source.name
    job = Job(source, target, target.name, named=True)
    refuse_replacing([job])
    place.refuse_used(force=force, resume=False)
    companions = Companions(place, camera_of_results(known, cameras))
    points = undistort_points(table.points_px, cameras.source, cameras.target)
    warnings = _warnings(table, points)
    if not dry_run:
        place.claim()
        warn_of_doubtful(companions.withdraw(None, "", (target.name,)), reporter)
        save_points(target, table, points, dict(zip(_SIDES, map(str, cameras.target.size), strict=True)))
        for warning in warnings:
            reporter.warn(warning)
        companions.write()
    return Undistortion(place.folder, place.camera_file, cameras.target, (job,), warnings=warnings)


def _place(output: str | Path) -> Place:
    """Tell whether the output is a folder or a file of points; refuse a file of something else."""
    path = Path(output)
    if is_file_name(output, (POINTS_EXTENSION,)):
        return Place(path.parent, path)
    if is_file_name(output, EXTENSIONS | VIDEOS | UNREAD):
        raise InputError(
            f"{path}: no file of points (got '{path.suffix}', expected {POINTS_EXTENSION}). "
            f"Name a file such as {path.stem}{POINTS_EXTENSION}, or a folder."
        )
    refuse_mistyped(output, (POINTS_EXTENSION,))
    return Place(path)


def _warnings(table: PointsTable, points_px: FloatArray) -> tuple[str, ...]:
    """Say which points have no place in the result."""
    lost = np.flatnonzero(np.isnan(points_px[:, 0]) & ~np.isnan(table.points_px).any(axis=1))
    if not lost.size:
        return ()
    points = "point lies" if lost.size == 1 else "points lie"
    where = f"empty cells, first on line {table.lines[int(lost[0])]}"
    return (f"{table.path}: {lost.size} {points} past the fold of a lens ({where}).",)


def _check_size(table: PointsTable, size: tuple[int, int]) -> None:
    """Refuse points of an image of another size, where the table has columns for it."""
    for name, side in zip(_SIDES, size, strict=True):
        column = table.column(name)
        if column is None:
            continue
        for row, line in zip(table.rows, table.lines, strict=True):
            if row[column].strip() != str(side):
                raise InputError(
                    f"{table.path}:{line}: {name}: not the camera's (got {shown(row[column])}, expected {side}). "
                    "Use the camera file that was calibrated at this size."
                )
