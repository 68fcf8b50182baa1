"""A camera as whoever calls a workflow has it: the name of its file, or the camera itself."""

from __future__ import annotations

from pathlib import Path
from typing import TypeAlias

from camcal.formats.camera_file import load_intrinsics
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.workflows.reporting import LogReporter, Reporter

GivenCamera: TypeAlias = str | Path | Camera | Intrinsics
"""A camera file of any known format, a folder that `calibrate` or `synth` wrote, or the camera itself."""


def known_camera(given: GivenCamera, reporter: Reporter | None = None) -> Intrinsics:
    """Return all that is known of a camera, which may have to be read first; pass on what its file says besides.

    Raises
    ------
    InputError
        If it is a file that cannot be read.
    """
    if isinstance(given, Camera):
        return Intrinsics(given)
    known = given if isinstance(given, Intrinsics) else load_intrinsics(given)
    pass_on_cautions(known, reporter or LogReporter())
    return known


def pass_on_cautions(known: Intrinsics, reporter: Reporter) -> None:
    """Tell what the file of a camera says that a camera cannot hold."""
    for caution in known.cautions:
        reporter.warn(caution)


def camera_path(given: GivenCamera | None) -> Path | None:
    """Return the file or folder that a camera is in; None if it is in none."""
    return Path(given) if isinstance(given, (str, Path)) else None


def camera_name(given: GivenCamera) -> str:
    """Return what to call a camera in messages: its file, or its own name."""
    if isinstance(given, Camera):
        return Intrinsics(given).name
    return given.name if isinstance(given, Intrinsics) else str(given)
