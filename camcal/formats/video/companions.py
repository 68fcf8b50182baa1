"""The streams beside the video: sound, subtitles, data and covers, copied packet by packet where the container takes them."""

from __future__ import annotations

import io
from contextlib import suppress
from fractions import Fraction
from typing import TYPE_CHECKING

from camcal.formats.video.opening import is_cover
from camcal.formats.video.tags import stream_tags

if TYPE_CHECKING:
    from av import Packet
    from av.container import OutputContainer
    from av.stream import Stream

_WITH_COVER = ("mp4",)


class Companions:
    """The streams of a file that go unchanged into another.

    Parameters
    ----------
    streams : tuple of av.stream.Stream
        All but the video.
    output : av.container.OutputContainer
        Not begun yet.

    Attributes
    ----------
    warnings : list of str
        A clause for every stream that is left out.
    """

    def __init__(self, streams: tuple[Stream, ...], output: OutputContainer) -> None:
        self._output = output
        self._copies: dict[int, Stream] = {}
        self.warnings: list[str] = []
        for stream in streams:
            if _made_anew(stream):
                continue
            cause = _refusal(stream, output.format.name)
            if cause is None:
                self._copies[stream.index] = _add(stream, output)
            else:
                self.warnings.append(f"stream {stream.index} ({_kind(stream)}) is left out: {cause}")

    def copy(self, packet: Packet[Stream], shift_s: Fraction) -> None:
        """Write a packet as it is, `shift_s` earlier; packets of streams that are left out are dropped."""
        stream = self._copies.get(packet.stream.index)
        if stream is None:
            return
        if shift_s:
            ticks = round(shift_s / packet.time_base)
            packet.pts = None if packet.pts is None else packet.pts - ticks
            packet.dts = None if packet.dts is None else packet.dts - ticks
        packet.stream = stream
        self._output.mux_one(packet)


def _made_anew(stream: Stream) -> bool:
    """Tell whether the muxer writes a stream from tags and chapters by itself: time codes and chapter titles."""
    titles = stream.type == "data" and stream.discard == type(stream.discard)["all"]
    return titles or (stream.type == "data" and "timecode" in stream.metadata)


def _refusal(stream: Stream, container: str) -> str | None:
    """Say why a stream cannot be copied; only an attempt tells what a container takes."""
    import av

    if stream.type == "video" and not is_cover(stream):
        return "only the main video is worked on"
    if is_cover(stream) and container not in _WITH_COVER:
        return f"{container} takes no such picture"
    probe = av.open(io.BytesIO(), "w", format=container)
    try:
        _add(stream, probe)
        probe.start_encoding()
    except (av.FFmpegError, ValueError):
        return f"{container} does not take it"
    finally:
        with suppress(av.FFmpegError):
            probe.close()
    return None


def _add(stream: Stream, output: OutputContainer) -> Stream:
    """Add a stream like another to a container."""
    made = output.add_stream_from_template(stream, opaque=True)
    made.disposition = stream.disposition
    made.metadata.update(stream_tags(stream.metadata))
    return made


def _kind(stream: Stream) -> str:
    """Say what is in a stream; one of a codec that libav does not know has neither a context nor, unless it is data, a name."""
    context = getattr(stream, "codec_context", None)
    known = context.codec.canonical_name if context is not None else getattr(stream, "name", None)
    return f"{stream.type}, {known or stream.metadata.get('handler_name') or 'unknown'}"
