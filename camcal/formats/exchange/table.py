"""Every format that cameras are exchanged in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from camcal.errors import InputError
from camcal.formats.exchange import camera_json, colmap, kalibr, lensfun, matlab, mrcal, nerfstudio, opencv, ros
from camcal.formats.exchange.loaded import Loaded
from camcal.formats.exchange.profile import Exchanged, Outgoing, Profile
from camcal.nearest import did_you_mean


@dataclass(frozen=True, slots=True)
class Format:
    """One format.

    Attributes
    ----------
    profile : Profile
        What it can hold.
    matches : callable
        Tells by its content whether a file is one.
    read : callable
        Reads every camera of a file, in camcal's conventions.
    write : callable
        Returns the content of a file with one camera that the format holds.
    """

    profile: Profile
    matches: Callable[[Loaded], bool]
    read: Callable[[Loaded], list[Exchanged]]
    write: Callable[[Outgoing], str | bytes]


# Asked in this order whether a file is theirs: OpenCV's names are the most general and come last.
_MODULES = (ros, kalibr, colmap, mrcal, nerfstudio, matlab, lensfun, camera_json, opencv)
FORMATS = {m.PROFILE.name: Format(m.PROFILE, m.matches, m.read, m.write) for m in _MODULES}
"""Formats by name."""


def format_named(name: str, option: str) -> Format:
    """Return a format by its name.

    Parameters
    ----------
    name : str
    option : str
        The option it was given with, for the message.

    Raises
    ------
    InputError
        If there is none; names the nearest.
    """
    found = FORMATS.get(name.strip().lower())
    if found is None:
        expected = ", ".join(sorted(FORMATS))
        advice = did_you_mean(name, FORMATS)
        raise InputError(f"{option}: unknown format (got {name!r}, expected one of {expected}).{advice}")
    return found
