"""What to do about a capture that does not determine the camera, in words that fit what is solved for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camcal.calibration.limits import LARGEST_RMS_PX, OUTSTANDING_RATIO, OUTSTANDING_RMS_PX
from camcal.calibration.parameters import DEFAULT_DISTORTION, distortion_names
from camcal.geometry.arrays import FloatArray
from camcal.observations import Detection

_CHECK_SPEC = "Check the board's SPEC against the print."


def capture_advice(free: tuple[str, ...]) -> str:
    """Advise to tilt the board, and to free fewer coefficients where more than the usual ones are free."""
    tilt = "Tilt the board 20-45° in different directions"
    extra = set(distortion_names(free)) - set(DEFAULT_DISTORTION)
    return f"{tilt}, or free fewer coefficients with --distortion." if extra else f"{tilt}."


def outstanding_view(rms_px: FloatArray) -> int | None:
    """Index of the view that fits far worse than the others, given the RMS of each (V,); None if there is none."""
    worst = int(np.argmax(rms_px))
    return worst if rms_px[worst] > max(OUTSTANDING_RMS_PX, OUTSTANDING_RATIO * float(np.median(rms_px))) else None


def worst_view(rms_px: FloatArray, detections: Sequence[Detection], free: tuple[str, ...]) -> str:
    """Name the view that fits worst, given the RMS of each (V,), and say what to do."""
    worst, typical = int(np.argmax(rms_px)), float(np.median(rms_px))
    named = f"{detections[worst].source} fits worst (RMS {rms_px[worst]:.3g} px, {typical:.3g} px in the median view)."
    return f"{named} {fitting_advice(rms_px, free)}"


def fitting_advice(rms_px: FloatArray, free: tuple[str, ...]) -> str:
    """Say what to do about views of a given RMS each (V,): about the misfit if there is one, else about the capture."""
    if outstanding_view(rms_px) is not None:
        return "Look at that image and its corners, or leave it out."
    return _CHECK_SPEC if misfits(rms_px) else capture_advice(free)


def misfits(rms_px: FloatArray) -> bool:
    """Tell whether a view, or most of them, fit so badly that the model is not the one of the corners."""
    return outstanding_view(rms_px) is not None or float(np.median(rms_px)) > LARGEST_RMS_PX
