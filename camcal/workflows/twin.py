"""`camcal calibrate --twin`: the user's own capture rendered anew with known truth, and calibrated from its pixels.

A twin has the camera, the board and the poses that the photographs' calibration found, and the blur, sharpening, noise,
grey levels and light measured in each photograph. It renders what the model says: a bent board, a lens of another kind or
a shutter that rolls is not in it. So its error is what the noise of the pixels does to this very capture, found by doing it.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camcal.boards.base import Board
from camcal.compare.projection import projection_difference
from camcal.compare.twins import TwinErrors, twin_errors
from camcal.errors import CamcalError, InputError
from camcal.formats.images import ImageFile, write_image
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Calibration, Image
from camcal.records import Intrinsics
from camcal.refinement.look import Look
from camcal.synthesis.psf import sharpened
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light, Sensor
from camcal.synthesis.sensor import expose
from camcal.workflows.looks import measured_looks
from camcal.workflows.parallel import each
from camcal.workflows.reporting import LogReporter, Reporter

_LEVELS = 255
_PIXEL_VARIANCE = 1 / 12
_LEFT_OUT = "it did not fit the other views"

Recalibrate = Callable[[Path], Calibration]
"""Calibrates a folder of images as the photographs were."""


@dataclass(frozen=True, slots=True)
class Twin:
    """What the twins of a capture came to.

    Attributes
    ----------
    count : int
        How many were rendered.
    errors : TwinErrors or None
        What those that could be calibrated got wrong; None if none could.
    failures : tuple of str
        Why the others could not.
    rms_px, photographs_rms_px : float
        RMS reprojection error of the twins (mean) and of the photographs, pixels: what the latter has more than the former
        is not noise of the pixels. NaN if no twin could be calibrated.
    corners : float
        Corners in a twin's solve (mean). A twin also sees those that a hand or a reflection hides in a photograph.
    photographs_corners : int
    lost : dict of str to str
        By view, in how many twins it could not be used, and why in the first of them.
    """

    count: int
    errors: TwinErrors | None
    failures: tuple[str, ...]
    rms_px: float
    photographs_rms_px: float
    corners: float
    photographs_corners: int
    lost: Mapping[str, str]

    def as_dict(self) -> dict[str, object]:
        """Return everything as plain values, for JSON."""
        return {
            "count": self.count,
            "failures": list(self.failures),
            "rms_px": self.rms_px,
            "photographs_rms_px": self.photographs_rms_px,
            "corners": self.corners,
            "photographs_corners": self.photographs_corners,
            "lost": dict(self.lost),
            "errors": None if self.errors is None else self.errors.as_dict(),
        }


def run_twins(
    calibration: Calibration,
    board: Board,
    found: Sequence[ImageFile],
    recalibrate: Recalibrate,
    count: int,
    *,
    seed: int = 0,
    jobs: int | None = None,
    reporter: Reporter | None = None,
) -> Twin:
    """Render a capture `count` times with other noise, calibrate each, and compare with the camera it was rendered with.

    One twin at a time lies in a temporary folder, as uncompressed images.

    Parameters
    ----------
    calibration : Calibration
        Of the photographs.
    board : Board
    found : sequence of ImageFile
        The photographs; those that the calibration used are read once more to measure what they look like.
    recalibrate : callable
        Calibrates a folder of images with the options of the photographs' calibration.
    count : int
    seed : int
        Twin i draws the noise of view j only from child (i, j) of this seed, so that parallel work changes no bit.
    jobs : int, optional
        Images worked on at once; all processors by default.
    reporter : Reporter, optional

    Returns
    -------
    Twin
        A twin that cannot be calibrated is a result as well: its reason is among the `failures`.

    Raises
    ------
    InputError
        If the count is below 1, a photograph cannot be read again, or the temporary folder cannot be written.
    """
    if count < 1:
        raise InputError(f"--twin: too few (got {count}, expected at least 1).")
    reporter = reporter or LogReporter()
    with reporter.progress("Measuring blur", None):
        looks = measured_looks(calibration, board, found, jobs)
    if not looks:
        blind = _Outcome(None, "no corner of the photographs could be fitted, so their blur and noise are not known", {})
        return _gathered(calibration, [blind] * count)
    capture = _Capture(calibration, board, looks, seed)
    outcomes = []
    with reporter.progress("Twins", count) as advance:
        for nth in range(count):
            outcomes.append(_one_twin(capture, nth, recalibrate, jobs))
            advance()
    return _gathered(calibration, outcomes)


def render_look(camera: Camera, board: Board, T_cam_board: Pose, look: Look, rng: np.random.Generator) -> Image:
    """Render a view that looks like a photograph: blurred, sharpened, lit, noisy, clipped and rounded as that is.

    Parameters
    ----------
    camera : Camera
    board : Board
    T_cam_board : Pose
    look : Look
    rng : numpy.random.Generator
        Of the noise.

    Returns
    -------
    ndarray of shape (height, width)
        uint8 or uint16.

    Raises
    ------
    InputError
        If the board is not wholly in front of the camera, or turns its back to it.
    """
    light = Light(
        white=look.paper,
        black=look.ink,
        background=look.background,
        gradient=look.gradient,
        gradient_direction_deg=look.gradient_direction_deg,
    )
    ideal = render_ideal(camera, board, T_cam_board, light, blur_sigma_px=look.blur_sigma_px)
    ideal = sharpened(ideal, float(np.sqrt(look.blur_sigma_px**2 + _PIXEL_VARIANCE)), look.overshoot)
    return expose(ideal, Sensor(read_noise_levels=look.noise * _LEVELS, bits=look.bits), rng)


@dataclass(frozen=True, slots=True)
class _Capture:
    """What is rendered: the views of a calibration with the look of their photographs, and the seed of the noise."""

    calibration: Calibration
    board: Board
    looks: Sequence[Look]
    seed: int

    def write(self, folder: Path, nth: int, jobs: int | None) -> dict[str, str]:
        """Render twin `nth` into a folder: by file name, why a view could not be rendered, or nothing."""
        poses = self.calibration.poses
        # The files sort as the photographs do, whatever those are called.
        files = [f"view_{index:06d}.pgm" for index in range(len(poses))]

        def render(index: int) -> str:
            rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(nth, index)))
            try:
                image = render_look(self.calibration.camera, self.board, poses[index], self.looks[index], rng)
            except InputError as error:
                return str(error)
            write_image(folder / files[index], image)
            return ""

        return dict(zip(files, each(render, range(len(files)), jobs, lambda: None), strict=True))


@dataclass(frozen=True, slots=True)
class _Outcome:
    """One twin: its calibration or why there is none, and the reason for each view that it lost, by source."""

    calibration: Calibration | None
    failure: str
    lost: Mapping[str, str]


def _one_twin(capture: _Capture, nth: int, recalibrate: Recalibrate, jobs: int | None) -> _Outcome:
    """Render a twin and calibrate it."""
    truth = capture.calibration
    with tempfile.TemporaryDirectory(prefix="camcal-twin-") as name:
        reasons = capture.write(Path(name), nth, jobs)
        sources = dict(zip(reasons, (view.source for view in truth.detections), strict=True))
        unseen = {sources[file]: reason for file, reason in reasons.items() if reason}
        if len(unseen) == len(sources):
            return _Outcome(None, f"no view can be rendered ({next(iter(unseen.values()))})", unseen)
        try:
            again = recalibrate(Path(name))
            # A lens that has no pixel in common with the true one is no calibration either.
            projection_difference(truth.camera, again.camera)
        except CamcalError as error:
            return _Outcome(None, str(error), unseen)
    used = {seen.source for seen in again.detections}
    why = reasons | {rejection.source: rejection.reason for rejection in again.rejected}
    return _Outcome(again, "", {source: why[file] or _LEFT_OUT for file, source in sources.items() if file not in used})


def _gathered(calibration: Calibration, outcomes: Sequence[_Outcome]) -> Twin:
    """Put the outcomes of all twins together."""
    solved = [outcome.calibration for outcome in outcomes if outcome.calibration is not None]
    times = Counter(source for outcome in outcomes for source in outcome.lost)
    first = {source: reason for outcome in reversed(outcomes) for source, reason in outcome.lost.items()}
    return Twin(
        count=len(outcomes),
        errors=twin_errors(_known(calibration), [_known(again) for again in solved]) if solved else None,
        failures=tuple(outcome.failure for outcome in outcomes if outcome.calibration is None),
        rms_px=_mean([again.rms_px for again in solved]),
        photographs_rms_px=calibration.rms_px,
        corners=_mean([again.corner_count for again in solved]),
        photographs_corners=calibration.corner_count,
        lost={source: f"{times[source]} of {len(outcomes)}: {first[source]}" for source in sorted(first)},
    )


def _known(calibration: Calibration) -> Intrinsics:
    """Return the camera and how well it is known."""
    return Intrinsics(calibration.camera, free=calibration.free, covariance=calibration.covariance)


def _mean(values: Sequence[float]) -> float:
    """Mean; NaN of nothing."""
    return float(np.mean(values)) if values else float("nan")
