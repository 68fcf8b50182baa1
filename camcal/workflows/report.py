"""`camcal report`: the page and the figures of a calibration, made from the files of its folder."""

from __future__ import annotations

import datetime
import os
import platform
import re
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import camcal
from camcal.errors import CamcalError, InputError
from camcal.formats.output import claim_file, claim_folder, write_atomically
from camcal.formats.page_file import claim_page
from camcal.report.record import Record
from camcal.workflows.photographs import photographs, places
from camcal.workflows.reporting import LogReporter, Reporter
from camcal.workflows.restore import Restored, check_is_calibration, restore

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPORT_FILE_NAME = "report.html"
PLOT_FORMATS = ("png", "svg", "pdf")
"""What figures are written as."""
VIEW_PLOTS = "views"
"""Where among the figures those of single views are."""
_PLOT_DPI = 200
_UNSAFE = re.compile(r"[^A-Za-z0-9_-]+")


@dataclass(frozen=True, slots=True)
class Report:
    """What `make_report` wrote.

    Attributes
    ----------
    page : Path
    plots : tuple of Path
        Files with figures.
    missing : str
        A sentence about photographs that are not; empty if all are.
    """

    page: Path
    plots: tuple[Path, ...]
    missing: str


def make_report(
    folder: str | Path,
    output: str | Path | None = None,
    *,
    images: str | Path | None = None,
    plots: str | Path | None = None,
    plot_formats: Sequence[str] = PLOT_FORMATS,
    force: bool = False,
    jobs: int | None = None,
    reporter: Reporter | None = None,
) -> Report:
    """Make the page of a calibration from the files of its folder.

    Nothing is detected or solved: the same files give the same page, its date excepted.

    Parameters
    ----------
    folder : path
        What `calibrate` wrote.
    output : path, optional
        File to write; by default `report.html` in the folder, where an earlier page is replaced.
    images : path, optional
        Folder with the photographs, where they are not where views.yaml says.
    plots : path, optional
        Folder to which every figure is written as well, for papers.
    plot_formats : sequence of str
        Formats of these, some of `PLOT_FORMATS`.
    force : bool
        Whether an output file that exists is replaced and a folder that has files is written into.
    jobs : int, optional
        Photographs worked on at once; all processors by default.
    reporter : Reporter, optional

    Returns
    -------
    Report

    Raises
    ------
    InputError
        If a file of the folder is missing or wrong, or the output cannot be written.

    Examples
    --------
    >>> import tempfile, camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> turns = [(0.5, 0, 0), (-0.5, 0, 0), (0, 0.5, 0), (0, -0.5, 0), (0.4, 0.4, 0), (-0.4, 0.3, 0.1)]
    >>> poses = [camcal.Pose.from_rvec(turn, (-0.06, -0.05, 0.25)) for turn in turns]
    >>> images = [camcal.render(camera, "checkerboard:7x6:20mm", pose) for pose in poses]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = camcal.calibrate(images, "checkerboard:7x6:20mm", f"{folder}/calib", report=False)
    ...     camcal.make_report(f"{folder}/calib").page.name
    'report.html'
    """
    reporter = reporter or LogReporter()
    where = Path(folder)
    check_is_calibration(where)
    if images is not None and not Path(images).is_dir():
        raise InputError(f"--images: no such folder (got {images}). Name the folder that holds the photographs.")
    if output is None and not force:
        page = claim_page(where / REPORT_FILE_NAME)
    else:
        page = claim_file(output or where / REPORT_FILE_NAME, force=force)
    figures = None if plots is None else claim_plots(plots, plot_formats, force=force)
    restored = restore(where)
    missing = write_report(restored, where, page, images=images, jobs=jobs, reporter=reporter)
    written = () if figures is None else write_plots(restored, figures, plot_formats, reporter)
    return Report(page, written, missing)


def claim_figures(folder: Path | None, *, plots: str | Path | None, formats: Sequence[str], force: bool) -> Path | None:
    """Make sure that the figures of a calibration about to be made can be written; return their folder.

    Raises
    ------
    InputError
    """
    if folder is None and plots is not None:
        raise InputError("plots: needs an output folder (got none). Pass one, or no plots.")
    return None if plots is None else claim_plots(plots, formats, force=force)


def show_calibration(
    folder: Path, *, page: bool, figures: Path | None, formats: Sequence[str], jobs: int | None, reporter: Reporter
) -> None:
    """Write the page and the figures of a calibration just made, from its files as `make_report` does.

    The calibration stands, even if something is in the way of showing it: then a warning says what.
    """
    if not page and figures is None:
        return
    try:
        restored = restore(folder)
        if page:
            write_report(restored, folder, folder / REPORT_FILE_NAME, images=None, jobs=jobs, reporter=reporter)
        if figures is not None:
            write_plots(restored, figures, formats, reporter)
    except CamcalError as error:
        reporter.warn(f"report not complete: {error}")


