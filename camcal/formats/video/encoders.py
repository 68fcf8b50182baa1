"""The encoders that are used, and what is to be known of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Encoder:
    """What is to be known of one of libav's encoders.

    Attributes
    ----------
    codec : str
        libav's name of the codec.
    quality : str
        Option that sets the quality, "" where there is none.
    default, low, high : float
        Quality that is not told from the source by eye, and the range of the scale; lower is better.
    always : mapping
        Options in any case.
    lossless : mapping or None
        Options for a lossless video; None if there are none.
    presets : tuple of str
        Names of its presets, if it has names; of a wrong one libx264 complains on the terminal by itself.
    """

    codec: str
    quality: str = ""
    default: float = 0.0
    low: float = 0.0
    high: float = 0.0
    always: Mapping[str, str] = field(default_factory=dict)
    lossless: Mapping[str, str] | None = None
    presets: tuple[str, ...] = ()


_NAMED = ("ultrafast", "superfast", "veryfast", "faster", "fast", "medium", "slow", "slower", "veryslow", "placebo")
_X265_QUIET = "log-level=none"
ENCODERS: Mapping[str, Encoder] = {
    "libx264": Encoder("h264", "crf", 18, 0, 51, lossless={"qp": "0"}, presets=_NAMED),
    "libx264rgb": Encoder("h264", "crf", 18, 0, 51, lossless={"qp": "0"}, presets=_NAMED),
    "libx265": Encoder(
        *("hevc", "crf", 20, 0, 51, {"x265-params": _X265_QUIET}),
        lossless={"x265-params": f"{_X265_QUIET}:lossless=1"},
        presets=_NAMED,
    ),
    "libsvtav1": Encoder("av1", "crf", 22, 1, 63, {"preset": "7"}, {"svtav1-params": "lossless=1"}),
    "libvpx-vp9": Encoder("vp9", "crf", 22, 0, 63, {"b": "0", "row-mt": "1", "cpu-used": "3"}, {"lossless": "1"}),
    # VP8 needs a rate for its quality to work within: one that is never reached.
    "libvpx": Encoder("vp8", "crf", 8, 4, 63, {"b": "200M", "cpu-used": "2"}),
    "mjpeg": Encoder("mjpeg", "global_quality", 2, 1, 31, {"flags": "+qscale"}),
    "prores_ks": Encoder("prores", always={"vendor": "apl0"}),
    "dnxhd": Encoder("dnxhd"),
    "ffv1": Encoder("ffv1", always={"level": "3", "slicecrc": "1", "g": "1"}, lossless={}),
    **{
        name: Encoder(name, lossless={})
        for name in ("ffvhuff", "huffyuv", "utvideo", "magicyuv", "png", "qtrle", "v210", "rawvideo")
    },
}
"""The encoders that are used, the preferred one of a codec first."""

_ALIASES = {"h265": "hevc", "x264": "h264", "x265": "hevc", "avc": "h264", "raw": "rawvideo"}
HIGHEST_CRF = {encoder.codec: encoder.high for encoder in ENCODERS.values() if encoder.quality == "crf"}
"""Where each codec's scale of quality ends."""


def encoders_of(codec: str) -> list[str]:
    """Names of the encoders of a codec as the user names it; none if it is not known."""
    name = _ALIASES.get(codec.lower(), codec.lower())
    return [key for key, encoder in ENCODERS.items() if name in (key, encoder.codec)]
