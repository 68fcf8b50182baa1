"""Which encoder writes a video, with which settings: the source's own codec and pixels wherever that is possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from camcal.errors import InputError
from camcal.formats.video.containers import takes_encoder
from camcal.formats.video.encoders import ENCODERS, HIGHEST_CRF, Encoder, encoders_of
from camcal.formats.video.pixels import PixelLayout, holds_exactly, planar_layout
from camcal.nearest import did_you_mean

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

    def __post_init__(self) -> None:
        if self.codec is not None and not encoders_of(self.codec):
            known = tuple(dict.fromkeys(encoder.codec for encoder in ENCODERS.values()))
            hint = did_you_mean(self.codec, known)
            raise InputError(
                f"--codec: not one that is written (got {self.codec!r}, expected one of {', '.join(known)}).{hint}"
            )
        if self.quality is not None and not 0 <= self.quality <= max(HIGHEST_CRF.values()):
            scales = ", ".join(f"{high:g} for {codec}" for codec, high in HIGHEST_CRF.items())
            raise InputError(f"--crf: out of range (got {self.quality:g}, expected at most {scales}; lower is better).")
        if self.pixel_format is not None:
            import av

            try:
                av.VideoFormat(self.pixel_format)
            except ValueError:
                raise InputError(
                    f"--pixel-format: there is none of that name (got {self.pixel_format!r}). "
                    "Use one of libav's, such as yuv420p or yuv420p10le."
                ) from None


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
    fitting = [key for key in encoders_of(codec) if takes_encoder(key, request.container)]
    if not fitting:
        advice = "Choose another codec." if request.container == "matroska" else "Write .mkv, or choose another codec."
        raise InputError(f"--codec: {codec} does not fit into {request.container}. {advice}")
    if request.lossless and all(ENCODERS[key].lossless is None for key in fitting):
        if request.options.lossless is None:
            return _as_asked(codec, layout, replace(request, lossless=False))
        raise InputError(f"--codec: {codec} cannot be lossless. Choose ffv1 or h264, or leave --lossless away.")
    for key in fitting:
        held = _encoder_format(key, layout)
        if held is not None:
            return _encoding(key, held, layout, request)
    takes = ", ".join(dict.fromkeys(form for key in fitting for form in _formats(key)))
    raise InputError(
        f"--codec: {codec} cannot hold {layout.name} (it holds {takes}). Choose another codec, or one of these pixel formats."
    )


def _encoding(name: str, held: str, layout: PixelLayout, request: _Request) -> Encoding:
    """Put the settings of an encoder together."""
    encoder, source, options = ENCODERS[name], request.source, request.options
    settings = dict(encoder.always)
    if request.lossless and encoder.lossless is not None:
        settings.update(encoder.lossless)
        if options.quality is not None:
            raise InputError(f"--crf: a lossless video has none (got {options.quality:g}). Leave one of the two away.")
    elif encoder.quality:
        settings[encoder.quality] = _quality(name, encoder, options.quality)
    elif options.quality is not None:
        raise InputError(f"--crf: {encoder.codec} has no such scale (got {options.quality:g}). Leave it away.")
    if encoder.codec == "prores":
        best = "4444" if layout.alpha or "444" in layout.name else "hq"
        settings["profile"] = _PRORES_PROFILES.get(source.profile, best) if source.codec == "prores" else best
    if encoder.codec in ("h264", "hevc") and layout.planes[0].siting == "center":
        settings["chroma_sample_location"] = "center"
    if encoder.codec == "dnxhd":
        settings["profile"] = _DNXHR_PROFILES.get(layout.name, "dnxhr_444")
    if options.preset is not None:
        if encoder.presets and options.preset not in encoder.presets:
            known, hint = ", ".join(encoder.presets), did_you_mean(options.preset, encoder.presets)
            raise InputError(f"--preset: not one of {encoder.codec}'s (got {options.preset!r}, expected one of {known}).{hint}")
        settings["preset"] = options.preset
    return Encoding(name, held, layout, settings, request.lossless, _differences(encoder, layout, source, options))


def _quality(name: str, encoder: Encoder, asked: float | None) -> str:
    """Write the quality as the encoder's option takes it."""
    value = encoder.default if asked is None else asked
    if not encoder.low <= value <= encoder.high:
        raise InputError(
            f"--crf: out of {encoder.codec}'s range (got {value:g}, expected {encoder.low:g} to {encoder.high:g}; "
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
    return planar_layout(name, full_range=source.full_range, centred_chroma=source.planes[0].siting == "center")


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
