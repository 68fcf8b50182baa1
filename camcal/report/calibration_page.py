"""The page of a calibration: the verdict, the camera, the figures, every view, and how to do it again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from markupsafe import Markup

from camcal.observations import Outlier
from camcal.report.camera_facts import facts, glance, parameter_rows, python_code, uncertainty_rows
from camcal.report.figures.catalogue import FIGURES, FigureKind
from camcal.report.figures.rendering import render_svg
from camcal.report.figures.style import STYLES
from camcal.report.overlay import Overlay, magnification, overlay, overlay_of_outliers
from camcal.report.page import Drawing, render_page
from camcal.report.photograph import Photograph
from camcal.report.record import Record
from camcal.trust.wording import rounded as short

VIEWS_FIGURE = "view_rms"
"""The figure whose bars lead to the views."""

GROUPS = {
    "uncertainty": ("Uncertainty", "Projection uncertainty", ("uncertainty",)),
    "coverage": ("Coverage", "Coverage", ("coverage", "stance")),
    "residuals": ("Residuals", "Residuals", ("residuals", "residual_radius", "residual_histogram", "quivers")),
    "views": ("Views", "View by view", (VIEWS_FIGURE,)),
    "space": ("Space", "Boards and camera in space", ("scene",)),
    "lens": ("Lens", "Lens distortion", ("distortion",)),
    "board": ("Board", "The board, feature by feature", ("board",)),
}
"""Sections by id: their names in the navigation, their titles, and the names of their figures."""

WORDS = {
    "good": "Use it: nothing that was checked speaks against it.",
    "usable": "Use it within the limits named below.",
    "poor": "Do not measure with it before the advice below has been followed.",
    "rejected": "Do not use it.",
}
"""What each word of a verdict means for whoever wants to use the camera."""

_TO_EXPLAIN = ("poor", "rejected")
"""Words whose reason stands beside them, at the top of the page."""


@dataclass(frozen=True, slots=True)
class Making:
    """What a page tells beside the record: photographs, and how it came about.

    Attributes
    ----------
    photographs : dict of str to Photograph
        By image name, those that are shown.
    missing : str
        A sentence about photographs that are not; empty if all are.
    commands : tuple of pair of str
        What each command line does, and the command line.
    versions : dict of str to str
        Name and version of what made the page.
    made_on : str
        Date and time for people; empty to leave it out.
    """

    photographs: Mapping[str, Photograph] = field(default_factory=dict)
    missing: str = ""
    commands: tuple[tuple[str, str], ...] = ()
    versions: Mapping[str, str] = field(default_factory=dict)
    made_on: str = ""


@dataclass(frozen=True, slots=True)
class _View:
    """A view as its panel shows it."""

    index: int
    source: str
    rms: str
    facts: str
    notes: tuple[str, ...]
    overlay: Overlay
    photograph: Photograph | None


@dataclass(frozen=True, slots=True)
class _Refusal:
    """An image that gave no view."""

    source: str
    reason: str
    overlay: Overlay | None
    photograph: Photograph | None


@dataclass(frozen=True, slots=True)
class _Section:
    """Figures under one heading."""

    name: str
    label: str
    title: str
    drawings: tuple[Drawing, ...]


def calibration_page(record: Record, making: Making | None = None) -> str:
    """Build the page of a calibration.

    Parameters
    ----------
    record : Record
    making : Making, optional

    Returns
    -------
    str
        An HTML document that needs nothing but itself.

    Raises
    ------
    ValueError
        If nobody has judged the calibration.
    """
    known, made = record.intrinsics, making or Making()
    if known.verdict is None:
        raise ValueError("record: a calibration that was not judged (expected a verdict)")
    magnified = magnification(record.calibration)
    return render_page(
        "calibration.html.j2",
        {
            "title": f"{known.name}: {known.verdict.word}",
            "known": known,
            "record": record,
            "verdict": known.verdict,
            "meaning": WORDS[known.verdict.word],
            "because": known.verdict.findings[0].text if known.verdict.word in _TO_EXPLAIN else "",
            "glance": glance(record),
            "rows": parameter_rows(known),
            "facts": facts(record),
            "uncertainty": uncertainty_rows(known),
            "code": python_code(known),
            "sections": _sections(record),
            "views": _views(record, made.photographs, magnified),
            "magnified": f"{magnified:g}",
            "rejected": _rejected(record, made.photographs),
            "making": made,
        },
    )


def _sections(record: Record) -> tuple[_Section, ...]:
    """Draw every figure, once for light and dark, under the heading it belongs to."""
    kinds = {kind.name: kind for kind in FIGURES}
    return tuple(
        _Section(name, label, title, tuple(_drawing(kinds[figure], record) for figure in figures))
        for name, (label, title, figures) in GROUPS.items()
    )


def _drawing(kind: FigureKind, record: Record) -> Drawing:
    """Draw one figure."""
    svg = render_svg(kind.draw(record, STYLES["page"]), kind.name)
    return Drawing(kind.name, kind.title, Markup(svg), kind.caption(record))


def _by_source(outliers: tuple[Outlier, ...]) -> dict[str, tuple[Outlier, ...]]:
    found: dict[str, tuple[Outlier, ...]] = {}
    for outlier in outliers:
        found[outlier.source] = (*found.get(outlier.source, ()), outlier)
    return found


def _views(record: Record, photographs: Mapping[str, Photograph], magnified: float) -> tuple[_View, ...]:
    """Every used view, the worst first."""
    calibration = record.calibration
    left_out = _by_source(calibration.outliers)
    points = record.board.object_points
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    views = []
    for index, (seen, pose, rms) in enumerate(
        zip(calibration.detections, calibration.poses, calibration.view_rms_px, strict=True)
    ):
        distance = float(np.linalg.norm(pose.apply(centre)))
        tilt = math.degrees(math.acos(min(1.0, abs(float(pose.R[2, 2])))))
        outliers = left_out.get(seen.source, ())
        more = f", {len(outliers)} left out" if outliers else ""
        told = f"{len(seen)} corners{more}, {short(distance)} m away, tilted by {tilt:.0f}°"
        drawn = overlay(calibration, index, outliers, magnified)
        notes = tuple(record.notes.get(seen.source, ()))
        views.append((-rms, _View(index, seen.source, f"{rms:.3g}", told, notes, drawn, photographs.get(seen.source))))
    return tuple(view for _, view in sorted(views, key=lambda pair: (pair[0], pair[1].index)))


def _rejected(record: Record, photographs: Mapping[str, Photograph]) -> tuple[_Refusal, ...]:
    """Every image that gave no view."""
    calibration = record.calibration
    left_out = _by_source(calibration.outliers)
    return tuple(
        _Refusal(
            rejection.source,
            rejection.reason,
            overlay_of_outliers(calibration.camera.size, left_out[rejection.source]) if rejection.source in left_out else None,
            photographs.get(rejection.source),
        )
        for rejection in calibration.rejected
    )
