"""Pictures too small, dark, light, flat, blurred or shaken: the reason says which, with its figures."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest
from board_images import pose_of, shoot
from capture_scenes import GRID
from scenes import BOARD
from unfound_boards import TRANSFORMS, reason, scaled, views_of

from camcal.detection.picture import picture_fault


@pytest.mark.parametrize("factor", [1 / 6, 1 / 8])
def test_small_squares_are_measured(factor):
    """Images shrunk until squares are 4 to 7 pixels wide: the reason gives their width, right to a tenth of it."""
    image, truth = shoot(BOARD, pose_of(BOARD, tilt_deg=0, turn_deg=0, fill=0.48))
    spacing = np.linalg.norm(truth.corners_px[1] - truth.corners_px[0]) * factor
    assert spacing < 7
    told = reason(scaled(image, factor), BOARD)
    width = float(re.search(r"its squares are only ([\d.]+) pixels wide, expected at least 7\)", told)[1])
    assert width == pytest.approx(spacing, rel=0.1)


def test_small_tags_are_measured():
    """Tags 11 pixels wide, with gaps of 3, are read but not used; tags of 7 pixels cannot be read. Both widths are told."""
    image, truth = shoot(GRID, pose_of(GRID, tilt_deg=0, fill=0.6))
    side = np.linalg.norm(truth.corners_px[1] - truth.corners_px[0])
    told = reason(scaled(image, 11.5 / side), GRID)
    # Half of the gap, .15 of the tag, must be 2 pixels: 13.3 pixels, rounded up.
    width = float(re.search(r"its tags are only ([\d.]+) pixels wide, expected at least 14\)", told)[1])
    assert width == pytest.approx(11.5, rel=0.1)
    told = reason(scaled(image, 7.5 / side), GRID)
    width = float(re.search(r"too small to be read as tags \((\d+) pixels wide, expected at least 22\)", told)[1])
    assert width == pytest.approx(7.5, abs=1.5)


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("dark", "the image is almost black (grey levels"),
        ("black", "the image is almost black (grey levels 0 to 0 of 255)"),
        ("overexposed", "the image is almost white (grey levels"),
        ("faint", "the image has next to no contrast (grey levels 1"),
        ("blurred", "the image is blurred ("),
        ("shaken", "the image is blurred"),
    ],
)
def test_spoilt_pictures_are_named(fault, told):
    """Pictures too dark, too light, too flat, out of focus or shaken to show tags: each is told with its figures."""
    for image, _ in views_of(GRID):
        assert reason(TRANSFORMS[fault](image), GRID).startswith(told)


@pytest.mark.parametrize("fault", ["dark", "black", "overexposed"])
def test_spoilt_pictures_of_checkerboards(fault):
    """Checkerboards stand more than tags do, but not everything."""
    told = {
        "dark": "the image is almost black",
        "black": "the image is almost black",
        "overexposed": "the image is almost white",
    }
    assert reason(TRANSFORMS[fault](views_of(BOARD)[0][0]), BOARD).startswith(told[fault])


def test_sharp_pictures_have_no_fault():
    """Rendered views, shrunk, enlarged, moderately blurred (σ 2) or at a tenth of full scale less, have no fault."""
    for board in (BOARD, GRID):
        for image, _ in views_of(board):
            for changed in (
                image,
                scaled(image, 0.5),
                scaled(image, 4),
                cv2.GaussianBlur(image, (0, 0), 2),
                image - image // 10,
            ):
                assert picture_fault(changed) == ""


def crossing_edges():
    """Ideal edges along both axes of the image, 200 levels high and far from each other."""
    image = np.zeros((480, 640), np.uint8)
    image[:, 200:440] = 200
    image[120:360] = 200 - image[120:360]
    return image


@pytest.mark.parametrize("sigma", [4, 6, 8])
def test_width_of_blurred_edges(sigma):
    """An ideal edge blurred by σ is √(2π) σ wide at its steepest; the sharpest 2 % may seem up to a fifth narrower."""
    told = picture_fault(cv2.GaussianBlur(crossing_edges(), (0, 0), sigma))
    width = float(re.search(r"sharpest edges are at least (\d+) pixels wide", told)[1])
    assert 0.8 <= width / (np.sqrt(2 * np.pi) * sigma) <= 1.1


def test_motion_is_told_from_defocus():
    """Smeared over 19 pixels along x: edges across the motion are that wide, those along it stay sharp (4 pixels at most).

    At the end of a ramp of 19 pixels a reach of 12 sees 13 of them at least.
    """
    told = picture_fault(cv2.blur(crossing_edges(), (19, 1)))
    across, others = re.search(
        r"by motion \(edges across the motion are at least (\d+) pixels wide, others (\d+)\)", told
    ).groups()
    assert 13 <= int(across) <= 19
    assert int(others) <= 4
