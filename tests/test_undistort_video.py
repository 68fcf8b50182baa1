"""Videos undistorted: every frame at its time and where the geometry says, and all else in the file as it was."""

from __future__ import annotations

import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from videos import RATE, SIZE, make_sound, make_video, png_bytes, read_video, waves

from camcal.errors import InputError
from camcal.formats.video.codecs import EncodingOptions
from camcal.formats.video.lossless import is_lossless
from camcal.formats.video.pixels import planar_layout
from camcal.formats.video.reader import probe_video
from camcal.formats.video.trimming import FrameRange
from camcal.geometry.camera import Camera
from camcal.undistortion.maps import undistort_map
from camcal.workflows.undistort.video import VideoOptions, VideoResult, undistort_video

BARREL = [-0.2, 0.05, 0.001, -0.002, 0]
CAMERA = Camera(SIZE, [[50, 0, 30.3], [0, 51, 24.7], [0, 0, 1]], BARREL)
# The one sees the source with every pixel, the other sees past it on every side.
INNER = Camera(SIZE, [[62, 0, 31.1], [0, 63, 24.2], [0, 0, 1]])
OUTER = Camera(SIZE, [[38, 0, 31.1], [0, 39, 24.2], [0, 0, 1]])
MAP = undistort_map(CAMERA, INNER)
NOTE = "Lens distortion removed by camcal"


def undistort(source: Path, suffix: str = "", *, camera: Camera = CAMERA, new: Camera = INNER, **options) -> VideoResult:
    """Undistort beside the source, with options of the encoding given by name."""
    own = {name: options.pop(name) for name in ("frames", "interpolation", "as_progressive") if name in options}
    target = source.with_name(f"{source.stem}_out{suffix or source.suffix}")
    chosen = VideoOptions(encoding=EncodingOptions(**options), **own)
    return undistort_video(source, target, undistort_map(camera, new), options=chosen)


