"""What a person reads after a calibration: the parameters, what they rest on, what to look at, and what to do next."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from camcal.cli import style
from camcal.cli.console import print_facts, print_table, say
from camcal.cli.width import wrapped, wrapped_command
from camcal.rounding import plus_minus

if TYPE_CHECKING:
    from camcal.geometry.camera import Camera
    from camcal.observations import Calibration
    from camcal.records import BoardShape, Intrinsics, Uncertainty
    from camcal.verdict import Verdict
    from camcal.workflows.calibrate import CalibrationRun

_FILES = "camera.yaml, views.yaml, corners.csv, board.yaml"
_MOST_NAMED = 2
_OUTSTANDING_RATIO = 2.0
"""A view this many times worse than the median one deserves a look."""
_MOST_FINDINGS = 3
_INDENT = 7
"""Columns that the names of the facts take, with the space behind them."""
_KNOWN_HEADER = ("", "centre", "edges", "corners", "< 0.1", "< 0.5", "< 1 px")
_SHAPE_WORDS = {"bow_x": "bow along x", "bow_y": "bow along y", "stretch": "stretch along y"}
_NOTICEABLE_PX = 0.05
"""Below this nothing is wrong with a view, however good the others are."""


def print_calibration(run: CalibrationRun, images: Sequence[str], *, undistorted: bool = False, report: bool = False) -> None:
    """Print a finished calibration.

    Parameters
    ----------
    run : CalibrationRun
    images : sequence of str
        The inputs as the user gave them, for the command to run next.
    undistorted : bool
        Whether the undistorted images are written already.
    report : bool
        Whether the report is.
    """
    known, calibration = run.intrinsics, run.calibration
    horizontal, vertical, _ = known.camera.field_of_view_deg
    width, height = known.camera.size
    view = f"field of view {_angle(horizontal)} x {_angle(vertical)}"
    _print_parameters(f"{known.name}: {width}x{height} pixels, {view}", known)
    _print_known(run.assessment.uncertainty)
    rejected = len(calibration.rejected)
    print_facts(
        {
            "RMS": f"{known.rms_px:.3g} px over {known.corners} corners",
            "views": f"{known.views} of {known.views + rejected} used" + (f", {rejected} rejected" if rejected else ""),
            "worst": _worst(calibration),
            "lens": _validity(known.camera),
            "board": _shape(known.shape),
            "check": _cross_check(known.cross_validation),
            "files": f"{run.folder}: {_FILES}"
            + (", report.html" if report else "")
            + (", undistorted/" if undistorted else ""),
            "next": "" if known.problems else _next(run.folder or Path(), images, undistorted),
        }
    )
    print_verdict(run.verdict)
    if run.twin is not None:
        from camcal.cli.twin_table import print_twin

        say("")
        print_twin(run.twin)


def print_verdict(verdict: Verdict) -> None:
    """Print the word, and the findings that decide it, each with what to do."""
    say("\n" + style.heading("verdict: ") + style.level(verdict.word))
    shown = verdict.findings[:_MOST_FINDINGS]
    for finding in shown:
        # Marked after it is wrapped: what a mark adds has no width.
        say(wrapped(str(finding), f"- {finding.level}: ", "  ").replace(finding.level, style.level(finding.level), 1))
    more = len(verdict.findings) - len(shown)
    if more:
        say(f"  ({more} more {'finding' if more == 1 else 'findings'} in camera.yaml)")


def _angle(degrees: float) -> str:
    """Write an angle; where the lens model has turned back within the image there is none."""
    return "unknown" if math.isnan(degrees) else f"{degrees:.1f}°"


def _print_parameters(title: str, known: Intrinsics) -> None:
    """Print what was solved for: pixels on the left, the lens on the right."""
    from camcal.geometry.camera import PINHOLE_NAMES

    values = dict(zip(known.camera.intrinsic_names, known.camera.intrinsics.tolist(), strict=True))
    sigma = known.sigma
    groups = (
        [name for name in known.free if name in PINHOLE_NAMES],
        [name for name in known.free if name not in PINHOLE_NAMES],
    )
    blocks = [list(zip(names, plus_minus([(values[name], sigma[name]) for name in names]), strict=True)) for names in groups]
    pinhole, lens = blocks
    if not lens:
        print_table(title, ("", "px ± std. dev."), pinhole)
        return
    count = max(len(pinhole), len(lens))
    padded = [block + [("", "")] * (count - len(block)) for block in blocks]
    rows = [(*left, *right) for left, right in zip(*padded, strict=True)]
    print_table(title, ("", "px ± std. dev.", "  ", "distortion ± std. dev."), rows, left=(0, 2))


def _worst(calibration: Calibration) -> str:
    """Name the worst views if they stand out."""
    by_rms = sorted(
        ((rms, seen.source) for rms, seen in zip(calibration.view_rms_px, calibration.detections, strict=True)), reverse=True
    )
    typical = by_rms[len(by_rms) // 2][0]
    limit = max(_OUTSTANDING_RATIO * typical, _NOTICEABLE_PX)
    named = [f"{source} {rms:.2g} px" for rms, source in by_rms[:_MOST_NAMED] if rms > limit]
    return f"{', '.join(named)} (median {typical:.2g} px)" if named else ""


def _shape(shape: BoardShape) -> str:
    """Say how the board differs from a flat and true print, if that was solved for."""
    parts = []
    for name, value, sigma in zip(shape.names, shape.values.tolist(), shape.sigma.tolist(), strict=True):
        factor, unit = (100, " %") if name == "stretch" else (1000, " mm")
        (text,) = plus_minus([(factor * value, factor * sigma)])
        parts.append(f"{_SHAPE_WORDS[name]} {text}{unit}")
    return ", ".join(parts)


def _print_known(known: Uncertainty) -> None:
    """Print how well it is known where a point is seen, over the image."""
    rows = []
    for label, sigma in ((f"at the boards' {known.range_m:.3g} m", known.at_range), ("at infinity", known.at_infinity)):
        places = ([sigma.centre_px], sigma.edges_px, sigma.corners_px)
        shares = (f"{100 * share:.0f} %" for share in sigma.shares)
        rows.append((label, *(_largest(values) for values in places), *shares))
    print_table("Where a point is seen is known to (px, share of the image)", _KNOWN_HEADER, rows)


def _largest(values: Sequence[float]) -> str:
    """Write the largest of some standard deviations; those of places without a ray do not count."""
    finite = [value for value in values if not math.isnan(value)]
    return f"{max(finite):.2g}" if finite else "no ray"


def _cross_check(ratio: float) -> str:
    """Say what the comparison of halves of the views means."""
    if math.isnan(ratio):
        return ""
    return f"halves of the views differ by {ratio:.2g} x the prediction (1 is honest)"


def _validity(camera: Camera) -> str:
    """Say where the lens model turns back, if that is within the image."""
    (width, height), centre_u, centre_v = camera.size, camera.K[0, 2], camera.K[1, 2]
    reach = math.hypot(
        max(centre_u + 0.5, width - 0.5 - centre_u),
        max(centre_v + 0.5, height - 0.5 - centre_v),
    )
    radius = camera.valid_radius_px
    if radius >= reach:
        return ""
    return f"model valid up to {radius:.0f} px from the principal point; the image reaches {reach:.0f} px"


def _next(folder: Path, images: Sequence[str], undistorted: bool) -> str:
    """Return the command to run next: the images without their lens, else the check against another calibration."""
    from camcal.formats.corner_exchange.table import is_corners_path

    if undistorted or is_corners_path(images[0]):
        return _command("verify", shlex.quote(str(folder)), "--truth OTHER_CALIBRATION")
    named = shlex.quote(images[0]) if len(images) == 1 else "IMAGES"
    return _command("undistort", named, f"--camera {shlex.quote(str(folder / 'camera.yaml'))}", "-o undistorted")


def _command(name: str, argument: str, *options: str) -> str:
    """Write a command as it fits under the other facts."""
    return wrapped_command([f"camcal {name} {argument}", *options], indent=_INDENT)