def now() -> str:
    """Return the date and time for people."""
    return datetime.datetime.now().astimezone().strftime("%Y-%m-%d %H:%M")


def claim_plots(folder: str | Path, formats: Sequence[str], *, force: bool) -> Path:
    """Make sure that figures may be written to a folder in these formats.

    Raises
    ------
    InputError
    """
    for name in formats:
        if name not in PLOT_FORMATS:
            raise InputError(f"--plots-format: unknown (got {name!r}, expected some of {', '.join(PLOT_FORMATS)}).")
    return claim_folder(folder, force=force)


def write_report(
    restored: Restored, folder: Path, page: Path, *, images: str | Path | None, jobs: int | None, reporter: Reporter
) -> str:
    """Write the page of a calibration that has been read back; returns a sentence about photographs that are not on it."""
    # matplotlib and jinja2 take their time to import.
    from camcal.report.calibration_page import Making, calibration_page

    shown = photographs(restored.calibration, places(restored.views, folder, images), jobs=jobs, reporter=reporter)
    making = Making(
        photographs=shown.photographs,
        missing=shown.missing,
        commands=commands(restored),
        versions=_versions(),
        made_on=now(),
    )
    with reporter.progress("Drawing the report", None):
        write_atomically(page, calibration_page(record_of(restored), making))
    return shown.missing


def write_plots(restored: Restored, folder: Path, formats: Sequence[str], reporter: Reporter) -> tuple[Path, ...]:
    """Write every figure in every format, in the style of a printed paper; those of single views go to `views/`."""
    from camcal.report.figures.catalogue import FIGURES
    from camcal.report.figures.rendering import render
    from camcal.report.figures.style import STYLES
    from camcal.report.figures.view import view_quiver

    record, style = record_of(restored), STYLES["paper"]
    views = claim_folder(folder / VIEW_PLOTS, force=True)
    drawings: list[tuple[Path, Callable[[], Figure]]] = [
        (folder / kind.name, partial(kind.draw, record, style)) for kind in FIGURES
    ]
    drawings += [
        (views / _file_name(index, seen.source), partial(view_quiver, record, index, style))
        for index, seen in enumerate(record.calibration.detections)
    ]
    written = []
    with reporter.progress("Figures", len(drawings)) as advance:
        for path, draw in drawings:
            figure = draw()
            for name in formats:
                file = path.with_name(f"{path.name}.{name}")
                write_atomically(file, render(figure, name, dpi=_PLOT_DPI))
                written.append(file)
            advance()
    return tuple(written)


def _file_name(index: int, source: str) -> str:
    """Name the file of a view so that it sorts as the views do, and any system takes it."""
    return f"{index:03d}_{_UNSAFE.sub('_', Path(source).stem)}"


def record_of(restored: Restored) -> Record:
    """Put together what the page and the figures take."""
    options = shlex.join(restored.options) or "the defaults"
    return Record(
        calibration=restored.calibration,
        intrinsics=restored.intrinsics,
        board=restored.board,
        notes={view.source: view.notes for view in restored.views if view.used and view.notes},
        settings={
            "Board": restored.board.spec,
            "Solved for": ", ".join((*restored.intrinsics.free, *restored.intrinsics.shape.names)),
            "Options": options,
        },
    )


def commands(restored: Restored) -> tuple[tuple[str, str], ...]:
    """Return the command lines that give the calibration again, to be run in its folder.

    From the photographs if all that is known of them lies in one folder, and from the corners in any case.
    """
    options = list(restored.options)
    named = [] if restored.intrinsics.name == "camera" else ["--name", restored.intrinsics.name]
    found = []
    folders = sorted({os.path.dirname(view.path) for view in restored.views if view.path})  # noqa: PTH120 - not of this system
    if folders and all(view.path for view in restored.views) and "--only-used" not in options:
        line = ["camcal", "calibrate", *(name or "." for name in folders), "--board", "board.yaml", *options, *named]
        found.append(("From the photographs, in this calibration's folder:", shlex.join([*line, "-o", "again"])))
    line = ["camcal", "calibrate", "corners.csv", "--board", "board.yaml", *_without_refinement(options), *named]
    found.append(("From the corners alone, in the same folder:", shlex.join([*line, "-o", "again"])))
    found.append(("This page, in the same folder:", "camcal report ."))
    return tuple(found)


def _without_refinement(options: Sequence[str]) -> list[str]:
    """Leave out how corners are refined, which says nothing where they are given."""
    text = re.sub(r"(^|\0)--refine\0[^\0]*", "", "\0".join(options)).removeprefix("\0")
    return text.split("\0") if text else []


def _versions() -> dict[str, str]:
    """What made the page."""
    import cv2
    import matplotlib as mpl
    import numpy as np

    libraries = f"OpenCV {cv2.__version__}, numpy {np.__version__}, matplotlib {mpl.__version__}"
    return {"Versions": f"camcal {camcal.__version__}, {libraries}, Python {platform.python_version()}, {platform.system()}"}
