"""Videos, targets and options that cannot be: each refused in one line with what would do, and nothing is left."""

from __future__ import annotations

import av
import pytest
from messages import one_line
from undistorted_videos import CAMERA, INNER, refused, undistort
from videos import RATE, SIZE, make_sound, make_video

from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.workflows.undistort.probe import size_of_source


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
    refused(source, "interlaced .*add --progressive if it is only marked so")
    assert undistort(source, as_progressive=True).frames == 10


def test_whether_it_is_interlaced_can_be_asked_before(tmp_path):
    """The size is known of any video; one that must be progressive is refused then already."""
    source = make_video(tmp_path / "in.mp4", options={"flags": "+ildct+ilme", "x264-params": "tff=1"})
    assert size_of_source(source, 1) == SIZE
    with pytest.raises(InputError, match="interlaced"):
        size_of_source(source, 1, as_progressive=False)


@pytest.mark.parametrize("is_named", [True, False])
def test_progressive_counts_on_the_command_line(tmp_path, run, camera_file, is_named):
    """A video named behind another, and one alone in a folder: refused by name without the option, done with it."""
    (tmp_path / "in").mkdir()
    source = make_video(tmp_path / "in/v.mp4", options={"flags": "+ildct+ilme", "x264-params": "tff=1"})
    inputs = [make_video(tmp_path / "a.mp4", frames=2), source] if is_named else [source.parent]
    given = ("undistort", *inputs, "--camera", camera_file, "-o", tmp_path / "out")
    code, _, err = run(*given)
    assert code == 2
    assert "v.mp4: interlaced" in one_line(err)
    assert "--progressive" in err
    assert not (tmp_path / "out").exists()
    assert run(*given, "--progressive")[0] == 0
    assert (tmp_path / "out/v.mp4").is_file()


def test_frames_that_change_size_are_refused(tmp_path):
    """Two transport streams behind each other are one stream that changes."""
    first, second = (make_video(tmp_path / name, size=size, frames=15) for name, size in (("a.ts", SIZE), ("b.ts", (96, 64))))
    both = tmp_path / "both.ts"
    both.write_bytes(first.read_bytes() + second.read_bytes())
    refused(both, r"frames change at .* s \(got 96x64 yuv420p, expected 64x48 yuv420p\)|time goes back")


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
        ({"quality": 99}, "--crf: out of range .got 99, expected at most 51 for h264, 51 for hevc, 63 for av1"),
        ({"lossless": True, "quality": 5}, "--crf: a lossless video has none"),
        ({"pixel_format": "yuv9"}, "--pixel-format: there is none of that name .got 'yuv9'"),
        ({"pixel_format": "gbrpf32le"}, "pixel format gbrpf32le: not worked on"),
        ({"preset": "slowest"}, "--preset: not one of h264's .got 'slowest', expected one of ultrafast, .*slow"),
        ({"codec": "av1", "preset": "99"}, "libsvtav1 refuses"),
        ({"new": Camera((63, 48), INNER.K)}, "a size that yuv420p cannot have .got 63x48"),
    ],
)
def test_options_that_do_not_go_together(tmp_path, capfd, options, match):
    """Each is refused with what would do, and no encoder says anything by itself."""
    source = make_video(tmp_path / "in.mp4", frames=3)
    capfd.readouterr()
    refused(source, match, **options)
    assert capfd.readouterr() == ("", "")


def test_matroska_is_not_advised_instead_of_itself(tmp_path):
    """A codec that does not fit into it needs no other container, but to be another codec."""
    text = refused(make_video(tmp_path / "in.mkv", frames=3), "--codec: utvideo does not fit", "x.mkv", codec="utvideo")
    assert ".mkv, or" not in text
