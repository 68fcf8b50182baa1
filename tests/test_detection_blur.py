"""Blur: the width of edges is measured right, and blurred views are told from the others."""

from __future__ import annotations

import numpy as np
import pytest
from board_images import pose_of, shoot

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.detection.blur import blur_notes, flag_blurred
from camcal.detection.detect import detect_board
from camcal.observations import Detection, Rejected

CHECKERBOARD = Checkerboard(9, 6, 0.025)
APRILGRID = AprilGrid(4, 3, tag_m=0.03, gap_m=0.012)


def view(name: str, width_px: float, notes: tuple[str, ...] = ()) -> Detection:
    """A detection of one corner with a given edge width."""
    return Detection(name, (640, 480), [0], [[1, 2]], [np.nan], notes, width_px)


@pytest.mark.parametrize("board", [CHECKERBOARD, APRILGRID], ids=["checkerboard", "aprilgrid"])
@pytest.mark.parametrize("sigma_px", [1.0, 1.5, 2.0])
def test_edge_width_of_a_gaussian_blur(board, sigma_px):
    """A Gaussian edge has contrast over slope √(2π) σ; pixel, step and bilinear look-up add 1/12 + 1/12 + 1/6 to σ²."""
    image, _ = shoot(board, pose_of(board, tilt_deg=5, turn_deg=20), blur_px=sigma_px, noise=0)
    found = detect_board(image, board, "view.png")
    assert isinstance(found, Detection)
    expected = np.sqrt(2 * np.pi * (sigma_px**2 + 1 / 3))
    assert found.edge_width_px == pytest.approx(expected, rel=0.1)


def test_strong_blur_is_noted_on_the_view_itself():
    """A view with edges more than 4 pixels wide is used, and says that it is blurred."""
    image, _ = shoot(CHECKERBOARD, pose_of(CHECKERBOARD), blur_px=3.0)
    found = detect_board(image, CHECKERBOARD, "view.png")
    assert isinstance(found, Detection)
    assert found.notes[0].startswith("blurred: ")
    assert blur_notes(1.5) == () == blur_notes(float("nan"))


def test_views_are_compared_with_each_other():
    """One view of seven has wider edges: it alone is flagged; rejected views pass through in their places."""
    views = [view(f"{n}.png", 1.5 + 0.02 * n) for n in range(6)]
    mixed = [*views[:3], Rejected("x.png", "no board"), view("soft.png", 2.3), *views[3:]]
    flagged = flag_blurred(mixed)
    assert [one.source for one in flagged] == [one.source for one in mixed]
    notes = {one.source: one.notes for one in flagged if isinstance(one, Detection)}
    assert notes.pop("soft.png") == ("blurred: its edges are 2.3 pixels wide, 1.6 in most other views",)
    assert set(notes.values()) == {()}


def test_a_soft_camera_is_not_flagged_throughout():
    """Where all views have the same wide edges, none is blurred compared with the others."""
    views = [view(f"{n}.png", width) for n, width in enumerate([2.3, 2.5, 2.2, 2.6, 2.4, 2.1])]
    assert flag_blurred(views) == tuple(views)


def test_no_second_note_about_blur():
    """A view that says so already says it once."""
    views = [view(f"{n}.png", 1.5) for n in range(6)] + [view("soft.png", 5.0, ("blurred: its edges are 5.0 pixels wide",))]
    assert flag_blurred(views)[-1] is views[-1]


def test_too_few_views_to_compare():
    """With fewer than five views nothing can be called usual."""
    views = [view("a.png", 1.5), view("b.png", 1.5), view("c.png", 3.0)]
    assert flag_blurred(views) == tuple(views)
