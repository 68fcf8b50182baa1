"""Damaged videos: refused where the damage begins, and the part before it is offered and works."""

from __future__ import annotations

from pathlib import Path

import av
import pytest
from undistorted_videos import CAMERA, INNER, refused, undistort
from videos import make_video

from camcal.formats.video.trimming import FrameRange


@pytest.mark.parametrize("suffix", [".mp4", ".mov"])
def test_a_cut_file_with_an_index_is_refused_before_any_work(tmp_path, suffix):
    """The index reaches past the end: nothing is decoded, and the whole part is offered, which then works."""
    options = {"movflags": "faststart"}
    source = make_video(tmp_path / f"in{suffix}", frames=60, container_options=options, options={"g": "10"})
    cut = tmp_path / f"cut{suffix}"
    cut.write_bytes(source.read_bytes()[: round(0.6 * source.stat().st_size)])
    text = refused(cut, "truncated file", target=f"x{suffix}")
    offered = text.rpartition("--frames ")[2].rstrip(".")
    assert 10 < FrameRange.parse(offered).stop < 50
    part = undistort(cut, frames=FrameRange.parse(offered))
    assert part.frames == FrameRange.parse(offered).stop


def test_a_cut_file_without_an_index_is_refused_where_it_ends(tmp_path):
    """The header says how long it should be; the part before works."""
    source = make_video(tmp_path / "in.mkv", frames=90, options={"g": "10"})
    cut = tmp_path / "cut.mkv"
    cut.write_bytes(source.read_bytes()[: round(0.5 * source.stat().st_size)])
    text = refused(cut, "truncated or damaged at .* s, frame ", target="x.mkv")
    offered = FrameRange.parse(text.rpartition("--frames ")[2].rstrip("."))
    assert offered.stop > 10
    assert undistort(cut, frames=offered).frames == offered.stop


def test_a_cut_file_without_its_index_is_refused(tmp_path):
    """An MP4 whose index would have come last."""
    source = make_video(tmp_path / "in.mp4")
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(source.read_bytes()[: source.stat().st_size // 2])
    refused(cut, "not a video that can be read")


def test_damage_in_the_middle_is_refused_where_it_is(tmp_path):
    """A frame that cannot be decoded stops the work, with its time; the part before works."""
    source = make_video(tmp_path / "in.mov", codec="png", pixels="rgb24", frames=30)
    damaged = overwritten(source, 15)
    text = refused(damaged, "truncated or damaged at ", target="x.mov")
    offered = FrameRange.parse(text.rpartition("--frames ")[2].rstrip("."))
    assert 0 < offered.stop <= 15
    assert undistort(damaged, frames=offered).frames == offered.stop
    rest = undistort(damaged, ".mkv", frames=FrameRange(15))
    assert rest.frames == 14
    assert [text for text in rest.warnings if "1 packet passed over" in text]


def test_damage_that_the_decoder_conceals_is_said(tmp_path):
    """H.264 goes on past a damaged frame: so does the work, with a warning."""
    size = (320, 240)
    source = make_video(tmp_path / "in.mp4", frames=30, size=size, options={"g": "10"})
    result = undistort(overwritten(source, 11), camera=CAMERA.scaled(size), new=INNER.scaled(size))
    assert result.frames == 30
    assert [text for text in result.warnings if "1 damaged frame written" in text]


def overwritten(source: Path, number: int) -> Path:
    """Copy a video, with nonsense for the second half of one of its packets."""
    with av.open(str(source)) as container:
        packet = [packet for packet in container.demux(video=0) if packet.size][number]
        start, size = packet.pos + packet.size // 2, packet.size - packet.size // 2
    content = bytearray(source.read_bytes())
    content[start : start + size] = bytes(index * 37 % 251 for index in range(size))
    damaged = source.with_stem("damaged")
    damaged.write_bytes(bytes(content))
    return damaged
