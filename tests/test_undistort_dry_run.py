"""What `camcal undistort --dry-run` promises, and what it foresees."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import tifffile
from undistort_files import make_images


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
