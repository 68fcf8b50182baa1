"""Cameras out of any file: recognised by its content, chosen among several, brought to camcal's conventions."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from camcal.errors import InputError
from camcal.formats.camera_file import split_choice
from camcal.formats.exchange.loaded import Loaded, load_file
from camcal.formats.exchange.profile import Exchanged
from camcal.formats.exchange.table import FORMATS, format_named
from camcal.nearest import did_you_mean
from camcal.records import Intrinsics

_NAMED_AT_ONCE = 8
_KINDS = {"yaml": "a YAML file", "json": "a JSON file", "xml": "an XML file", "python": "a Python dict"}


def read_any(path: str | Path) -> Intrinsics:
    """Read a camera that can be taken as it stands.

    Parameters
    ----------
    path : str or Path
        A file of any known format. `FILE#NAME` is the camera of that name among several.

    Raises
    ------
    InputError
        If it cannot be used, or something about it has to be decided first.
    """
    file, choice = split_choice(path)
    cameras = read_cameras(load_file(file))
    camera = chosen(file, cameras, choice, how=f"Name one: {file}#NAME")
    named = shlex.quote(str(path))
    if camera.sized is not None or camera.size is None:
        raise InputError(f"{file}: no image size in this file. Tell it: camcal import {named} --size WxH -o camera.yaml")
    if camera.foreign is not None:
        raise InputError(
            f"{file}: {camera.foreign.name} is not camcal's lens, to which it can be refitted. "
            f"Run: camcal import {named} -o camera.yaml"
        )
    return camera.intrinsics()


def read_cameras(loaded: Loaded, file_format: str | None = None) -> list[Exchanged]:
    """Read every camera of a file.

    Parameters
    ----------
    loaded : Loaded
    file_format : str, optional
        Name of the format, for a file that does not show it.

    Returns
    -------
    list of Exchanged
        At least one.

    Raises
    ------
    InputError
        If the file is of no known kind, or is not right.
    """
    given = None if file_format is None else format_named(file_format, "--from")
    known = given or next((candidate for candidate in FORMATS.values() if candidate.matches(loaded)), None)
    if known is None:
        titles = ", ".join(sorted(FORMATS))
        kind = _KINDS.get(loaded.syntax, f"a {loaded.syntax} file")
        keys = f" with {', '.join(list(loaded.data)[:5])}" if loaded.data else ""
        raise InputError(
            f"{loaded.name}:1: not a camera of a known format (got {kind}{keys}, expected one of camcal, {titles})."
        )
    return known.read(loaded)


def chosen(file: str | Path, cameras: Sequence[Exchanged], choice: str | None, *, how: str) -> Exchanged:
    """Return the camera of a name, or the only one.

    Parameters
    ----------
    file : str or Path
    cameras : sequence of Exchanged
    choice : str or None
    how : str
        What to do where there are several, for the message.

    Raises
    ------
    InputError
        If there are several and none is named, the name is none of them, or the camera cannot be used.
    """
    names = [camera.name for camera in cameras]
    listed = ", ".join(names[:_NAMED_AT_ONCE]) + (f" and {len(names) - _NAMED_AT_ONCE} more" * (len(names) > _NAMED_AT_ONCE))
    if choice is None and len(cameras) > 1:
        raise InputError(f"{file}: several cameras (got {listed}, expected one). {how}")
    if choice is not None and choice not in names:
        raise InputError(f"{file}: no camera {choice!r} (got {listed}).{did_you_mean(choice, names)}")
    if choice is not None and names.count(choice) > 1:
        raise InputError(
            f"{file}: {names.count(choice)} cameras are called {choice!r} (expected one). Rename them in the file."
        )
    camera = cameras[0] if choice is None else cameras[names.index(choice)]
    if camera.fault is not None:
        raise camera.fault
    return camera


def with_size(file: str | Path, camera: Exchanged, size: tuple[int, int] | None) -> Exchanged:
    """Return a camera that has an image size: the file's, or the one that is told.

    Raises
    ------
    InputError
        If neither is there, or the two differ.
    """
    if camera.size is not None and size is not None and camera.size != size:
        got, expected = ("{}x{}".format(*one) for one in (size, camera.size))
        raise InputError(f"--size: not the size in {file} (got {got}, expected {expected}). Leave it out.")
    size = size or camera.size
    if size is None:
        raise InputError(f"{file}: no image size in this file. Tell it with --size WxH, such as --size 1920x1080.")
    return replace(camera.sized(size), name=camera.name) if camera.sized is not None else replace(camera, size=size)