def sampled(plane: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Interpolate a plane linearly at points (..., 2) between its outermost samples."""
    last = np.array(plane.shape[::-1]) - 1
    xy = np.clip(xy, 0, last)
    low = np.minimum(xy.astype(int), last - 1)
    (u, v), (i, j) = np.moveaxis(xy - low, -1, 0), np.moveaxis(low, -1, 0)
    value = plane.astype(np.float64)
    return (1 - v) * ((1 - u) * value[j, i] + u * value[j, i + 1]) + v * ((1 - u) * value[j + 1, i] + u * value[j + 1, i + 1])


def expected_plane(
    plane: np.ndarray, new: Camera, step: tuple[int, int], offset: tuple[float, float], black: int
) -> np.ndarray:
    """What a plane becomes, from the cameras alone; NaN within a pixel of where the source ends."""
    height, width = -(-new.size[1] // step[1]), -(-new.size[0] // step[0])
    samples = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    seen = CAMERA.project(new.unproject(samples * step + offset))
    values = sampled(plane, np.nan_to_num((seen - offset) / step))
    inside, near = CAMERA.contains(seen, margin_px=1.5), CAMERA.contains(seen, margin_px=-0.5)
    return np.where(inside, values, np.where(near, np.nan, black))


# --- pixels ---------------------------------------------------------------------------------------------------------------

FORMATS = {
    "yuv420p": ((2, 2), (0.0, 0.5), (16, 128, 128)),
    "yuv422p": ((2, 1), (0.0, 0.0), (16, 128, 128)),
    "yuv444p": ((1, 1), (0.0, 0.0), (16, 128, 128)),
    "yuv420p10le": ((2, 2), (0.0, 0.5), (64, 512, 512)),
    "yuv444p16le": ((1, 1), (0.0, 0.0), (4096, 32768, 32768)),
    "gray": ((1, 1), (0.0, 0.0), (0,)),
    "yuva420p": ((2, 2), (0.0, 0.5), (16, 128, 128, 0)),
}


@pytest.mark.parametrize("new", [INNER, OUTER], ids=["inner", "outer"])
@pytest.mark.parametrize("pixels", FORMATS)
def test_every_plane_goes_where_the_cameras_say(tmp_path, pixels, new):
    """Each sample of each plane is interpolated where its ray meets the source's plane; what sees nothing is video black.

    float32 coordinates and a map accurate to 2e-4 pixels move a value by 2e-4 of the steepest slope (some 25 levels of 256
    a pixel), rounding by half a level: together below one level of 8 bits, 2 of 10, 6 of 16.
    """
    source = make_video(tmp_path / "in.mkv", codec="ffv1", pixels=pixels, frames=6)
    result = undistort(source, new=new)
    before, after = read_video(source), read_video(result.path)
    step, offset, blacks = FORMATS[pixels]
    bound = {8: 0.6, 10: 0.6, 16: 6.0}[before.frames[0].format.components[0].bits]
    assert after.frames[0].format.name == pixels
    assert len(after.planes) == 6
    for old, made in zip(before.planes, after.planes, strict=True):
        for index, black in enumerate(blacks):
            coarse = index in (1, 2)
            expected = expected_plane(old[index], new, step if coarse else (1, 1), offset if coarse else (0.0, 0.0), black)
            known = np.isfinite(expected)
            assert known.mean() > 0.8
            assert np.abs(made[index] - expected)[known].max() <= bound


def test_nothing_turns_gray_at_the_edges(tmp_path):
    """Where every pixel sees the source, a picture of one colour keeps that colour to its last sample."""
    red = lambda _, size: np.full((size[1], size[0], 3), (200, 30, 40), np.uint8)  # noqa: E731
    source = make_video(tmp_path / "in.mkv", codec="ffv1", frames=2, picture=red)
    before, after = read_video(source), read_video(undistort(source).path)
    for old, new in zip(before.planes[0], after.planes[0], strict=True):
        assert old.min() == old.max()
        assert (new == old[0, 0]).all()


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 9])
def test_frames_are_the_same_in_any_company(tmp_path, count):
    """However many frames are moved together, each becomes what it becomes alone."""
    every = make_video(tmp_path / "in.mkv", codec="ffv1", frames=9)
    together = read_video(undistort(every).path).planes
    few = make_video(tmp_path / "few.mkv", codec="ffv1", frames=count)
    alone = read_video(undistort_video(few, tmp_path / "little.mkv", MAP).path).planes
    assert len(alone) == count
    for one, other in zip(alone, together, strict=False):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_straight_edge_is_straight(tmp_path):
    """An edge that the lens bends by more than a pixel is straight to 0.02 pixels afterwards."""
    size = (320, 240)
    camera = Camera(size, [[250, 0, 155.3], [0, 251, 122.7], [0, 0, 1]], BARREL)
    new = Camera(size, [[290, 0, 159.5], [0, 291, 119.5], [0, 0, 1]])
    slope, start = 0.15, 60.0

    def edge(_index, _size):
        ideal = new.project(camera.unproject(np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), axis=-1)))
        profile = 0.5 + 0.5 * np.tanh((ideal[..., 0] - start - slope * ideal[..., 1]) / 2.5)
        return np.repeat((30 + 190 * profile).round().astype(np.uint8)[..., None], 3, axis=-1)

    source = make_video(tmp_path / "in.mkv", codec="ffv1", pixels="gray", frames=1, size=size, picture=edge)
    made = read_video(undistort(source, camera=camera, new=new).path).planes[0][0].astype(float)
    rows = np.arange(10, 230)
    assert np.abs(straightness(read_video(source).planes[0][0].astype(float), rows)).max() > 1
    # Rounding to levels (standard deviation 0.29) over a slope of 38 levels a pixel: 0.0076 pixels per row.
    residuals = straightness(made, rows)
    assert residuals.std() <= 0.02
    fit = np.polyfit(rows, residuals, 2)[0] * 110**2
    assert abs(fit) <= 0.02


def straightness(image: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """How far an upright edge's half-way crossings lie from the straight line through them, pixels per row."""
    crossings = []
    for row in image[rows]:
        right = int(np.argmax(row > 125))
        crossings.append(right - (row[right] - 125) / (row[right] - row[right - 1]))
    return np.array(crossings) - np.polyval(np.polyfit(rows, crossings, 1), rows)


@pytest.mark.parametrize("pixels", ["bgr0", "bgra"])
def test_packed_rgb_is_moved_too(tmp_path, pixels):
    """Pixels that lie side by side come back as they were where nothing moves."""
    source = make_video(tmp_path / "in.mkv", codec="ffv1", pixels=pixels, frames=3)
    still = Camera(SIZE, CAMERA.K)
    result = undistort_video(source, tmp_path / "out.mkv", undistort_map(still, still))
    assert result.pixel_format == pixels
    for old, new in zip(read_video(source).frames, read_video(result.path).frames, strict=True):
        assert old.format.name == new.format.name
        np.testing.assert_array_equal(*(frame.reformat(format="rgba").to_ndarray() for frame in (old, new)))


@pytest.mark.parametrize("codec", ["libx264", "ffv1"])
def test_a_lens_that_does_nothing_changes_nothing(tmp_path, codec):
    """Without a lens, a lossless video comes back sample by sample."""
    options = {"qp": "0"} if codec == "libx264" else {}
    source = make_video(tmp_path / "in.mkv", codec=codec, options=options)
    still = Camera(SIZE, CAMERA.K)
    result = undistort_video(source, tmp_path / "out.mkv", undistort_map(still, still))
    for old, new in zip(read_video(source).planes, read_video(result.path).planes, strict=True):
        for a, b in zip(old, new, strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(("codec", "suffix"), [("ffv1", ".mkv"), ("libvpx-vp9", ".webm"), ("mjpeg", ".mov")])
def test_odd_sizes(tmp_path, codec, suffix):
    """Half a chroma sample at the edges is no hindrance where the codec has a place for it."""
    size = (63, 47)
    pixels = "yuvj420p" if codec == "mjpeg" else "yuv420p"
    options = {"cpu-used": "8", "b": "0", "crf": "10"} if codec == "libvpx-vp9" else {}
    source = make_video(tmp_path / f"in{suffix}", codec=codec, pixels=pixels, options=options, size=size, frames=3)
    camera, new = (Camera(size, one.K, one.dist) for one in (CAMERA, INNER))
    made = read_video(undistort(source, camera=camera, new=new).path)
    assert (made.frames[0].width, made.frames[0].height) == size
    assert len(made.frames) == 3


def test_jpeg_chroma_lies_in_the_middle_of_its_pixels(tmp_path):
    """Chroma of motion JPEG is moved from where it lies; half a pixel beside it, it would not be this."""
    source = make_video(tmp_path / "in.mov", codec="mjpeg", pixels="yuvj420p", options={"q": "1"}, frames=2)
    result = undistort(source, ".mkv", codec="ffv1", pixel_format="yuv420p")
    before, after = read_video(source), read_video(result.path)
    errors = []
    for offset in ((0.5, 0.5), (0.0, 0.5)):
        expected = expected_plane(before.planes[0][1], INNER, (2, 2), offset, 128)
        errors.append(np.nanmax(np.abs(after.planes[0][1] - expected)))
    assert errors[0] <= 0.6
    assert errors[1] > 1.2
    assert read_video(undistort(source, ".mp4", codec="h264").path).frames[0].color_range == 2


LAYOUTS = {
    "yuv420p": ("yuv420p", 8, [(1, 1), (2, 2), (2, 2)], [16, 128, 128]),
    "yuvj422p": ("yuv422p", 8, [(1, 1), (2, 1), (2, 1)], [0, 128, 128]),
    "nv12": ("yuv420p", 8, [(1, 1), (2, 2), (2, 2)], [16, 128, 128]),
    "p010le": ("yuv420p10le", 10, [(1, 1), (2, 2), (2, 2)], [64, 512, 512]),
    "yuyv422": ("yuv422p", 8, [(1, 1), (2, 1), (2, 1)], [16, 128, 128]),
    "yuv411p": ("yuv411p", 8, [(1, 1), (4, 1), (4, 1)], [16, 128, 128]),
    "yuva444p12le": ("yuva444p12le", 12, [(1, 1)] * 4, [256, 2048, 2048, 0]),
    "gray10le": ("gray10le", 10, [(1, 1)], [0]),
    "rgb48be": ("gbrp16le", 16, [(1, 1)] * 3, [0, 0, 0]),
    "pal8": ("gbrap", 8, [(1, 1)] * 4, [0, 0, 0, 0]),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts_are_libav_s(name):
    """Planar name, depth, steps and black of each kind of format, written down by hand."""
    layout = planar_layout(name)
    planes = [plane.step for plane in layout.planes], [plane.black for plane in layout.planes]
    assert (layout.name, layout.depth, *planes) == LAYOUTS[name]


@pytest.mark.parametrize("name", ["gbrpf32le", "bayer_rggb8", "xyz12le", "ya8"])
def test_other_samples_are_refused(name):
    """Floats, mosaics, XYZ and gray with alpha."""
    with pytest.raises(InputError, match=f"pixel format {name}: not worked on"):
        planar_layout(name)


# --- what is kept ---------------------------------------------------------------------------------------------------------

CONTAINERS = {
    ".mp4": ("libx264", "aac", {}),
    ".mov": ("libx264", "pcm_s16le", {}),
    ".mkv": ("libx264", "flac", {}),
    ".webm": ("libvpx-vp9", "libopus", {"cpu-used": "8", "b": "0", "crf": "30"}),
    ".ts": ("libx264", "aac", {}),
    ".avi": ("mjpeg", "pcm_s16le", {}),
}


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


# --- codecs ---------------------------------------------------------------------------------------------------------------

CODECS = {
    "h264": ("libx264", ".mp4", "yuv420p", {}),
    "h264 10 bit": ("libx264", ".mp4", "yuv420p10le", {}),
    "h264 4:4:4": ("libx264", ".mkv", "yuv444p", {}),
    "hevc 10 bit 4:2:2": ("libx265", ".mp4", "yuv422p10le", {"x265-params": "log-level=none"}),
    "av1 10 bit": ("libsvtav1", ".mkv", "yuv420p10le", {"preset": "12"}),
    "vp8": ("libvpx", ".webm", "yuv420p", {"cpu-used": "8", "b": "1M"}),
    "prores": ("prores_ks", ".mov", "yuv422p10le", {"profile": "lt"}),
    "mjpeg": ("mjpeg", ".mov", "yuvj422p", {}),
}


@pytest.mark.parametrize("kind", CODECS)
def test_codec_and_pixels_are_the_source_s(tmp_path, kind):
    """The same codec, depth and subsampling; what is seen is the source's picture, moved."""
    codec, suffix, pixels, options = CODECS[kind]
    source = make_video(tmp_path / f"in{suffix}", codec=codec, pixels=pixels, options=options, size=(128, 96), frames=5)
    camera = CAMERA.scaled((128, 96))
    result = undistort(source, camera=camera, new=INNER.scaled((128, 96)))
    before, after = read_video(source), read_video(result.path)
    assert after.codec == before.codec
    assert after.frames[0].format.name == before.frames[0].format.name == pixels
    assert after.profile == before.profile
    seen = camera.project(INNER.scaled((128, 96)).unproject(np.stack(np.meshgrid(np.arange(128), np.arange(96)), axis=-1)))
    level = 1 << (before.frames[0].format.components[0].bits - 8)
    for old, made in zip(before.planes, after.planes, strict=True):
        assert np.abs(made[0] - sampled(old[0], seen)).mean() <= 2.5 * level
    assert result.warnings == ()


def test_twelve_bits_of_prores_become_ten_with_a_warning(tmp_path):
    """The decoder of ProRes 4444 gives more than its encoder takes: the codec is kept, the loss is named."""
    source = make_video(tmp_path / "in.mov", codec="prores_ks", pixels="yuv444p10le", options={"profile": "4444"}, frames=2)
    result = undistort(source)
    assert read_video(result.path).codec == "prores"
    assert [text for text in result.warnings if "written as yuv444p10le" in text]


LOSSLESS = {
    "h264": ("libx264", ".mp4", "yuv420p", {"qp": "0"}, "h264"),
    "h264 rgb": ("libx264rgb", ".mkv", "bgr0", {"qp": "0"}, "h264"),
    "hevc": ("libx265", ".mp4", "yuv420p", {"x265-params": "lossless=1:log-level=none"}, "hevc"),
    "ffv1": ("ffv1", ".mkv", "yuv422p10le", {}, "ffv1"),
    "huffyuv": ("huffyuv", ".avi", "yuv422p", {}, "huffyuv"),
    "png": ("png", ".mov", "rgb24", {}, "png"),
    "utvideo into mp4": ("utvideo", ".avi", "yuv420p", {}, "ffv1"),
}


@pytest.mark.parametrize("kind", LOSSLESS)
def test_lossless_stays_lossless(tmp_path, kind):
    """Where nothing moves, every sample comes back; a codec that the container does not take is replaced by a lossless one."""
    codec, suffix, pixels, options, expected = LOSSLESS[kind]
    source = make_video(tmp_path / f"in{suffix}", codec=codec, pixels=pixels, options=options, frames=4)
    still = Camera(SIZE, CAMERA.K)
    result = undistort(source, ".mp4" if "into" in kind else "", camera=still, new=still)
    before, after = read_video(source), read_video(result.path)
    assert after.codec == expected
    for old, new in zip(before.frames, after.frames, strict=True):
        assert old.format.name == new.format.name
    for old, new in zip(before.planes, after.planes, strict=True):
        assert all((a == b).all() for a, b in zip(old, new, strict=True))


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".ts"])
def test_lossy_video_is_told_from_lossless(tmp_path, codec, suffix):
    """The parameter sets say which it is, in each of the two ways to store them."""
    quiet = {"x265-params": "log-level=none"} if codec == "libx265" else {}
    for pixels in ("yuv420p", "yuv444p"):
        lossy = make_video(tmp_path / f"lossy{suffix}", codec=codec, pixels=pixels, options={"crf": "10", **quiet}, frames=2)
        with av.open(str(lossy)) as container:
            stream = container.streams.video[0]
            assert not is_lossless(stream.codec.canonical_name, stream.codec_context.extradata)


def test_hdr_metadata_is_named_if_it_is_lost(tmp_path):
    """What a display should know of an HDR video does not pass through the encoder: it is said."""
    mastering = "G(13250,34500)B(7500,3000)R(34000,16000)WP(15635,16450)L(10000000,1)"
    options = {"x265-params": f"log-level=none:master-display={mastering}:max-cll=1000,400"}
    source = make_video(tmp_path / "in.mp4", codec="libx265", pixels="yuv420p10le", options=options, frames=3)
    warnings = undistort(source).warnings
    assert [text for text in warnings if "HDR mastering data of the frames is not carried over" in text]
    assert [text for text in warnings if "HDR light levels of the frames is not carried over" in text]


def test_old_codecs_become_h264_with_a_warning(tmp_path):
    """MPEG-4 part 2 is read, and H.264 written."""
    result = undistort(make_video(tmp_path / "in.mp4", codec="mpeg4"))
    assert result.encoder == "libx264"
    assert [text for text in result.warnings if "mpeg4" in text and "h264" in text]


def test_settings_are_the_user_s(tmp_path):
    """Codec, quality, pixel format, preset and losslessness as asked for, without a warning."""
    source = make_video(tmp_path / "in.mp4", frames=4)
    sizes = {q: undistort_sized(source, f"q{q}.mp4", quality=q) for q in (10, 40)}
    assert sizes[10] > 1.3 * sizes[40]
    chosen = undistort(source, ".mkv", codec="hevc", pixel_format="yuv444p10le", preset="ultrafast", lossless=True)
    made = read_video(chosen.path)
    assert (made.codec, made.frames[0].format.name, chosen.encoder) == ("hevc", "yuv444p10le", "libx265")
    assert not [text for text in chosen.warnings if "hevc" in text]
    assert read_video(undistort(source, ".mov", codec="h265").path).tag == "hvc1"


def test_limited_range_becomes_full_only_if_asked_for(tmp_path):
    """JPEG knows full range alone: it is refused for a limited video until its pixel format is named, then converted."""
    flat = lambda _, size: np.full((size[1], size[0], 3), 255, np.uint8)  # noqa: E731
    source = make_video(tmp_path / "in.avi", codec="ffv1", color_range=1, picture=flat)
    refused(source, "--codec: mjpeg cannot hold yuv420p .it holds yuvj420p", target="x.avi", codec="mjpeg")
    result = undistort(source, new=OUTER, codec="mjpeg", pixel_format="yuvj420p", quality=1)
    before, after = read_video(source).planes[0][0], read_video(result.path).planes[0][0]
    assert before.max() == 235
    # Nearest to no loss, JPEG's steps are a few levels.
    assert after[24, 31] >= 252
    assert after[0, 0] <= 3


def undistort_sized(source: Path, name: str, **options) -> int:
    """Undistort and return the size of the file."""
    chosen = VideoOptions(encoding=EncodingOptions(**options))
    return undistort_video(source, source.with_name(name), MAP, options=chosen).path.stat().st_size


# --- parts ----------------------------------------------------------------------------------------------------------------


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


# --- memory, repetition, interruption -------------------------------------------------------------------------------------


def test_memory_does_not_grow_with_the_video(tmp_path):
    """Between a fifth of the frames and the last, the process grows by less than a twentieth of what those frames take."""
    frames, size = 400, (320, 240)
    source = make_video(tmp_path / "in.mp4", frames=frames, size=size, audio="aac", options={"preset": "ultrafast"})
    pages: list[int] = []
    camera, new = (one.scaled(size) for one in (CAMERA, INNER))
    chosen = VideoOptions(encoding=EncodingOptions(preset="ultrafast", threads=2))
    undistort_video(
        source, tmp_path / "out.mp4", undistort_map(camera, new), options=chosen, advance=lambda: pages.append(resident_bytes())
    )
    assert len(pages) == frames
    held = (frames - frames // 5) * size[0] * size[1] * 3 // 2
    assert pages[-1] - pages[frames // 5] < held / 20


def resident_bytes() -> int:
    """Memory that this process holds at the moment."""
    statm = Path("/proc/self/statm")
    if not statm.exists():
        pytest.skip("no /proc here")
    return int(statm.read_text().split()[1]) * 4096


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".webm", ".ts"])
def test_the_same_again_gives_the_same_bytes(tmp_path, suffix):
    """Nothing in a file is drawn by lot or from the clock."""
    codec, audio, options = CONTAINERS[suffix]
    source = make_video(tmp_path / f"in{suffix}", codec=codec, audio=audio, options=options)
    once, again = (undistort_video(source, tmp_path / f"{name}{suffix}", MAP).path.read_bytes() for name in ("a", "b"))
    assert once == again


@pytest.mark.parametrize("after", [1, 5, 10])
def test_an_interruption_leaves_nothing_and_replaces_nothing(tmp_path, after):
    """Ctrl-C after any frame: the file that was there is as it was, and there is no other."""
    source = make_video(tmp_path / "in.mp4", audio="aac")
    target = tmp_path / "out.mp4"
    target.write_bytes(b"precious")
    count = 0

    def advance():
        nonlocal count
        count += 1
        if count == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        undistort_video(source, target, MAP, force=True, advance=advance)
    assert target.read_bytes() == b"precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.mp4", "out.mp4"]


