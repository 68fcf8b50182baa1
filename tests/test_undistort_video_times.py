"""Times of undistorted videos: every frame and every packet of sound at its time, in the whole and in a part."""

from __future__ import annotations

from fractions import Fraction

import av
import numpy as np
import pytest
from undistorted_videos import CONTAINERS, MAP, undistort
from videos import make_video, read_video

from camcal.errors import InputError
from camcal.formats.video.trimming import FrameRange
from camcal.workflows.undistort.video import VideoOptions, undistort_video


@pytest.mark.parametrize("suffix", CONTAINERS)
def test_times_and_sound_are_kept(tmp_path, suffix):
    """Every frame has its time, to the tick, and every packet of the sound its time and its bytes."""
    codec, audio, options = CONTAINERS[suffix]
    pixels = "yuvj420p" if codec == "mjpeg" else "yuv420p"
    source = make_video(tmp_path / f"in{suffix}", codec=codec, pixels=pixels, audio=audio, options=options, frames=20)
    result = undistort(source)
    before, after = read_video(source), read_video(result.path)
    assert result.frames == len(after.frames) == 20
    assert after.pts == before.pts
    assert after.time_base == before.time_base
    assert after.codec == before.codec
    assert after.packets["audio"] == before.packets["audio"]
    assert len(after.packets["audio"]) >= 7


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".ts"])
def test_uneven_times_are_kept(tmp_path, suffix):
    """A variable frame rate, B-frames and a first frame after zero: the same ticks, the same length."""
    times = [90, 105, 180, 185, 190, 400, 405, 900, 910, 1200]
    source = make_video(tmp_path / f"in{suffix}", times=times, time_base=Fraction(1, 1000), options={"bf": "3"})
    before, after = read_video(source), read_video(undistort(source).path)
    assert after.pts == before.pts
    assert after.time_base == before.time_base
    with av.open(str(source)) as old, av.open(str(source.with_name(f"in_out{suffix}"))) as new:
        assert new.streams.video[0].start_time == old.streams.video[0].start_time
        # A transport stream does not say how long its last frame lasts.
        assert abs(new.duration - old.duration) <= (1000 if suffix == ".ts" else 0)


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".ts"])
def test_a_late_start_is_kept(tmp_path, suffix):
    """A video that begins at five seconds ends where its header says, and begins there again."""
    times = [5000 + 100 * index for index in range(10)]
    source = make_video(tmp_path / f"in{suffix}", times=times, time_base=Fraction(1, 1000))
    assert read_video(undistort(source).path).times_s == read_video(source).times_s


def test_times_that_do_not_fit_are_rounded_with_a_warning(tmp_path):
    """Thirds of a tenth of a second in a container that counts milliseconds."""
    source = make_video(tmp_path / "in.mp4")
    result = undistort(source, ".mkv")
    off_s = [abs(a - b) for a, b in zip(read_video(source).times_s, read_video(result.path).times_s, strict=True)]
    assert max(off_s) <= Fraction(1, 2000)
    assert [text for text in result.warnings if "rounded to 1 ms" in text]
    even = make_video(tmp_path / "even.mp4", times=list(range(0, 100, 10)), time_base=Fraction(1, 1000))
    assert undistort(even, ".mkv").warnings == ()


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".ts"])
@pytest.mark.parametrize(("text", "first", "last"), [("7:20", 7, 20), (":12", 0, 12), ("25:", 25, 30), ("0:99", 0, 30)])
def test_a_part_is_that_part_of_the_whole(tmp_path, suffix, text, first, last):
    """The same frames as in the whole, from time zero on; the sound that begins while they are shown, packet by packet."""
    times = list(np.cumsum([1 + index % 3 for index in range(30)]))
    source = make_video(
        tmp_path / f"in{suffix}", frames=30, audio="aac", options={"qp": "0"}, times=times, time_base=Fraction(1, 60)
    )
    whole = read_video(undistort(source).path)
    part = undistort_video(source, tmp_path / f"part{suffix}", MAP, options=VideoOptions(frames=FrameRange.parse(text)))
    made = read_video(part.path)
    assert part.frames == len(made.frames) == last - first
    for old, new in zip(whole.planes[first:last], made.planes, strict=True):
        assert all((a == b).all() for a, b in zip(old, new, strict=True))
    begin_s = whole.times_s[first] if first else Fraction(0)
    shift_s = made.times_s[0] - (whole.times_s[first] - begin_s)
    assert [time - shift_s for time in made.times_s] == [time - begin_s for time in whole.times_s[first:last]]
    end_s = whole.times_s[last] if last < 30 else 1000
    expected = [(t - begin_s, data) for t, data in whole.packets["audio"] if (not first or t >= begin_s) and t < end_s]
    got = [(t - shift_s, data) for t, data in made.packets["audio"]]
    assert [data for _, data in got] == [data for _, data in expected]
    # Times of the sound are rounded to its own unit when they are moved.
    assert max(abs(a - b) for (a, _), (b, _) in zip(got, expected, strict=True)) <= Fraction(1, 1000)


@pytest.mark.parametrize("text", ["", "5", "a:b", "-3:4", "1:2:3", "1.5:3"])
def test_ranges_are_two_numbers(text):
    """Anything else is refused."""
    with pytest.raises(InputError, match="--frames: not a range"):
        FrameRange.parse(text)


@pytest.mark.parametrize("text", ["5:5", "7:3", "0:0"])
def test_empty_ranges_are_refused(text):
    """A range must hold a frame."""
    with pytest.raises(InputError, match="--frames: an empty range"):
        FrameRange.parse(text)


def test_a_range_past_the_end_is_refused(tmp_path):
    """Nothing is written where there is no frame."""
    source = make_video(tmp_path / "in.mp4")
    with pytest.raises(InputError, match=r"no frame in the range \(got frames 10:20"):
        undistort(source, frames=FrameRange(10, 20))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.mp4"]
