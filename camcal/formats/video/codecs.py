"""Which encoder writes a video, with which settings: the source's own codec and pixels wherever that is possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from camcal.errors import InputError
from camcal.formats.video.containers import takes_encoder
from camcal.formats.video.pixels import PixelLayout, holds_exactly, planar_layout


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
    """

    codec: str
    quality: str = ""
    default: float = 0.0
    low: float = 0.0
    high: float = 0.0
    always: Mapping[str, str] = field(default_factory=dict)
    lossless: Mapping[str, str] | None = None


_X265_QUIET = "log-level=none"
ENCODERS: Mapping[str, Encoder] = {
    "libx264": Encoder("h264", "crf", 18, 0, 51, lossless={"qp": "0"}),
    "libx264rgb": Encoder("h264", "crf", 18, 0, 51, lossless={"qp": "0"}),
    "libx265": Encoder("hevc", "crf", 20, 0, 51, {"x265-params": _X265_QUIET}, {"x265-params": f"{_X265_QUIET}:lossless=1"}),
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
# Where the source's codec cannot be written: the most widely played first.
_INSTEAD = ("libx264", "libx264rgb", "libx265", "libsvtav1", "libvpx-vp9", "ffv1")
_INSTEAD_LOSSLESS = ("ffv1", "libx264", "libx264rgb", "libx265", "libvpx-vp9")
_JPEG_QUALITY_UNIT = 118
_DNXHR_PROFILES = {"yuv422p": "dnxhr_hq", "yuv422p10le": "dnxhr_hqx", "yuv444p10le": "dnxhr_444"}
_PRORES_PROFILES = {
    **{"Proxy": "proxy", "LT": "lt", "Standard": "standard", "HQ": "hq"},
    **{"4444": "4444", "XQ": "4444xq"},
}


@dataclass(frozen=True, slots=True)
class SourceCodec:
    """How a video is encoded.

    Attributes
    ----------
    codec : str
        libav's name.
    profile : str
    lossless : bool
    layout : PixelLayout
        Of its decoded frames.
    """

    codec: str
    profile: str
    lossless: bool
    layout: PixelLayout


@dataclass(frozen=True, slots=True)
class EncodingOptions:
    """What a user may ask for; everything else follows the source.

    Attributes
    ----------
    codec : str, optional
        As "h264", "hevc", "av1", "vp9", "ffv1" or "prores"; also one of libav's encoders, as "libx264".
    quality : float, optional
        On the codec's own scale: crf of H.264, HEVC, AV1 and VP9, q of MJPEG; lower is better.
    lossless : bool, optional
        As the source is, if it is not given.
    pixel_format : str, optional
        As "yuv420p10le".
    preset : str, optional
        The encoder's own, as "slow" or "8".
    threads : int
        Of the decoder and of the encoder each; 0 is one per processor.
    """

    codec: str | None = None
    quality: float | None = None
    lossless: bool | None = None
    pixel_format: str | None = None
    preset: str | None = None
    threads: int = 0


@dataclass(frozen=True, slots=True)
class Encoding:
    """An encoder with its settings.

    Attributes
    ----------
    encoder : str
        libav's name.
    pixel_format : str
        That the encoder is given.
    layout : PixelLayout
        Of the planes that are worked on: the same samples, plane by plane.
    options : mapping
        libav's options.
    lossless : bool
    warnings : tuple of str
        What differs from the source without having been asked for.
    """

    encoder: str
    pixel_format: str
    layout: PixelLayout
    options: Mapping[str, str] = field(default_factory=dict)
    lossless: bool = False
    warnings: tuple[str, ...] = ()


def choose_encoding(source: SourceCodec, container: str, options: EncodingOptions) -> Encoding:
    """Choose the encoder and its settings.

    Parameters
    ----------
    source : SourceCodec
    container : str
        libav's name of the container to write.
    options : EncodingOptions

    Raises
    ------
    InputError
        If what is asked for does not go together.
    """
    # Whoever names a quality wants none of it lossless.
    lossless = source.lossless and options.quality is None if options.lossless is None else options.lossless
    request = _Request(source, container, lossless, options)
    layout = source.layout
    if options.pixel_format is not None:
        layout = _asked_layout(options.pixel_format, source.layout)
    if options.codec is not None:
        return _as_asked(options.codec, layout, request)
    own = [name for name, encoder in ENCODERS.items() if encoder.codec == source.codec]
    for name in (*own, *(_INSTEAD_LOSSLESS if lossless else _INSTEAD)):
        if (lossless and ENCODERS[name].lossless is None) or not takes_encoder(name, container):
            continue
        held = _encoder_format(name, layout)
        if held is None and options.pixel_format is None:
            held, layout = _nearly(name, layout)
        if held is not None:
            return _encoding(name, held, layout, request)
    raise InputError(
        f"{source.codec} of {source.layout.name}: no encoder for this container ({container}) keeps these pixels. "
        "Write .mkv, or choose another pixel format."
    )


@dataclass(frozen=True, slots=True)
class _Request:
    """What an encoder is chosen for."""

    source: SourceCodec
    container: str
    lossless: bool
    options: EncodingOptions


def _as_asked(codec: str, layout: PixelLayout, request: _Request) -> Encoding:
    """Take the codec that the user names, or say why it cannot be."""
    name = _ALIASES.get(codec.lower(), codec.lower())
    encoders = [key for key, encoder in ENCODERS.items() if name in (key, encoder.codec)]
    if not encoders:
        known = ", ".join(dict.fromkeys(encoder.codec for encoder in ENCODERS.values()))
        raise InputError(f"codec {codec}: not one that is written (got {codec!r}, expected one of {known}).")
    fitting = [key for key in encoders if takes_encoder(key, request.container)]
    if not fitting:
        raise InputError(f"codec {codec}: does not fit into {request.container}. Write .mkv, or choose another codec.")
    if request.lossless and all(ENCODERS[key].lossless is None for key in fitting):
        if request.options.lossless is None:
            return _as_asked(codec, layout, replace(request, lossless=False))
        raise InputError(f"codec {codec}: cannot be lossless. Choose ffv1 or h264, or say that it need not be.")
    for key in fitting:
        held = _encoder_format(key, layout)
        if held is not None:
            return _encoding(key, held, layout, request)
    takes = ", ".join(dict.fromkeys(form for key in fitting for form in _formats(key)))
    raise InputError(
        f"codec {codec}: cannot hold {layout.name} (it holds {takes}). Choose another codec, or one of these pixel formats."
    )


def _encoding(name: str, held: str, layout: PixelLayout, request: _Request) -> Encoding:
    """Put the settings of an encoder together."""
    encoder, source, options = ENCODERS[name], request.source, request.options
    settings = dict(encoder.always)
    if request.lossless and encoder.lossless is not None:
        settings.update(encoder.lossless)
        if options.quality is not None:
            raise InputError(f"quality: a lossless video has none (got {options.quality:g}). Leave one of the two away.")
    elif encoder.quality:
        settings[encoder.quality] = _quality(name, encoder, options.quality)
    elif options.quality is not None:
        raise InputError(f"quality: {encoder.codec} has no such scale (got {options.quality:g}). Leave it away.")
    if encoder.codec == "prores":
        best = "4444" if layout.alpha or "444" in layout.name else "hq"
        settings["profile"] = _PRORES_PROFILES.get(source.profile, best) if source.codec == "prores" else best
    if encoder.codec in ("h264", "hevc") and layout.planes[0].siting == "center":
        settings["chroma_sample_location"] = "center"
    if encoder.codec == "dnxhd":
        settings["profile"] = _DNXHR_PROFILES.get(layout.name, "dnxhr_444")
    if options.preset is not None:
        settings["preset"] = options.preset
    return Encoding(name, held, layout, settings, request.lossless, _differences(encoder, layout, source, options))


def _quality(name: str, encoder: Encoder, asked: float | None) -> str:
    """Write the quality as the encoder's option takes it."""
    value = encoder.default if asked is None else asked
    if not encoder.low <= value <= encoder.high:
        raise InputError(
            f"quality: out of {encoder.codec}'s range (got {value:g}, expected {encoder.low:g} to {encoder.high:g}; "
            "lower is better)."
        )
    return str(round(value * _JPEG_QUALITY_UNIT)) if name == "mjpeg" else f"{value:g}"


def _differences(encoder: Encoder, layout: PixelLayout, source: SourceCodec, options: EncodingOptions) -> tuple[str, ...]:
    """Say what is not as in the source although nobody asked for it."""
    found = []
    if options.codec is None and encoder.codec != source.codec:
        found.append(f"{source.codec} of {source.layout.name} cannot be written here: encoded as {encoder.codec}")
    if options.pixel_format is None and layout.name != source.layout.name:
        found.append(f"{encoder.codec} cannot hold {source.layout.name}: written as {layout.name}")
    return tuple(found)


def _asked_layout(name: str, source: PixelLayout) -> PixelLayout:
    """Describe the pixel format that the user names."""
    try:
        centred = source.planes[0].siting == "center"
        return planar_layout(name, full_range=source.full_range, centred_chroma=centred)
    except ValueError:
        raise InputError(
            f"pixel format {name}: there is none of that name. Use one of libav's, as yuv420p or yuv420p10le."
        ) from None


def _nearly(name: str, layout: PixelLayout) -> tuple[str | None, PixelLayout]:
    """Accept ten bits of ProRes where its decoder gives twelve; nothing else comes near enough."""
    if name == "prores_ks" and layout.depth == 12:
        nearer = planar_layout(layout.name.replace("12le", "10le"), full_range=layout.full_range)
        return _encoder_format(name, nearer), nearer
    return None, layout


def _encoder_format(name: str, layout: PixelLayout) -> str | None:
    """Return the format that keeps a layout's samples, the layout's own if the encoder takes it; None if there is none."""
    formats = _formats(name)
    if layout.name in formats:
        return layout.name
    return next((form for form in formats if holds_exactly(form, layout)), None)


def _formats(name: str) -> tuple[str, ...]:
    """Names of the pixel formats that an encoder takes; raw video takes any, JPEG means full range by each of its own."""
    import av

    listed = av.Codec(name, "w").video_formats
    if name == "mjpeg":
        return tuple(form.name for form in listed or () if form.name.startswith("yuvj"))
    if name == "rawvideo" or listed is None:
        return ("yuv420p", "yuv422p", "yuv444p", "gray", "bgr24", "bgra", "yuv420p10le", "yuv422p10le", "yuv444p10le")
    return tuple(form.name for form in listed)