def test_libav_is_imported_only_for_videos():
    """Whoever undistorts photographs does not wait for it."""
    code = "import sys, camcal.workflows.undistort.video; sys.exit('av' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# --- bad input ------------------------------------------------------------------------------------------------------------


def refused(source: Path, match: str, target: str = "refused.mp4", **options) -> str:
    """Undistort what cannot be, check that nothing is left, and return the one line that says why."""
    before = sorted(source.parent.iterdir())
    own = {name: options.pop(name) for name in ("frames", "as_progressive") if name in options}
    camera, new = options.pop("camera", CAMERA), options.pop("new", INNER)
    with pytest.raises(InputError, match=match) as raised:
        undistort_video(
            source,
            source.parent / target,
            undistort_map(camera, new),
            options=VideoOptions(encoding=EncodingOptions(**options), **own),
        )
    assert sorted(source.parent.iterdir()) == before
    text = str(raised.value)
    assert "\n" not in text
    return text


def test_what_is_no_video_is_named_as_what_it_is(tmp_path):
    """Nothing there, a folder, an empty file, text, and sound without pictures."""
    empty, text, folder = tmp_path / "empty.mp4", tmp_path / "text.mp4", tmp_path / "folder.mp4"
    empty.touch()
    text.write_text("no video at all\n" * 100)
    folder.mkdir()
    refused(tmp_path / "missing.mp4", "cannot be read .no such file")
    refused(folder, "a folder")
    refused(empty, "empty file")
    refused(text, "not a video that can be read")
    refused(make_sound(tmp_path / "sound.mp4"), r"no video in this file \(got audio\)")


