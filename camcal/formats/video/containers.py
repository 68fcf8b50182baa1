"""The containers that are written: by which name, what fits into each, and how each keeps times and tags as they are."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import PurePath

from camcal.errors import InputError

_CONTAINERS = {
    **dict.fromkeys((".mp4", ".m4v"), "mp4"),
    ".mov": "mov",
    ".mkv": "matroska",
    ".webm": "webm",
    ".avi": "avi",
    **dict.fromkeys((".ts", ".mts", ".m2ts"), "mpegts"),
}
# libav cannot say what fits into a transport stream.
_TRANSPORT_STREAM = ("libx264", "libx265")
# The tags that MP4 and QuickTime have a place of their own for, which every player reads; others need Apple's newer form.
_COMMON = ("title", "artist", "album", "comment", "copyright", "date", "genre", "location", "creation_time", "timecode")
_PLACES = {
    "mp4": {*_COMMON, "album_artist", "composer", "description", "synopsis", "keywords", "grouping", "lyrics", "show"},
    "mov": {*_COMMON, "make", "model"},
}


def container_format(path: str | PurePath) -> str:
    """Return libav's name of the container that a file name asks for.

    Raises
    ------
    InputError
        If its extension is none of a video that is written.
    """
    suffix = PurePath(path).suffix.lower()
    if suffix not in _CONTAINERS:
        raise InputError(f"{path}: not a video to write (got '{suffix}', expected one of {', '.join(_CONTAINERS)}).")
    return _CONTAINERS[suffix]


def takes_encoder(name: str, container: str) -> bool:
    """Tell whether a container takes what an encoder writes."""
    import av

    if container == "mpegts":
        return name in _TRANSPORT_STREAM
    with av.open(io.BytesIO(), "w", format=container) as probe:
        return name in probe.supported_codecs


def container_options(container: str, suffix: str, tags: Mapping[str, str], ticks_per_second: int | None) -> dict[str, str]:
    """Choose the options with which a container keeps times and tags as they are.

    Parameters
    ----------
    container : str
        libav's name.
    suffix : str
        Of the file's name.
    tags : mapping
        That it is to hold.
    ticks_per_second : int or None
        Of the video's times; None if a tick is no whole fraction of a second.
    """
    options: dict[str, str] = {}
    if container in _PLACES:
        if ticks_per_second is not None:
            # The movie's own unit rounds the time at which a track begins.
            options.update(video_track_timescale=str(ticks_per_second), movie_timescale=str(ticks_per_second))
        if not {key.lower().partition("-")[0] for key in tags} <= _PLACES[container]:
            options["movflags"] = "use_metadata_tags"
    if container == "mpegts":
        options.update(mpegts_copyts="1", mpegts_m2ts_mode="0" if suffix == ".ts" else "1")
    return options
