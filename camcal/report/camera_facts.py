"""What a page says of a camera in figures and words: its parameters, what they rest on, and how well it is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

from camcal.records import ImageSigma, Intrinsics
from camcal.report.lens import lens_words
from camcal.report.record import Record
from camcal.rounding import rounded, spread
from camcal.trust.wording import listed
from camcal.trust.wording import rounded as short

_MEANINGS = {
    "fx": ("focal length along x", "px"),
    "fy": ("focal length along y", "px"),
    "cx": ("principal point, x", "px"),
    "cy": ("principal point, y", "px"),
    "skew": ("skew of the pixel axes", "px"),
    "p1": ("tangential", ""),
    "p2": ("tangential", ""),
}
_SHAPES = {
    "bow_x": ("bow along x", 1000, " mm"),
    "bow_y": ("bow along y", 1000, " mm"),
    "stretch": ("stretch along y", 100, " %"),
}


@dataclass(frozen=True, slots=True)
class Row:
    """An intrinsic as the table shows it."""

    name: str
    value: str
    sigma: str
    unit: str
    meaning: str


def glance(record: Record) -> dict[str, str]:
    """The few figures that stand at the top."""
    known = record.intrinsics
    views = known.views + len(record.calibration.rejected)
    shown = {"fit (RMS)": f"{known.rms_px:.3g} px", "views": f"{known.views} of {views}"}
    if known.uncertainty is not None:
        near = known.uncertainty.at_range
        shown["σ in the middle"] = _pixels(near.centre_px)
        shown["σ in the corners"] = _pixels(*near.corners_px)
        shown["σ below 0.5 px"] = f"{100 * near.shares[1]:.0f} % of the image"
    return shown


def _pixels(*sigmas: float) -> str:
    """Write the largest of some standard deviations."""
    largest = _largest(sigmas)
    return largest if largest == "no ray" else f"{largest} px"


def parameter_rows(known: Intrinsics) -> tuple[Row, ...]:
    """Every intrinsic that was solved for or is not zero, rounded to what is known of it."""
    sigma = known.sigma
    rows = []
    for name, value in zip(known.camera.intrinsic_names, known.camera.intrinsics.tolist(), strict=True):
        if name not in sigma and not value:
            continue
        off = sigma.get(name, math.nan)
        meaning, unit = _MEANINGS.get(name, ("radial", ""))
        rows.append(Row(name, rounded(value, off), "held" if math.isnan(off) else f"± {spread(off)}", unit, meaning))
    return tuple(rows)


def facts(record: Record) -> dict[str, str]:
    """Return what is said of the camera beside its parameters, by name."""
    known, calibration = record.intrinsics, record.calibration
    width, height = known.camera.size
    views = known.views + len(calibration.rejected)
    left_out = len(calibration.outliers)
    said = {
        "Image": f"{width} × {height} px",
        "Field of view": _field_of_view(known),
        "Distortion": lens_words(known.camera).text,
        "Valid": _validity(known),
        "RMS": f"{known.rms_px:.3g} px over {known.corners} corners" + (f", {left_out} left out" if left_out else ""),
        "Views": f"{known.views} of {views} used",
        "Board": known.board,
        "Board's shape": _shape(known),
        "Cross-check": _cross_check(known.cross_validation),
    }
    return {name: fact for name, fact in said.items() if fact}


def _cross_check(ratio: float) -> str:
    """What the comparison of halves of the views means."""
    if math.isnan(ratio):
        return ""
    return f"halves of the views, solved apart, differ by {ratio:.2g} × the prediction (1 is honest, 2 too much)"


def _field_of_view(known: Intrinsics) -> str:
    """Angles across the image."""
    names = ("horizontal", "vertical", "diagonal")
    angles = dict(zip(names, known.camera.field_of_view_deg, strict=True))
    parts = [f"{angle:.1f}° {name}" for name, angle in angles.items() if not math.isnan(angle)]
    unknown = [name for name, angle in angles.items() if math.isnan(angle)]
    known_ones = ", ".join(parts)
    if not unknown:
        return known_ones
    return f"{known_ones + '; ' if parts else ''}{listed(unknown)} unknown: the lens model ends before the image does"


def _validity(known: Intrinsics) -> str:
    """How far the lens model goes."""
    (width, height), K, radius = known.camera.size, known.camera.K, known.camera.valid_radius_px
    across = max(K[0, 2] + 0.5, width - 0.5 - K[0, 2]), max(K[1, 2] + 0.5, height - 0.5 - K[1, 2])
    reach = math.hypot(*across)
    if radius >= reach:
        return "over the whole image"
    return f"up to {radius:.0f} px from the principal point, where the lens model turns back; the image reaches {reach:.0f} px"


def _shape(known: Intrinsics) -> str:
    """How the board differs from a flat and true print, if that was solved for."""
    parts = []
    for name, value, sigma in zip(known.shape.names, known.shape.values.tolist(), known.shape.sigma.tolist(), strict=True):
        words, factor, unit = _SHAPES[name]
        parts.append(f"{words} {rounded(factor * value, factor * sigma)} ± {spread(factor * sigma)}{unit}")
    return ", ".join(parts)


def uncertainty_rows(known: Intrinsics) -> tuple[tuple[str, ...], ...]:
    """Where a point is seen is known to: a row at the boards' range, one at infinity."""
    if known.uncertainty is None:
        return ()

    def cells(sigma: ImageSigma) -> tuple[str, ...]:
        places = ((sigma.centre_px,), sigma.edges_px, sigma.corners_px)
        return (*(_largest(values) for values in places), *(f"{100 * share:.0f} %" for share in sigma.shares))

    near, far = known.uncertainty.at_range, known.uncertainty.at_infinity
    return ((f"at the boards' {known.uncertainty.range_m:.3g} m", *cells(near)), ("at infinity", *cells(far)))


def _largest(values: tuple[float, ...]) -> str:
    finite = [value for value in values if not math.isnan(value)]
    return short(max(finite)) if finite else "no ray"


def python_code(known: Intrinsics) -> str:
    """The camera as Python text, every bit of it."""
    count = 8 if known.camera.dist[5:].any() else 5
    rows = ",\n              ".join(str(row) for row in known.camera.K.tolist())
    return f"K = np.array([{rows}])\ndist = np.array({known.camera.dist[:count].tolist()})"