def test_a_video_without_frames(tmp_path):
    """A header, and nothing behind it."""
    source = tmp_path / "none.avi"
    with av.open(str(source), "w") as target:
        target.add_stream("mpeg4", rate=RATE, width=SIZE[0], height=SIZE[1])
        target.start_encoding()
    refused(source, "no frame could be decoded|not a video that can be read")


def test_the_wrong_size_is_refused_by_name(tmp_path):
    """A camera of another size; of a video that is shown upright, the stored size is named."""
    source = make_video(tmp_path / "in.mp4", rotation=90)
    text = refused(source, "not the camera's image size", camera=CAMERA.scaled((48, 64)))
    assert "in.mp4" in text
    assert "got 64x48, shown turned by 90 degrees, expected 48x64" in text


def test_interlaced_video_is_refused_unless_it_is_only_marked_so(tmp_path):
    """Two moments in one frame cannot be moved together; what a person declares to be whole is."""
    options = {"flags": "+ildct+ilme", "x264-params": "tff=1"}
    source = make_video(tmp_path / "in.mp4", options=options)
    refused(source, "interlaced")
    assert undistort(source, as_progressive=True).frames == 10


def test_frames_that_change_size_are_refused(tmp_path):
    """Two transport streams behind each other are one stream that changes."""
    first, second = (make_video(tmp_path / name, size=size, frames=15) for name, size in (("a.ts", SIZE), ("b.ts", (96, 64))))
    both = tmp_path / "both.ts"
    both.write_bytes(first.read_bytes() + second.read_bytes())
    refused(both, r"frames change at .* s \(got 96x64 yuv420p, expected 64x48 yuv420p\)|time goes back")


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


