"""What a video says about itself, carried over: tags kept, stale ones left behind, the lens correction added, losses named."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

if TYPE_CHECKING:
    from av import VideoFrame
    from av.sidedata.sidedata import SideData

    from camcal.formats.video.reader import VideoReader

COLOUR_TAGS = ("colorspace", "color_range", "color_trc", "color_primaries")
"""Names of a frame's and of a stream's colour tags."""

_MATRIX = "DISPLAYMATRIX"
# What a frame may carry beside its samples that a person would miss.
_CARGO = {
    "A53_CC": "closed captions",
    "MASTERING_DISPLAY_METADATA": "HDR mastering data",
    "CONTENT_LIGHT_LEVEL": "HDR light levels",
    "DYNAMIC_HDR_PLUS": "HDR10+",
    "DOVI_METADATA": "Dolby Vision",
    "SPHERICAL": "spherical projection",
    "STEREO3D": "stereo arrangement",
}

# What describes the file that was read, not what it shows; the writing library sets its own.
_OF_THE_FILE = ("major_brand", "minor_version", "compatible_brands", "encoder", "software", "duration", "vendor_id")
_STATISTICS = ("bps", "number_of_frames", "number_of_bytes", "_statistics")
_NOTE_KEYS = ("comment", "description", "synopsis")
_UNSPECIFIED = {"colorspace": 2, "color_range": 0, "color_trc": 2, "color_primaries": 2}


def container_tags(tags: Mapping[str, str], note: str, container: str) -> dict[str, str]:
    """Choose the tags of the new file.

    Parameters
    ----------
    tags : mapping
        Of the file that was read.
    note : str
        What was done to the pictures: becomes the comment, or the first other describing tag that is free.
    container : str
        libav's name.
    """
    kept = {key: value for key, value in tags.items() if key.lower() not in _OF_THE_FILE}
    used = {key.lower() for key in kept}
    places = _NOTE_KEYS[:1] if container == "avi" else _NOTE_KEYS
    free = next((key for key in places if key not in used), None)
    if free is not None:
        return {**kept, free: note}
    taken = next(key for key in kept if key.lower() == _NOTE_KEYS[0])
    return {**kept, taken: f"{kept[taken]}\n{note}"}


def stream_tags(tags: Mapping[str, str]) -> dict[str, str]:
    """Choose the tags of a stream of the new file: all but what counts the old one's bytes."""
    return {
        key: value for key, value in tags.items() if key.lower() not in _OF_THE_FILE and not key.lower().startswith(_STATISTICS)
    }


def display_matrix(frame: VideoFrame) -> list[int] | None:
    """Return the nine numbers by which players turn a video, as libav holds them; None if they do not."""
    for item in _side_data(frame):
        if item.type.name == _MATRIX:
            return [int(number) for number in np.frombuffer(bytes(item), np.int32)]
    return None


def losses(path: Path, reader: VideoReader, note: str, begin_s: Fraction, *, rounded: bool) -> list[str]:
    """Compare a finished file with its source.

    Parameters
    ----------
    path : Path
        The new file.
    reader : VideoReader
        The source.
    note : str
        That the new file was to hold.
    begin_s : Fraction
        When its first frame was to be shown.
    rounded : bool
        Whether the new container's unit of time did not fit every frame.

    Returns
    -------
    list of str
        A clause for each kind of thing that the new container or encoder did not keep.
    """
    from camcal.formats.video.reader import VideoReader

    first = reader.first_frame
    present = {item.type.name for item in _side_data(first)}
    found = [f"{name} of the frames is not carried over" for kind, name in _CARGO.items() if kind in present]
    with VideoReader(path, as_progressive=True) as written:
        made = written.first_frame
        tags = {**written.stream.metadata, **written.container.metadata}
        held = {key.lower() for key in tags}
        missing = [key for key in reader.container.metadata if key.lower() not in (*held, *_OF_THE_FILE)]
        if missing:
            found.append(f"the container has no place for these tags: {', '.join(sorted(missing))}")
        if not any(note in text for text in tags.values()):
            found.append("the container has no place for a note of the correction")
        if first.rotation != made.rotation:
            found.append(f"the container has no place for the rotation of {first.rotation} degrees")
        for tag in COLOUR_TAGS:
            was, became = getattr(first, tag), getattr(made, tag)
            if was not in (became, _UNSPECIFIED[tag]):
                found.append(f"{tag} is not kept (got {became}, expected {was})")
        if rounded:
            found.append(f"times are rounded to {float(1000 * written.time_base):.3g} ms, the container's unit")
        later_s = written.first_time_s - begin_s
        if abs(later_s) > written.time_base:
            found.append(f"all times are {float(1000 * later_s):.0f} ms later, so that none is below zero")
    return found


def _side_data(frame: VideoFrame) -> list[SideData]:
    """What comes with a frame; libav's binding gives it as a list, and describes it as a mapping."""
    return list(cast("Iterable[SideData]", frame.side_data))
