"""How a video frame's samples lie in memory: planes as arrays, what one sample of each stands for, and their black."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from camcal.errors import InputError
from camcal.observations import Image

if TYPE_CHECKING:
    from av import VideoFormat, VideoFrame

_CHROMA_NAMES = {(1, 1): "444", (2, 1): "422", (2, 2): "420", (1, 2): "440", (4, 1): "411", (4, 4): "410"}
# Kinds of samples that are no integers of a linear scale, or no camera's.
_UNSUPPORTED = ("bayer", "xyz", "f16", "f32")


@dataclass(frozen=True, slots=True)
class PlaneLayout:
    """One plane of a frame.

    Attributes
    ----------
    step : tuple of int
        Luma pixels from one sample to the next, (across, down).
    siting : str
        Where a sample lies among the pixels that it stands for, by libav's name: "center" or "left".
    black : int
        The plane's value where the picture is black; of an alpha plane, transparent.
    """

    step: tuple[int, int]
    siting: str
    black: int


@dataclass(frozen=True, slots=True)
class PixelLayout:
    """A planar pixel format: each plane holds one sample per place.

    Attributes
    ----------
    name : str
        libav's name of the format; full-range formats go by the name without a "j".
    depth : int
        Bits of a sample; beyond 8 it takes two bytes.
    planes : tuple of PlaneLayout
    full_range : bool
        Whether 0 is black and the highest value white, instead of 16 and 235 (of 255).
    alpha : bool
        Whether the last plane says how opaque a pixel is.
    """

    name: str
    depth: int
    planes: tuple[PlaneLayout, ...]
    full_range: bool
    alpha: bool


def planar_layout(name: str, *, full_range: bool | None = None, centred_chroma: bool = False) -> PixelLayout:
    """Describe a pixel format, or the planar one that holds the same samples.

    Parameters
    ----------
    name : str
        libav's name, as "yuv420p" or "bgr24".
    full_range : bool or None
        What the video says, None if it says nothing: then gray is full and YUV is not. RGB, and the formats with a "j" in
        their name, always are.
    centred_chroma : bool
        Whether a subsampled chroma sample lies in the middle of its pixels, as in JPEG, instead of beside the left ones,
        as in MPEG-2, H.264 and everything since.

    Raises
    ------
    InputError
        If the samples are floats, a mosaic or another kind that is not worked on.
    """
    import av

    given = av.VideoFormat(name)
    if name.startswith(_UNSUPPORTED) or any(kind in name for kind in _UNSUPPORTED):
        raise _unsupported(name)
    planar = _planar_name(given)
    try:
        form = av.VideoFormat(planar, 64, 64)
    except ValueError:
        raise _unsupported(name) from None
    depth = max(part.bits for part in form.components)
    gray = len(form.components) == 1
    full = form.is_rgb or name.startswith("yuvj") or (gray if full_range is None else full_range)
    siting = "center" if centred_chroma else "left"
    planes = [PlaneLayout((1, 1), siting, 0)] * len(form.components)
    for index, part in enumerate(form.components):
        step = (64 // part.width, 64 // part.height)
        if part.is_alpha or form.is_rgb:
            black = 0
        elif index > 0:
            black = 1 << (depth - 1)
        else:
            black = 0 if full else 16 << (depth - 8)
        planes[part.plane] = PlaneLayout(step, siting, black)
    return PixelLayout(planar, depth, tuple(planes), full, any(part.is_alpha for part in form.components))


def plane_arrays(frame: VideoFrame) -> tuple[Image, ...]:
    """Return the planes of a planar frame as arrays (height, width), uint8 or uint16, that share its memory.

    The planes of a decoded frame must not be written to: the decoder predicts from them.
    """
    dtype = np.dtype(np.uint8 if frame.format.components[0].bits <= 8 else np.uint16)
    arrays = []
    for plane in frame.planes:
        flat = np.frombuffer(cast("memoryview", plane), dtype)
        rows = flat.reshape(plane.height, abs(plane.line_size) // dtype.itemsize)[:, : plane.width]
        # A frame stored bottom-up has a negative step from row to row; its buffer begins at the last row.
        arrays.append(rows if plane.line_size > 0 else rows[::-1])
    return tuple(arrays)


def holds_exactly(encoder_format: str, layout: PixelLayout) -> bool:
    """Tell whether a pixel format keeps every sample of a layout and adds none but padding."""
    try:
        held = planar_layout(encoder_format, full_range=layout.full_range)
    except InputError:
        return False
    return (held.name, held.full_range) == (layout.name, layout.full_range)


def _planar_name(form: VideoFormat) -> str:
    """Name of the planar, little-endian format with the samples of any other."""
    parts = form.components
    planes = {part.plane for part in parts}
    bits = max(part.bits for part in parts)
    alpha = "a" if any(part.is_alpha for part in parts) else ""
    tail = "" if bits <= 8 else f"{bits}le"
    if form.has_palette:
        return "gbrap"
    if len(parts) == 1:
        return f"gray{tail}"
    if form.is_rgb:
        return f"gbr{alpha}p{tail}"
    # The second of three or four components is chroma; of gray with alpha there is no planar format.
    chroma = type(form)(form.name, 64, 64).components[1 if len(parts) > 2 else 0]
    subsampling = _CHROMA_NAMES.get((64 // chroma.width, 64 // chroma.height), "?")
    if len(planes) == len(parts) and not form.is_big_endian:
        return form.name.replace("yuvj", "yuv")
    return f"yuv{alpha}{subsampling}p{tail}" if len(parts) > 2 else "gray with alpha"


def _unsupported(name: str) -> InputError:
    return InputError(
        f"pixel format {name}: not worked on (got {name}, expected gray, YUV or RGB of 8 to 16 bits). Convert the video first."
    )