def test_targets_that_cannot_be(tmp_path):
    """The source itself, a file that exists, no video's name, a folder, and a place that is no folder."""
    source = make_video(tmp_path / "in.mp4")
    (tmp_path / "there.mp4").write_bytes(b"precious")
    (tmp_path / "folder.mp4").mkdir()
    (tmp_path / "file").touch()
    refused(source, "output would replace its own input", target="in.mp4")
    refused(source, "output file exists", target="there.mp4")
    refused(source, r"not a video to write \(got '.gif', expected one of .mp4", target="x.gif")
    refused(source, "a folder", target="folder.mp4")
    refused(source, "cannot be written|a file stands where", target="file/x.mp4")


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"codec": "betamax"}, "--codec: not one that is written .* expected one of h264"),
        ({"codec": "utvideo"}, "--codec: utvideo does not fit into mp4"),
        ({"codec": "av1", "pixel_format": "yuv444p"}, "--codec: av1 cannot hold yuv444p .it holds yuv420p, yuv420p10le"),
        ({"codec": "mjpeg", "lossless": True}, "--codec: mjpeg cannot be lossless"),
        ({"quality": 60}, "--crf: out of h264's range .got 60, expected 0 to 51"),
        ({"quality": 99}, "--crf: out of range .got 99"),
        ({"lossless": True, "quality": 5}, "--crf: a lossless video has none"),
        ({"pixel_format": "yuv9"}, "--pixel-format: there is none of that name .got 'yuv9'"),
        ({"pixel_format": "gbrpf32le"}, "pixel format gbrpf32le: not worked on"),
        ({"preset": "warp"}, "libx264 refuses"),
        ({"new": Camera((63, 48), INNER.K)}, "a size that yuv420p cannot have .got 63x48"),
    ],
)
def test_options_that_do_not_go_together(tmp_path, options, match):
    """Each is refused with what would do."""
    refused(make_video(tmp_path / "in.mp4", frames=3), match, **options)


def test_a_full_disk_leaves_nothing(tmp_path):
    """When the file may not grow any more, one line says so, and no part of it stays."""
    resource = pytest.importorskip("resource")
    signal = pytest.importorskip("signal")
    source = make_video(tmp_path / "in.mkv", codec="ffv1", frames=60)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        refused(source, "cannot be written .file too large", target="out.mkv")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, handler)


def test_a_video_says_what_it_is(tmp_path):
    """Size, number of frames, codec, format and rotation, without undistorting it."""
    info = probe_video(make_video(tmp_path / "in.mp4", rotation=90))
    assert (info.size, info.frames, info.codec, info.pixel_format, info.rotation_deg) == (SIZE, 10, "h264", "yuv420p", 90)
