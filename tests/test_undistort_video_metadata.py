"""What else is in a video: colours, rotation, tags, subtitles, covers, data and chapters are kept, or named as lost."""

from __future__ import annotations

from fractions import Fraction

import av
import pytest
from undistorted_videos import MAP, OUTER, undistort
from videos import RATE, SIZE, make_video, png_bytes, read_video, waves

from camcal.formats.video.reader import probe_video
from camcal.formats.video.trimming import FrameRange
from camcal.workflows.undistort.video import VideoOptions, undistort_video

NOTE = "Lens distortion removed by camcal"
COLOURS = {
    "bt709": ("yuv420p", {"color_primaries": 1, "color_trc": 1, "colorspace": 1, "color_range": 1}),
    "bt601 full": ("yuvj420p", {"color_primaries": 5, "color_trc": 6, "colorspace": 5, "color_range": 2}),
    "hlg": ("yuv420p10le", {"color_primaries": 9, "color_trc": 18, "colorspace": 9, "color_range": 1}),
}


@pytest.mark.parametrize("colour", COLOURS)
@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".ts"])
def test_colours_are_kept(tmp_path, colour, suffix):
    """Primaries, transfer, matrix, range and depth; black is the range's."""
    pixels, tags = COLOURS[colour]
    source = make_video(tmp_path / f"in{suffix}", pixels=pixels, **tags)
    after = read_video(undistort(source, new=OUTER).path)
    assert {name: getattr(after.frames[0], name) for name in tags} == tags
    assert after.frames[0].format.components[0].bits == (10 if "10" in pixels else 8)
    black = {"bt709": 16, "bt601 full": 0, "hlg": 64}[colour]
    level = 4 if colour == "hlg" else 1
    assert abs(int(after.planes[0][0][0, 0]) - black) <= 2 * level
    assert abs(int(after.planes[0][1][0, 0]) - 128 * level) <= 2 * level


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
@pytest.mark.parametrize("degrees", [90, -90, -180])
def test_rotation_is_kept(tmp_path, suffix, degrees):
    """The display matrix, number by number; the pixels stay as they are stored."""
    source = make_video(tmp_path / f"in{suffix}", rotation=degrees)
    before, after = (read_video(path).frames[0] for path in (source, undistort(source).path))
    assert after.rotation == before.rotation == degrees
    assert (after.width, after.height) == SIZE
    assert bytes(after.side_data["DISPLAYMATRIX"]) == bytes(before.side_data["DISPLAYMATRIX"])


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
def test_aspect_ratio_is_kept(tmp_path, suffix):
    """Pixels that are not square stay so."""
    source = make_video(tmp_path / f"in{suffix}", sample_aspect_ratio=Fraction(4, 3))
    with av.open(str(undistort(source).path)) as made:
        assert made.streams.video[0].sample_aspect_ratio == Fraction(4, 3)


TAGS = {
    "title": "Versuch 7",
    "creation_time": "2024-05-06T07:08:09.000000Z",
    "com.apple.quicktime.model": "iPhone",
    "firmware": "HD9.01",
}


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv"])
def test_tags_are_kept_and_the_correction_is_noted(tmp_path, suffix):
    """The user's tags, makers' own included, are all there, and one more says what was done."""
    more = {"movflags": "use_metadata_tags"} if suffix != ".mkv" else {}
    source = make_video(tmp_path / f"in{suffix}", tags=TAGS, container_options=more)
    made = {key.lower(): text for key, text in read_video(undistort(source).path).tags.items()}
    assert {key: made.get(key) for key in TAGS} == TAGS
    assert made["comment"].startswith(NOTE)


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".avi"])
def test_a_comment_is_not_replaced(tmp_path, suffix):
    """Whoever wrote a comment finds it again, and the note beside it."""
    source = make_video(tmp_path / f"in{suffix}", tags={"comment": "take 3"})
    result = undistort(source)
    made = {key.lower(): text for key, text in read_video(result.path).tags.items()}
    assert made["comment"].startswith("take 3")
    assert any(NOTE in text for text in made.values())
    assert result.warnings == ()


@pytest.mark.parametrize("suffix", [".mp4", ".mov"])
def test_subtitles_and_covers_are_kept(tmp_path, suffix):
    """A line of subtitles and a cover picture, byte by byte; QuickTime has no place for the picture."""
    source = make_video(tmp_path / "in.mp4", extras=True, audio="aac")
    result = undistort(source, suffix)
    before, after = read_video(source), read_video(result.path)
    assert [data for _, data in after.packets["subtitle"]] == [data for _, data in before.packets["subtitle"]]
    if suffix == ".mp4":
        assert after.packets["cover"][0][1] == png_bytes()
        assert result.warnings == ()
    else:
        assert [text for text in result.warnings if "video, png" in text]


