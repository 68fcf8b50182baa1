"""`camcal undistort` as a command: its options and exit codes, lists on standard input, crashes, and how soon it begins."""

from __future__ import annotations

import io
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import click
import cv2
import numpy as np
import pytest
import tifffile
from every_command import COMMANDS
from loaded_modules import loaded_by
from messages import one_line
from undistort_files import CAMERA, make_images, tree
from videos import make_video, read_video

from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.ledger_file import LEDGER_NAME
from camcal.records import Intrinsics


@pytest.fixture
def undistort(run, tmp_path, monkeypatch):
    """Run the command in a folder with a camera.yaml and three photos: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    save_intrinsics("camera.yaml", Intrinsics(CAMERA))
    make_images(tmp_path / "photos", "a.png", "b.png", "c.png")

    def call(*arguments: object, camera: str = "camera.yaml") -> tuple[int, str, str]:
        return run("undistort", *arguments, "--camera", camera)

    return call


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


def test_a_list_on_standard_input(undistort, monkeypatch):
    """Lines or NUL-separated, beside other inputs; an entry that cannot be used is reported in the end with exit code 2."""
    for content in (b"photos/a.png\r\nphotos/b.png\n\n", b"photos/a.png\0photos/b.png\0"):
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(content)))
        assert undistort("-", "photos/c.png", "-o", "flat", "--force")[:2] == (
            0,
            "flat: 3 undistorted images and their camera.yaml.\n",
        )
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(b"photos/a.png\ngone.png\n")))
    code, out, err = undistort("-", "-o", "some")
    assert (code, out) == (2, "some: 1 undistorted image and its camera.yaml.\n")
    assert err.splitlines() == [
        "camcal: warning: gone.png: passed over: no such file. Check the path.",
        "camcal: undistort: 1 of 2 files passed over (first: gone.png: no such file. Check the path.)",
    ]
    for stdin in (None, SimpleNamespace(buffer=io.BytesIO(b""))):
        monkeypatch.setattr(sys, "stdin", stdin)
        code, _, err = undistort("-", "-o", "none")
        assert (code, one_line(err)) == (
            2,
            "camcal: undistort: no images or videos given. Name some, or a folder that holds some.",
        )


@pytest.mark.parametrize("missing", ["photos/lost", "photos/lost.txt", "photos/b.png", "gone/", "photos/link.png"])
def test_a_list_with_something_that_is_not_there(undistort, monkeypatch, missing):
    """Whatever its name ends in, and a link that leads nowhere: named, with exit code 2; so it is in a dry run."""
    Path("photos/link.png").symlink_to("nowhere.png")
    Path("photos/b.png").unlink()
    for options in ((), ("--dry-run", "--force")):
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(f"photos/a.png\n{missing}\n".encode())))
        code, _, err = undistort("-", "-o", "some", *options)
        assert code == 2
        assert err.splitlines() == [
            f"camcal: warning: {missing.rstrip('/')}: passed over: no such file. Check the path.",
            f"camcal: undistort: 1 of 2 files passed over (first: {missing.rstrip('/')}: no such file. Check the path.)",
        ]


def test_a_list_from_an_editor(undistort, monkeypatch):
    """A byte order mark, blanks behind a name and lines of blanks mean nothing; a name that ends in a blank does."""
    shutil.copy("photos/b.png", "photos/b.png ")
    lines = b"\xef\xbb\xbfphotos/a.png \t\r\n  \nphotos/c.png  \nphotos/b.png \n"
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(lines)))
    code, out, err = undistort("-", "-o", "flat")
    assert (code, out) == (0, "flat: 2 undistorted images and their camera.yaml.\n")
    assert err == "camcal: warning: 1 other file passed over (first: b.png ).\n"
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(b"photos/a.png \0")))
    assert undistort("-", "-o", "none")[0] == 2


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


def test_a_dry_run_prints_the_plan(undistort):
    """Input, output, size and format of each file that would be done, and how many are done; nothing is written."""
    code, out, err = undistort("photos", "-o", "flat", "--dry-run", "--size", "32x24", "--format", "jpg")
    assert (code, err) == (0, "")
    assert out.splitlines() == [f"photos/{name}.png -> flat/{name}.jpg  32x24 jpg" for name in "abc"]
    assert not Path("flat").exists()
    assert undistort("photos/a.png", "photos/b.png", "-o", "flat")[0] == 0
    _, out, _ = undistort("photos", "-o", "flat", "--dry-run", "--resume")
    assert out.splitlines() == ["photos/c.png -> flat/c.png  64x48 png", "2 more are done already."]


def test_a_dry_run_rejects_what_the_run_rejects(undistort):
    """By what files tell before they are decoded, in the same words and with the same exit code; the others are listed."""
    deep, photos = np.zeros((48, 64), np.uint16), Path("photos")
    tifffile.imwrite("photos/cmyk.tif", np.zeros((48, 64, 4), np.uint8), photometric="separated")
    tifffile.imwrite("photos/lab.tif", np.zeros((48, 64, 3), np.uint8), photometric="cielab")
    tifffile.imwrite("photos/pages.tif", np.zeros((2, 48, 64), np.uint8), photometric="minisblack")
    tifffile.imwrite("photos/half.tif", np.zeros((48, 64), np.float16))
    tifffile.imwrite("photos/float.tif", np.zeros((48, 64), np.float32))
    cv2.imwrite("photos/alpha.png", np.zeros((48, 64, 4), np.uint8))
    cv2.imwrite("photos/deep.png", deep)
    cv2.imwrite("photos/depth.pgm", deep)
    cv2.imwrite("photos/turned.png", deep.T)
    (photos / "empty.png").touch()
    (photos / "text.png").write_text("text")
    (photos / "torn.png").write_bytes((photos / "a.png").read_bytes()[:1000])
    (photos / "lost.png").symlink_to("nowhere.png")
    plans = [undistort("photos", "-o", "flat", "--format", "jpg", *option) for option in (("--dry-run",), ())]
    assert plans[0][::2] == plans[1][::2]
    assert plans[0][2].splitlines()[-1].startswith("camcal: undistort: 13 of 16 files passed over (first: alpha.png: pixels")
    assert plans[0][1].splitlines() == [f"photos/{name}.png -> flat/{name}.jpg  64x48 jpg" for name in "abc"]
    plan, real = [undistort("photos/half.tif", "-o", "one.tif", *option) for option in (("--dry-run",), ())]
    assert plan == real
    assert plan[0] == 2
    assert not Path("one.tif").exists()


def test_a_plan_with_odd_names_is_lines_of_text(undistort):
    """What would move the cursor of a terminal is written as an escape; so it is in what is said in the end.

    A byte that is no text is written as that byte, wherever it is said.
    """
    odd = Path("photos/lat\udcff1.png")
    Path("photos/a.png").rename(odd)
    _, out, err = undistort(odd, "-o", "odd", "--dry-run")
    assert (out, err) == ("photos/lat\\xff1.png -> odd/lat\\xff1.png  64x48 png\n", "")
    odd.write_bytes(b"")
    assert undistort("photos", "-o", "odd")[2].startswith("camcal: warning: lat\\xff1.png: passed over: empty file")
    odd.unlink()
    make_images(Path(), "photos/a.png")
    make_images(Path(), "photos/x\n\x1b[2Jy.png")
    _, out, _ = undistort("photos", "-o", "flat", "--dry-run")
    assert out.splitlines()[-1] == r"photos/x\n\x1b[2Jy.png -> flat/x\n\x1b[2Jy.png  64x48 png"
    assert undistort("photos/a.png", "-o", "flat\x1b[2J.png")[1].startswith(r"flat\x1b[2J.png: undistorted")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("photos", "-o", "o", "--size", "32"), "'32' is not WIDTHxHEIGHT in pixels, such as 1920x1080. See"),
        (("photos", "-o", "o", "--size", "0x4"), "'0x4' is not WIDTHxHEIGHT in pixels"),
        (("photos", "-o", "o", "--fill", "red"), "'red' is neither a number nor R,G,B. See"),
        (
            ("photos", "-o", "o", "--fill", "1,2"),
            "--fill: not a colour (got 2 numbers, expected 1, or 3 as R,G,B, or 4 with alpha)",
        ),
        (("photos/a.png", "-o", "o", "--fill", "999"), "--fill: no value of such pixels (got 999"),
        (("photos/a.png", "-o", "o/b.png", "--fill", "999"), "--fill: no value of such pixels (got 999"),
        (
            ("photos/a.png", "-o", "o", "--most-pixels", "9"),
            "got 64x48, expected at most 9). If the image is what it should be",
        ),
        (("photos", "-o", "o", "--crop", "all"), "'--crop': 'all' is not one of"),
        (("photos", "-o", "o", "--fov", "60", "--alpha", "1"), "--fov and --alpha: both"),
        (("photos", "-o", "o", "--frames", "0:2"), "--frames: only for videos"),
        (("photos", "-o", "o.png"), "o.png: a file for 3 inputs"),
        (("photos/a.png", "-o", "o.jpgg"), "o.jpgg: not a format to write (got '.jpgg'). Did you mean 'jpg'? A folder of"),
        (("photos/a.png", "-o", "o.pgn"), "Did you mean 'png'?"),
        (("photos/clip.mkv", "-o", "o.mp5"), "o.mp5: not a format to write (got '.mp5'). Did you mean 'mp4'?"),
        (("p.csv", "-o", "o.cvs"), "o.cvs: not a format to write (got '.cvs'). Did you mean 'csv'?"),
        (("p.csv", "-o", "o.png"), "o.png: no file of points (got '.png', expected .csv). Name a file such as o.csv, or"),
        (("p.csv", "-o", "o.heic"), "o.heic: no file of points"),
        (("photos/clip.mkv", "-o", "o", "--fill", "1"), "--fill: only for images (got photos/clip.mkv). Leave it away."),
        (("photos", "-o", "photos", "--force"), "output would replace its own input"),
        (("photos", "-o", "camera.yaml"), "camera.yaml: a file stands where the output folder should be"),
        (("gone", "-o", "o"), "gone: no such file"),
        (("gone*.png", "-o", "o"), "gone*.png: no image or video matches this pattern"),
        (("photos", "-o", "o", "--target", "gone.yaml"), "gone.yaml: no such file"),
    ],
)
def test_failures_are_one_line(undistort, arguments, told):
    """Exit code 2 and one line that names the cause; nothing is written."""
    if "photos/clip.mkv" in arguments:
        make_video(Path("photos/clip.mkv"), codec="ffv1", frames=1)
    Path("p.csv").write_text("x,y\n1,2\n")
    before = tree(Path())
    code, out, err = undistort(*arguments)
    assert (code, out) == (2, "")
    assert told in one_line(err).splitlines()[-1]
    assert tree(Path()) == before


def test_folders_with_a_dot_in_their_names(undistort):
    """A name that is near no format, or ends with a slash, or is a folder already, or takes several files, is a folder's."""
    Path("old.jpgg").mkdir()
    for output in ("flat.tmp", "v1.2", "new.jpgg/", "old.jpgg"):
        assert undistort("photos/a.png", "-o", output)[0] == 0
        assert Path(output, "a.png").is_file()
    assert undistort("photos/a.png", "photos/b.png", "-o", "both.pngg")[0] == 0


