"""Codecs of undistorted videos: the source's as far as it can be written, or the one asked for."""

from __future__ import annotations

import av
import numpy as np
import pytest
from undistorted_videos import CAMERA, INNER, OUTER, refused, sampled, undistort
from videos import SIZE, make_video, read_video

from camcal.formats.video.lossless import is_lossless
from camcal.geometry.camera import Camera

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
    sizes = {q: undistort(source, target=tmp_path / f"q{q}.mp4", quality=q).path.stat().st_size for q in (10, 40)}
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
