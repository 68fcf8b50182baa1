"""Too few usable views: the one line tells the commonest reason and what to do, once."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from capture_scenes import GRID
from scenes import BOARD
from unfound_boards import TRANSFORMS, views_of

from camcal.calibration.views import too_few_views
from camcal.observations import Rejected


def rejections(*reasons: str) -> list[Rejected]:
    """Rejected views a.png, b.png ... with these reasons."""
    return [Rejected(f"{chr(97 + n)}.png", text) for n, text in enumerate(reasons)]


def test_the_commonest_reason_is_told():
    """The line names the commonest reason, how many images of how many have it, and the first of them."""
    told = too_few_views(1, rejections("no board: look", "the image is mirrored: flip", "the image is mirrored: flip"))
    assert told == (
        "calibrate: too few usable views (got 1, expected at least 3). "
        "2 of 3 rejected images (first: b.png): the image is mirrored: flip."
    )


def test_figures_of_one_image_do_not_divide_a_reason():
    """Reasons count as one if only parentheses differ; a question keeps its mark and gets no full stop."""
    told = too_few_views(0, rejections("no board: look", "too small (4 pixels): near?", "too small (5 pixels): near?"))
    assert told.endswith("2 of 3 rejected images (first: b.png): too small (4 pixels): near?")


@pytest.mark.parametrize(
    ("rejected", "ending"),
    [
        ([], "(got 2, expected at least 3). Take more photographs that show the whole board."),
        (["the same view as c.png"], " a.png: the same view as c.png. Take more photographs that show the whole board."),
        (["the file is damaged: copy it again."], " a.png: the file is damaged: copy it again."),
    ],
)
def test_advice_is_given_once(rejected, ending):
    """A reason that says what to do needs no more advice, one that does not gets some, and no line ends in two stops."""
    assert too_few_views(2, rejections(*rejected)).endswith(ending)


@pytest.mark.parametrize(
    ("printed", "asked", "change", "told"),
    [
        (
            BOARD,
            "checkerboard:10x7:25mm",
            "",
            "were squares counted instead of inner corners? Then it is checkerboard:9x6:25mm.",
        ),
        (BOARD, "aprilgrid:6x5:30mm:0.3", "", "is the board a checkerboard (checkerboard:9x6:SIDE)?"),
        (GRID, "aprilgrid:6x5:30mm:0.3:family=tag36h10", "", "set family=tag36h11."),
        (GRID, "aprilgrid:6x5:30mm:0.3", "mirrored", "the image is mirrored: turn off"),
        (GRID, "aprilgrid:6x5:30mm:0.3", "blurred", "the image is blurred ("),
        (GRID, "checkerboard:9x6:25mm", "", "is the board an AprilGrid (aprilgrid:COLUMNSxROWS:TAG:SPACING)?"),
    ],
)
def test_command_ends_in_the_cause(run, tmp_path, printed, asked, change, told):
    """`camcal calibrate` leaves with 3, and its last line on stderr counts the images and names the cause."""
    for n, (image, _) in enumerate(views_of(printed)[:3]):
        cv2.imwrite(str(tmp_path / f"{n}.png"), TRANSFORMS[change](image) if change else image)
    blank = np.full((480, 640), 90, np.uint8)
    cv2.imwrite(str(tmp_path / "blank.png"), blank)
    code, _, err = run("calibrate", tmp_path, "--board", asked, "-o", tmp_path / "out")
    assert code == 3
    line = err.strip().splitlines()[-1]
    assert "3 of 4 rejected images (first: 0.png): " in line
    assert told in line