def test_what_a_container_does_not_take_is_named(tmp_path):
    """AAC, an MP4 subtitle and a cover do not go into WebM: one warning each, the rest is written."""
    source = make_video(tmp_path / "in.mp4", extras=True, audio="aac", rotation=90)
    result = undistort(source, ".webm", codec="vp9")
    assert len(read_video(result.path).frames) == 10
    for kind in ("audio, aac", "subtitle, mov_text", "video, png"):
        assert [text for text in result.warnings if kind in text], kind
    broadcast = undistort(source, ".ts")
    assert [text for text in broadcast.warnings if "rotation of 90 degrees" in text]


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_sound_of_an_unknown_codec_is_left_out_by_name(tmp_path, suffix):
    """There is neither decoder nor name for it: the pictures are worked on all the same."""
    source = make_video(tmp_path / "in.mp4", audio="aac")
    source.write_bytes(source.read_bytes().replace(b"mp4a", b"zzzz").replace(b"esds", b"zzzz"))
    result = undistort(source, suffix, codec=None if suffix == ".mp4" else "vp9")
    assert result.frames == 10
    assert [text for text in result.warnings if "stream 1 (audio, " in text and "is left out" in text]


def test_data_streams_are_kept(tmp_path):
    """Telemetry in a transport stream goes into another one; MP4 does not take it, which is said."""
    source = tmp_path / "in.ts"
    with av.open(str(source), "w") as target:
        video = target.add_stream("libx264", rate=RATE, width=SIZE[0], height=SIZE[1])
        data = target.add_data_stream("klv")
        for index in range(10):
            frame = av.VideoFrame.from_ndarray(waves(index), format="rgb24").reformat(format="yuv420p")
            frame.pts = index
            target.mux(video.encode(frame))
            packet = av.Packet(b"\x06\x0e+4" + bytes(12) + bytes([1, index]))
            packet.stream, packet.pts, packet.dts, packet.time_base = data, index, index, Fraction(1, RATE)
            target.mux(packet)
        target.mux(video.encode(None))
    assert read_video(undistort(source).path).packets == read_video(source).packets
    assert [text for text in undistort(source, ".mp4").warnings if "data, klv" in text]


def test_chapters_are_kept(tmp_path):
    """Names and times; in a part of the video those that play in it, from its beginning."""
    source = tmp_path / "in.mkv"
    chapters = [
        {"id": 1, "start": 0, "end": 200, "time_base": Fraction(1, 1000), "metadata": {"title": "one"}},
        {"id": 2, "start": 200, "end": 1000, "time_base": Fraction(1, 1000), "metadata": {"title": "two"}},
    ]
    make_video(source, frames=30, chapters=chapters)
    for suffix in (".mkv", ".mp4"):
        made = read_video(undistort(source, suffix).path).chapters
        times = [(float(one["start"] * one["time_base"]), float(one["end"] * one["time_base"])) for one in made]
        assert times == [(0.0, 0.2), (0.2, 1.0)]
        assert [one["metadata"]["title"] for one in made] == ["one", "two"]
    part = undistort_video(source, tmp_path / "part.mkv", MAP, options=VideoOptions(frames=FrameRange.parse("15:24")))
    [chapter] = read_video(part.path).chapters
    assert chapter["metadata"]["title"] == "two"
    assert (chapter["start"] * chapter["time_base"], chapter["end"] * chapter["time_base"]) == (0, Fraction(3, 10))


def test_chapters_end_with_the_part_whatever_rate_is_claimed(tmp_path):
    """A file of 25 frames per second says that it has 30,000: ten of them still last 0.4 seconds."""
    source = tmp_path / "in.mkv"
    chapters = [{"id": 1, "start": 0, "end": 1000, "time_base": Fraction(1, 1000), "metadata": {"title": "one"}}]
    times = [40 * index for index in range(25)]
    make_video(source, frames=25, times=times, time_base=Fraction(1, 1000), chapters=chapters, framerate=Fraction(30_000))
    with av.open(str(source)) as container:
        assert container.streams.video[0].average_rate == 30_000
    part = undistort_video(source, tmp_path / "part.mkv", MAP, options=VideoOptions(frames=FrameRange.parse("5:15")))
    [chapter] = read_video(part.path).chapters
    assert chapter["end"] * chapter["time_base"] == Fraction(4, 10)
    assert probe_video(source).frames in (24, 25)


def test_a_video_says_what_it_is(tmp_path):
    """Size, number of frames, codec, format and rotation, without undistorting it."""
    info = probe_video(make_video(tmp_path / "in.mp4", rotation=90))
    assert (info.size, info.frames, info.codec, info.pixel_format, info.rotation_deg) == (SIZE, 10, "h264", "yuv420p", 90)
