"""`camcal demo`: the whole chain on a shipped scenario, ending with truth against estimate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from camcal.formats.output import claim_folder
from camcal.workflows.calibrate import CalibrationRun, calibrate
from camcal.workflows.reporting import LogReporter, Reporter
from camcal.workflows.synth import IMAGES, Synthesis, synth
from camcal.workflows.undistort import Undistortion, undistort
from camcal.workflows.verify import Verification, verify

CONFIG = "webcam_720p"
_MAX_SIGMA = 5.0


@dataclass(frozen=True, slots=True)
class Demonstration:
    """What each step of the demo gave."""

    synthesis: Synthesis
    calibration: CalibrationRun
    undistortion: Undistortion
    verification: Verification


def demo(
    output: str | Path, *, force: bool = False, jobs: int | None = None, reporter: Reporter | None = None
) -> Demonstration:
    """Render a dataset, calibrate from its pixels, undistort it and verify it against the truth.

    Parameters
    ----------
    output : path
        Folder for `data/`, `calib/` and `undistorted/`.
    force : bool
        Whether a folder that exists is written into.
    jobs : int, optional
        Images worked on at once; all processors by default.
    reporter : Reporter, optional

    Returns
    -------
    Demonstration

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    reporter = reporter or LogReporter()
    folder = claim_folder(output, force=force)
    data, calib, undistorted = folder / "data", folder / "calib", folder / "undistorted"
    made = synth(CONFIG, data, force=force, jobs=jobs, reporter=reporter)
    run = calibrate([data / IMAGES], str(data / "board.yaml"), calib, report=True, force=force, jobs=jobs, reporter=reporter)
    done = undistort([data / IMAGES], calib / "camera.yaml", undistorted, force=force, jobs=jobs, reporter=reporter)
    return Demonstration(made, run, done, verify(calib, data, max_sigma=_MAX_SIGMA))
