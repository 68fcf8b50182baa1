"""`camcal undistort` as a command: its options, what it says, what it leaves after a crash, and how soon it begins."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import click
import cv2
import pytest
from every_command import COMMANDS
from loaded_modules import loaded_by
from messages import one_line
from undistort_files import make_images, tree
from videos import make_video, read_video
from waiting import wait_for

from camcal.formats.camera_file import load_intrinsics
from camcal.formats.ledger_file import LEDGER_NAME


def test_what_it_says(undistort):
    """One line on what was written: for a folder, for one file, with a video, for points, and when all was done before."""
    assert undistort("photos", "-o", "flat") == (0, "flat: 3 undistorted images and their camera.yaml.\n", "")
    assert undistort("photos", "-o", "flat", "--resume") == (
        0,
        "flat: nothing new (3 done before) and their camera.yaml.\n",
        "",
    )
    assert undistort("photos/a.png", "-o", "one") == (0, "one: 1 undistorted image and its camera.yaml.\n", "")
    assert undistort("photos/a.png", "-o", "b.png", "--distort") == (0, "b.png: distorted; its camera is b.camera.yaml.\n", "")
    make_video(Path("photos/clip.mkv"), codec="ffv1", frames=2)
    assert undistort("photos", "-o", "both")[1] == "both: 3 undistorted images and 1 undistorted video and their camera.yaml.\n"
    Path("p.csv").write_text("x,y\n1,2\n")
    assert undistort("p.csv", "-o", "points") == (0, "points: 1 undistorted file of points and its camera.yaml.\n", "")


def test_every_option_of_the_geometry(undistort):
    """Each reaches the camera of the results."""
    cameras = {}
    for name, flags in {
        "plain": (),
        "alpha": ("--alpha", "1"),
        "fov": ("--fov", "60"),
        "size": ("--size", "32x24"),
        "scale": ("--scale", "2"),
        "crop": ("--alpha", "1", "--crop", "valid"),
        "target": ("--target", "size"),
    }.items():
        assert undistort("photos/a.png", "-o", name, *flags)[0] == 0
        cameras[name] = load_intrinsics(name).camera
    assert cameras["alpha"].K[0, 0] < cameras["plain"].K[0, 0]
    assert cameras["fov"].field_of_view_deg[0] == pytest.approx(60, abs=1e-9)
    assert cameras["size"].size == (32, 24)
    assert cameras["scale"].size == (128, 96)
    assert cameras["crop"].size < cameras["alpha"].size
    assert cameras["target"].intrinsics.tolist() == cameras["size"].intrinsics.tolist()
    make_images(Path(), "large.png", size=(128, 96))
    assert undistort("large.png", "-o", "large", "--rescale")[0] == 0
    assert load_intrinsics("large").camera.size == (128, 96)


def test_options_of_pixels_and_files(undistort):
    """Format, quality, fill, mask, maps, interpolation, exact positions and light, all at once."""
    flags = ("--format", "tif", "--fill", "10,20,30", "--mask", "--maps", "--interpolation", "lanczos", "--exact")
    assert undistort("photos", "-o", "flat", *flags, "--gamma", "srgb", "--alpha", "1", "--most-pixels", "10000")[0] == 0
    assert tree(Path("flat")) == ["a.tif", "b.tif", "c.tif", "camera.yaml", "maps.npz", "maps.tiff", "mask.png", LEDGER_NAME]
    outside = cv2.imread("flat/mask.png", cv2.IMREAD_UNCHANGED) == 0
    assert (cv2.imread("flat/a.tif")[outside] == (30, 20, 10)).all()


def test_options_of_videos(undistort):
    """Codec, quality, pixels, preset and frames reach the encoder."""
    make_video(Path("clip.mkv"), codec="ffv1", frames=6)
    flags = (
        "--codec",
        "h264",
        "--crf",
        "30",
        "--pixel-format",
        "yuv444p",
        "--preset",
        "ultrafast",
        "--frames",
        "2:5",
        "--lossy",
    )
    assert undistort("clip.mkv", "-o", "out.mp4", *flags)[0] == 0
    video = read_video(Path("out.mp4"))
    assert (video.codec, len(video.frames), video.frames[0].format.name) == ("h264", 3, "yuv444p")


def test_one_unreadable_file_among_many(undistort):
    """The others are done; it is named, and the exit code says so."""
    Path("photos/b.png").write_bytes(Path("photos/b.png").read_bytes()[:500])
    code, out, err = undistort("photos", "-o", "flat")
    assert (code, out) == (2, "flat: 2 undistorted images and their camera.yaml.\n")
    assert tree(Path("flat")) == ["a.png", "c.png", "camera.yaml", LEDGER_NAME]
    assert "camcal: undistort: 1 of 3 files passed over (first: b.png: truncated" in err
    shutil.copy("photos/a.png", "photos/b.png")
    assert undistort("photos", "-o", "flat", "--resume")[:2] == (
        0,
        "flat: 1 undistorted image (2 done before) and its camera.yaml.\n",
    )


def test_the_help_is_in_sections():
    """Every option stands in one of them, once."""
    command = COMMANDS["undistort"]
    text = command.get_help(click.Context(command, info_name="camcal undistort")).partition("Example:")[0]
    sections = re.findall(r"^(\w[\w ]*):$", text, flags=re.MULTILINE)
    assert sections == ["Options", "Geometry", "Pixels and formats", "Videos", "Run"]
    for option in command.params:
        if isinstance(option, click.Option):
            assert len(re.findall(rf"^ +(?:-\w, )?{option.opts[-1]}\b", text, flags=re.MULTILINE)) == 1, option.opts


def test_killed_and_resumed(undistort):
    """SIGKILL half-way through: what is there is whole, there is no camera, and --resume does the rest, each once."""
    for index in range(300):
        shutil.copy("photos/a.png", f"photos/{index:03}.png")
    flags = [sys.executable, "-m", "camcal", "undistort", "photos", "--camera", "camera.yaml", "-o", "flat", "-j", "2"]
    process = subprocess.Popen(flags, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    wait_for(lambda: len(list(Path("flat").glob("*.png"))) >= 20, process)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    begun = {path.name: path.stat().st_ino for path in Path("flat").glob("*.png")}
    assert 20 <= len(begun) < 303
    assert not Path("flat/camera.yaml").exists()
    assert all(cv2.imread(f"flat/{name}") is not None for name in begun)
    noted = len(Path("flat", LEDGER_NAME).read_text().splitlines()) - 1
    # Each thread had at most one result without a line.
    assert len(begun) - noted <= 2
    code, out, err = undistort("photos", "-o", "flat", "--resume")
    assert (code, out) == (0, f"flat: {303 - noted} undistorted images ({noted} done before) and their camera.yaml.\n"), err
    assert len(tree(Path("flat"))) == 303 + 2
    replaced = [name for name, inode in begun.items() if Path("flat", name).stat().st_ino != inode]
    assert len(replaced) == len(begun) - noted


@pytest.mark.usefixtures("undistort")
def test_a_file_that_may_grow_no_further():
    """A limit of the system in the middle of a file: one line, no half-written file, exit code 2."""
    script = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN);"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000));"
        "from camcal.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", script, "undistort", "photos/a.png", "--camera", "camera.yaml", "-o", "flat"]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    assert finished.returncode == 2
    assert "a.png: cannot be written (file too large)" in one_line(finished.stderr)
    assert not Path("flat").exists()


@pytest.mark.usefixtures("undistort")
def test_one_small_image_waits_for_little():
    """What neither reads nor writes an image is not loaded for one: it takes longer than the image."""
    slow = {"pydantic", "yaml", "rich", "av", "PIL", "skimage", "distributed", "concurrent.futures", "threadpoolctl", "json"}
    script = "from camcal.cli import main; assert main(sys.argv[1:]) == 0"
    assert not slow & loaded_by(script, "undistort", "photos/a.png", "--camera", "camera.yaml", "-o", "flat")
