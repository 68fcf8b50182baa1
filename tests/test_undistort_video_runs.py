"""How videos are worked on: bounded memory, the same bytes each time, nothing half-written, libav only when needed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from loaded_modules import loaded_by
from undistorted_videos import CAMERA, CONTAINERS, INNER, MAP, refused
from videos import make_video

from camcal.formats.video.codecs import EncodingOptions
from camcal.undistortion.maps import undistort_map
from camcal.workflows.undistort.video import VideoOptions, undistort_video


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


LOGGING = """
import sys
import av
from camcal.formats.video.reader import probe_video
av.logging.set_level(av.logging.ERROR)
for _ in range(20):
    probe_video(sys.argv[1])
"""


def test_a_decoder_that_logs_does_not_wait_for_who_drops_it(tmp_path):
    """Twenty videos opened and closed in the middle, while libav logs by way of Python: no thread waits for another."""
    source = make_video(tmp_path / "in.mp4", frames=60)
    subprocess.run([sys.executable, "-c", LOGGING, source], check=True, timeout=60)


def test_libav_is_imported_only_for_videos():
    """Whoever undistorts photographs does not wait for it."""
    assert "av" not in loaded_by("import camcal.workflows.undistort.video")


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
