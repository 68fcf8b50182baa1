"""Real photographs: the causes for which a board is not found, and no fault where there is none."""

from __future__ import annotations

import cv2
import pytest
from capture_scenes import GRID
from unfound_boards import TRANSFORMS, reason

from camcal.boards.spec import parse_board
from camcal.detection.picture import picture_fault
from camcal.detection.reading import Print, read_tags


def gray(path):
    """A photograph as it was stored, in gray."""
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)


MOMS = "aprilgrid:5x4:20mm:0.25:family=tag36h10:first=top-left"


@pytest.mark.parametrize(
    ("change", "spec", "told"),
    [
        ("mirrored", MOMS, "the image is mirrored"),
        ("upside down mirrored", MOMS, "the image is mirrored"),
        ("inverted", MOMS, "the tags are white on black"),
        (
            "",
            MOMS.replace("36h10", "36h11"),
            "tags of tag36h10 were seen, tag36h11 was asked for: set family=tag36h10 and border=1",
        ),
        (
            "",
            MOMS.replace("36h10", "16h5") + ":border=1",
            "tags of tag36h10 were seen, tag16h5 was asked for: set family=tag36h10",
        ),
        ("", "checkerboard:6x5:25mm", "tags of tag36h10 were seen and no checkerboard"),
    ],
)
def test_photographs_of_tags(photos, change, spec, told):
    """All twelve photographs of an AprilGrid name the cause, even the one that shows few readable tags."""
    files = sorted((photos / "moms_left").glob("*.png"))
    assert len(files) == 12
    # A checkerboard is searched for thoroughly, which takes a second an image.
    for file in files[::4] if spec.startswith("checkerboard") else files:
        image = gray(file)
        assert reason(TRANSFORMS[change](image) if change else image, parse_board(spec)).startswith(told), file.name


def test_photographs_of_checkerboards_for_an_aprilgrid(photos):
    """All thirteen photographs of a checkerboard say so when tags are looked for, with its size."""
    for file in sorted((photos / "opencv_left").glob("left*.jpg")):
        assert reason(gray(file), GRID).endswith("(checkerboard:9x6:SIDE)?"), file.name


@pytest.mark.parametrize(
    ("folder", "pattern", "tags"),
    [
        ("opencv_left", "left*.jpg", None),
        ("swat_calib", "*.JPG", None),
        ("udacity_wide", "GOPR*.jpg", None),
        ("kalibr", "*.jpg", None),
        ("caliscope_charuco_cam0", "*.jpg", None),
        ("fisheye_plane", "*.png", None),
        ("moms_left", "*.png", Print("tag36h10", 1)),
    ],
)
def test_photographs_have_no_fault_and_only_their_own_tags(photos, folder, pattern, tags):
    """No fault is found in photographs as they were taken, no tags where there are none, and the right ones where there are."""
    files = sorted((photos / folder).glob(pattern))
    assert files
    for file in files[::2]:
        image = gray(file)
        assert picture_fault(image) == "", file.name
        assert read_tags(image).printed == tags, file.name
