"""What a person reads after a calibration: the parameters, what they rest on, what to look at, and what to do next."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from camcal.cli.console import print_facts, print_table
from camcal.cli.rounding import plus_minus

if TYPE_CHECKING:
    from camcal.geometry.camera import Camera
    from camcal.observations import Calibration, Intrinsics
    from camcal.workflows.calibrate import CalibrationRun

_FILES = "camera.yaml, views.yaml, corners.csv, board.yaml"
_MOST_NAMED = 2
_OUTSTANDING_RATIO = 2.0
"""A view this many times worse than the median one deserves a look."""
_NOTICEABLE_PX = 0.05
"""Below this nothing is wrong with a view, however good the others are."""


def print_calibration(run: CalibrationRun, images: Sequence[str], undistorted: bool) -> None:
    """Print a finished calibration.

    Parameters
    ----------
    run : CalibrationRun
    images : sequence of str
        The inputs as the user gave them, for the command to run next.
    undistorted : bool
        Whether the undistorted images are written already.
    """
    known, calibration = run.intrinsics, run.calibration
    horizontal, vertical, _ = known.camera.field_of_view_deg
    width, height = known.camera.size
    view = f"field of view {_angle(horizontal)} x {_angle(vertical)}"
    _print_parameters(f"{known.name}: {width}x{height} pixels, {view}", known)
    rejected = len(calibration.rejected)
    print_facts(
        {
            "RMS": f"{known.rms_px:.3g} px over {known.corners} corners",
            "views": f"{known.views} of {known.views + rejected} used" + (f", {rejected} rejected" if rejected else ""),
            "worst": _worst(calibration),
            "lens": _validity(known.camera),
            "files": f"{run.folder}: {_FILES}" + (", undistorted/" if undistorted else ""),
            "next": "" if known.problems else _next(run.folder or Path(), images, undistorted),
        }
    )


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
    if undistorted or str(images[0]).lower().endswith(".csv"):
        return shlex.join(["camcal", "verify", str(folder), "--truth"]) + " OTHER_CALIBRATION"
    named = shlex.quote(images[0]) if len(images) == 1 else "IMAGES"
    return f"camcal undistort {named} --camera {shlex.quote(str(folder / 'camera.yaml'))} -o undistorted"
