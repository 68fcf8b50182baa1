"""A camera into any format: refitted where the format's lens is another, and told so in the file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import camcal
from camcal.errors import InputError
from camcal.formats.exchange.profile import LensfunNames, Outgoing, one_line
from camcal.formats.exchange.refit import Refit, refitted
from camcal.formats.exchange.table import Format
from camcal.records import Intrinsics


@dataclass(frozen=True, slots=True, eq=False)
class Written:
    """A camera as a file of some format.

    Attributes
    ----------
    content : str or bytes
    refit : Refit
        The camera that is in it, and how far it is from the one that was given.
    """

    content: str | bytes
    refit: Refit


def written(known: Intrinsics, kind: Format, suffix: str, lensfun: LensfunNames) -> Written:
    """Write a camera in a format.

    Parameters
    ----------
    known : Intrinsics
    kind : Format
    suffix : str
        Ending of the file, which chooses among a format's ways to write; empty for the first.
    lensfun : LensfunNames

    Raises
    ------
    QualityError
        If the format's lens cannot come near.
    """
    profile = kind.profile
    refit = refitted(known.camera, profile)
    if refit.lost:
        # What was known of the camera is not known of the one that stands for it, unless it is that neither is any good.
        known = Intrinsics(refit.camera, known.name, verdict=known.verdict)
    lens = profile.lens_or_largest(refit.camera)
    outgoing = Outgoing(known, lens, suffix or profile.suffixes[0], _heading(known, refit), lensfun)
    return Written(kind.write(outgoing), refit)


def suffix_of(output: Path | None, kind: Format) -> str:
    """Return the ending of an output.

    Raises
    ------
    InputError
        If the format is written in several ways and the ending is none of theirs.
    """
    suffixes = kind.profile.suffixes
    suffix = "" if output is None else output.suffix.lower()
    if output is None or suffix in suffixes:
        return suffix
    if len({*suffixes} - {".yml"}) > 1:
        expected = " or ".join(suffixes)
        raise InputError(f"{output}: not an ending of {kind.profile.title} (got {suffix or 'none'!r}, expected {expected}).")
    return suffixes[0]


def _heading(known: Intrinsics, refit: Refit) -> tuple[str, ...]:
    """Lines for people: where the camera comes from and what became of it."""
    width, height = known.camera.size
    lines = [f"Camera {one_line(known.name)}, {width}x{height}, by camcal {camcal.__version__}"]
    if np.isfinite(known.rms_px):
        lines[0] += f" (RMS {known.rms_px:.3g} px, {known.views} views)"
    if known.problems:
        lines.append(f"NOT TO BE TRUSTED: {one_line(known.problems[0])}")
    if refit.lost:
        lines.append(f"Refitted, as the format has no {', '.join(refit.lost)}: differs by {refit.told}")
    return tuple(lines)
