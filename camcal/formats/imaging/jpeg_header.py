"""What a JPEG's header says of its pixels.

Source of the layout: ITU-T T.81, annex B, and T.872 (Adobe's segment).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from camcal.formats.imaging.jpeg_segments import ADOBE, FRAMES, TABLES, Segment, split_jpeg

# Marks of their frames, by whether entropy is coded after Huffman or arithmetically.
_PROGRESSIVE = (0xC2, 0xCA)
# Luminance steps of T.81, table K.1, from which libjpeg derives those of every quality; their order does not matter here.
_STANDARD_STEPS = np.array(
    [
        *(
            16,
            11,
            10,
            16,
            24,
            40,
            51,
            61,
            12,
            12,
            14,
            19,
            26,
            58,
            60,
            55,
            14,
            13,
            16,
            24,
            40,
            57,
            69,
            56,
            14,
            17,
            22,
            29,
            51,
            87,
        ),
        *(
            80,
            62,
            18,
            22,
            37,
            56,
            68,
            109,
            103,
            77,
            24,
            35,
            55,
            64,
            81,
            104,
            113,
            92,
            49,
            64,
            78,
            87,
            103,
            121,
            120,
            101,
            72,
            92,
        ),
        *(95, 98, 112, 100, 103, 99),
    ]
)


@dataclass(frozen=True, slots=True)
class JpegHeader:
    """How the pixels of a JPEG are coded.

    Attributes
    ----------
    size : tuple of int
        (width, height) in pixels.
    frame : int
        Mark of the frame: 0xC0 baseline, 0xC1 extended, 0xC2 progressive; others are rare.
    bits : int
        Bits per sample.
    factors : tuple of (int, int)
        Sampling factors (horizontal, vertical) of each component.
    colour : str
        "grey", "ycc", "rgb" or "cmyk".
    quality : int
        Lowest quality (1 to 100) at which libjpeg's luminance steps are as fine as the file's.
    """

    size: tuple[int, int]
    frame: int
    bits: int
    factors: tuple[tuple[int, int], ...]
    colour: str
    quality: int

    @property
    def is_progressive(self) -> bool:
        """Whether it comes in scans that grow finer and finer."""
        return self.frame in _PROGRESSIVE

    @property
    def subsampling(self) -> tuple[int, int]:
        """Pixels per sample of chrominance along x and y; (1, 1) also where that is no whole number or there is none."""
        luminance, chrominance = self.factors[0], self.factors[1 if len(self.factors) == 3 else 0]
        if min(chrominance) < 1 or any(ours % theirs for ours, theirs in zip(luminance, chrominance, strict=True)):
            return 1, 1
        return luminance[0] // chrominance[0], luminance[1] // chrominance[1]


def jpeg_header(content: bytes) -> JpegHeader | None:
    """Read how the pixels are coded; None if there is no frame header before the first scan."""
    segments, _ = split_jpeg(content)
    frame = next((segment for segment in segments if segment.marker in FRAMES), None)
    if frame is None or len(frame.body) < 6 or len(frame.body) < 6 + 3 * frame.body[5]:
        return None
    body = frame.body
    components = [body[6 + 3 * index : 9 + 3 * index] for index in range(body[5])]
    return JpegHeader(
        size=(int.from_bytes(body[3:5]), int.from_bytes(body[1:3])),
        frame=frame.marker,
        bits=body[0],
        factors=tuple((component[1] >> 4, component[1] & 15) for component in components),
        colour=_colour(segments, bytes(component[0] for component in components)),
        quality=_quality(segments, components[0][2] if components else 0),
    )


def colour_of(segments: Sequence[Segment]) -> str:
    """Tell what the components are."""
    frame = next((segment.body for segment in segments if segment.marker in FRAMES), b"").ljust(6, b"\0")
    return _colour(segments, frame[6 : 6 + 3 * frame[5] : 3])


def _colour(segments: Iterable[Segment], names: bytes) -> str:
    """Tell what the components of these names are, by libjpeg's rules (its jdapimin.c, default_decompress_parms)."""
    if len(names) != 3:
        return {1: "grey", 4: "cmyk"}.get(len(names), "unknown")
    if any(segment.marker == 0xE0 and segment.body.startswith(b"JFIF\0") for segment in segments):
        return "ycc"
    adobe = next((s.body for s in segments if s.marker == 0xEE and s.body.startswith(ADOBE) and len(s.body) >= 12), None)
    is_rgb = names == b"RGB" if adobe is None else adobe[11] == 0
    return "rgb" if is_rgb else "ycc"


def _quality(segments: Iterable[Segment], table: int) -> int:
    """Lowest quality at which libjpeg's steps are as fine as a table's, all together (its jcparam.c, jpeg_quality_scaling)."""
    sums = {number: total for segment in segments if segment.marker == TABLES for number, total in _tables(segment.body)}
    quality = np.arange(1, 101)
    percent = np.where(quality < 50, 5000 // quality, 200 - 2 * quality)
    steps = np.clip((_STANDARD_STEPS * percent[:, None] + 50) // 100, 1, 255)
    fine_enough = steps.sum(axis=1) <= sums.get(table, int(_STANDARD_STEPS.sum()))
    return int(quality[fine_enough][0]) if fine_enough.any() else 100


def _tables(body: bytes) -> Iterator[tuple[int, int]]:
    """Number and sum of each quantisation table of a segment."""
    while len(body) > 64:
        size = 2 if body[0] >> 4 else 1
        steps = np.frombuffer(body[1 : 1 + 64 * size], ">u2" if size == 2 else "u1")
        yield body[0] & 15, int(steps.sum())
        body = body[1 + 64 * size :]