def test_a_size_of_its_own_among_others(undistort):
    """What --rescale cannot take with the rest is told to go by itself, also where it is the camera's own size."""
    make_images(Path(), "photos/0.png", size=(32, 24))
    code, _, err = undistort("photos", "-o", "flat", "--rescale")
    assert code == 2
    advice = "Undistort images of each size by themselves: with a camera calibrated at that size, or with --rescale."
    assert f"a.png, b.png, c.png: passed over: not the camera's image size (got 64x48, expected 32x24). {advice}" in err


def test_a_camera_file_of_none(undistort):
    """An image, or YAML of something else, is no camera."""
    Path("other.yaml").write_text("type: checkerboard\n")
    for camera in ("other.yaml", "photos/a.png", "photos", "gone.yaml"):
        code, _, err = undistort("photos", "-o", "flat", camera=camera)
        assert code == 2
        assert one_line(err).startswith(f"camcal: {camera}")


def test_the_cluster_is_an_extra(undistort, monkeypatch):
    """Without it installed: one line that names the extra; an address where nobody answers is one line too."""
    code, _, err = undistort("photos", "-o", "o", "--scheduler", "tcp://127.0.0.1:1")
    assert code == 2
    assert re.fullmatch(
        r"camcal: --scheduler: tcp://127\.0\.0\.1:1 does not answer \(.*\)\. Check the address\.", one_line(err)
    )
    monkeypatch.setitem(sys.modules, "distributed", None)
    code, _, err = undistort("photos", "-o", "o", "--scheduler", "tcp://127.0.0.1:1")
    assert code == 2
    assert "pip install 'camcal[distributed]'" in one_line(err)
    # What came to nothing is not in the way.
    assert undistort("photos", "-o", "o")[0] == 0


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
    deadline = time.monotonic() + 60
    while len(list(Path("flat").glob("*.png"))) < 20 and time.monotonic() < deadline:
        assert process.poll() is None, process.communicate()
        time.sleep(0.002)
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
