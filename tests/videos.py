"""Small videos made with libav, and videos read back with it alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
from av.stream import Disposition

SIZE = (64, 48)
RATE = 30


@dataclass
class Decoded:
    """Everything that a player would see of a video.

    `planes` holds for each frame its planes (height, width); `packets` for each other stream the (time in seconds, bytes) of
    its packets.
    """

    frames: list[Any] = field(default_factory=list)
    planes: list[list[np.ndarray]] = field(default_factory=list)
    times_s: list[Fraction] = field(default_factory=list)
    packets: dict[str, list[tuple[Fraction, bytes]]] = field(default_factory=dict)
    tags: dict[str, str] = field(default_factory=dict)
    chapters: list[Any] = field(default_factory=list)
    codec: str = ""
    tag: str = ""
    profile: str = ""
    time_base: Fraction = Fraction(0)
    pts: list[int] = field(default_factory=list)


def read_video(path: Path) -> Decoded:
    """Decode every frame and keep every other packet."""
    video = Decoded()
    with av.open(str(path)) as container:
        stream = next(one for one in container.streams.video if not one.disposition & 1024)
        video.tags, video.chapters = dict(container.metadata), container.chapters()
        video.codec, video.tag = stream.codec.canonical_name, stream.codec_context.codec_tag
        video.profile, video.time_base = stream.profile, stream.time_base
        for packet in container.demux():
            if packet.stream.index == stream.index:
                for frame in packet.decode():
                    video.frames.append(frame)
                    video.planes.append(planes_of(frame))
                    video.pts.append(frame.pts)
                    video.times_s.append((frame.pts or 0) * stream.time_base)
            elif packet.size:
                time = packet.pts if packet.pts is not None else packet.dts
                kind = "cover" if packet.stream.type == "video" else packet.stream.type
                video.packets.setdefault(kind, []).append(((time or 0) * packet.time_base, bytes(packet)))
    return video


def planes_of(frame: Any) -> list[np.ndarray]:
    """Copy the planes of a planar frame."""
    dtype = np.uint8 if frame.format.components[0].bits <= 8 else np.uint16
    size = np.dtype(dtype).itemsize
    return [
        np.frombuffer(plane, dtype).reshape(plane.height, plane.line_size // size)[:, : plane.width].copy()
        for plane in frame.planes
    ]


def waves(index: int, size: tuple[int, int] = SIZE, *, top: int = 255) -> np.ndarray:
    """Colour picture (height, width, 3), uint8 or uint16 up to `top`: smooth, and another for every index."""
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    layers = [
        0.5 + 0.3 * np.sin((x + 3 * index) / 7 + phase) + 0.15 * np.cos(y / 5 - phase + index / 9) for phase in (0.0, 1.0, 2.0)
    ]
    return np.round(top * np.stack(layers, axis=-1)).astype(np.uint8 if top < 256 else np.uint16)


def make_video(
    path: Path,
    *,
    frames: int = 10,
    size: tuple[int, int] = SIZE,
    codec: str = "libx264",
    pixels: str = "yuv420p",
    options: dict[str, str] | None = None,
    container: str | None = None,
    container_options: dict[str, str] | None = None,
    times: list[int] | None = None,
    time_base: Fraction = Fraction(1, RATE),
    audio: str | None = None,
    tags: dict[str, str] | None = None,
    rotation: float | None = None,
    chapters: list[Any] | None = None,
    extras: bool = False,
    picture: Any = waves,
    **context: Any,
) -> Path:
    """Write a video whose frames are `picture(index, size)`; further arguments are set on the encoder's context.

    With `extras` come a subtitle and a cover picture, for MP4.
    """
    with av.open(str(path), "w", format=container, container_options=container_options or {}) as target:
        target.metadata.update(tags or {})
        video = target.add_stream(codec, rate=RATE, width=size[0], height=size[1], options=options or {})
        video.pix_fmt = pixels
        video.codec_context.time_base = time_base
        for name, value in context.items():
            setattr(video.codec_context, name, value)
        if rotation is not None:
            video.set_display_rotation(rotation)
        sound = _add_sound(target, audio)
        if chapters:
            target.set_chapters(chapters)
        if extras:
            _add_extras(target)
        for index in range(frames):
            image = picture(index, size)
            frame = av.VideoFrame.from_ndarray(image, format="rgb24").reformat(
                format=pixels, dst_color_range=context.get("color_range", 0), dst_colorspace="itu709"
            )
            for name in ("color_range", "colorspace", "color_trc", "color_primaries"):
                setattr(frame, name, context.get(name, 0 if name == "color_range" else 2))
            frame.pts, frame.time_base = (index if times is None else times[index]), time_base
            target.mux(video.encode(frame))
            if sound is not None:
                target.mux(sound.encode(_tone(index)))
        target.mux(video.encode(None))
        if sound is not None:
            target.mux(sound.encode(None))
    return path


def make_sound(path: Path) -> Path:
    """Write a file with sound alone."""
    with av.open(str(path), "w") as target:
        sound = _add_sound(target, "aac")
        for index in range(10):
            target.mux(sound.encode(_tone(index)))
        target.mux(sound.encode(None))
    return path


def _add_sound(target: Any, codec: str | None) -> Any:
    if codec is None:
        return None
    sound = target.add_stream(codec, rate=48_000)
    sound.layout = "mono"
    return sound


def _add_extras(target: Any) -> None:
    """Add a line of subtitles and a cover picture, with the packets that belong to them."""
    subtitle = target.add_mux_stream("mov_text", time_base=Fraction(1, 1000))
    subtitle.metadata["language"] = "deu"
    cover = target.add_stream("png", rate=1, width=16, height=16)
    cover.pix_fmt, cover.disposition = "rgb24", Disposition.attached_pic
    target.start_encoding()
    text = b"Guten Tag"
    for stream, data, duration in ((cover, png_bytes(), 0), (subtitle, len(text).to_bytes(2) + text, 200)):
        packet = av.Packet(data)
        packet.stream, packet.pts, packet.dts, packet.duration = stream, 0, 0, duration
        packet.time_base, packet.is_keyframe = Fraction(1, 1000), True
        target.mux(packet)


def png_bytes() -> bytes:
    """Encode a small picture."""
    done, encoded = cv2.imencode(".png", waves(0, (16, 16)))
    assert done
    return encoded.tobytes()


def _tone(index: int) -> Any:
    """One video frame's worth of a tone."""
    count = 48_000 // RATE
    wave = 8000 * np.sin((index * count + np.arange(count)) / 20)
    frame = av.AudioFrame.from_ndarray(wave.astype(np.int16)[None], format="s16", layout="mono")
    frame.sample_rate, frame.pts, frame.time_base = 48_000, index * count, Fraction(1, 48_000)
    return frame
