"""What `camcal undistort` refuses: exit code 2, and one line that says what to do."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from messages import one_line
from undistort_files import make_images, tree
from videos import make_video


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
