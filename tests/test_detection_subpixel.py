"""Sub-pixel refinement: right where there is a corner, NaN where there is none or no room."""

from __future__ import annotations

import numpy as np
import pytest
from board_images import CAMERA, pose_of, shoot

from camcal.boards.checkerboard import Checkerboard
from camcal.detection.grid import contrasts, is_grid, is_regular, oriented, right_handed, spacing_px
from camcal.detection.neighbours import without_strays
from camcal.detection.subpixel import refine

BOARD = Checkerboard(9, 6, 0.025)


@pytest.fixture(scope="module")
def scene():
    """A rendered board and its true corners."""
    return shoot(BOARD, pose_of(BOARD, turn_deg=12))


def test_starts_within_reach_arrive(scene):
    """Starts 1.5 px off arrive within the .02 px per axis that cornerSubPix is good for, whatever the reach."""
    image, truth = scene
    offsets = np.random.default_rng(3).uniform(-1.5, 1.5, truth.corners_px.shape)
    reach = np.linspace(5, 11, len(truth))
    refined = refine(image, truth.corners_px + offsets, reach)
    assert np.sqrt(((refined - truth.corners_px) ** 2).mean()) < 0.03


def test_corners_are_refined_one_by_one(scene):
    """The result of a corner does not depend on which others are refined along with it."""
    image, truth = scene
    reach = np.full(len(truth), 8.0)
    together = refine(image, truth.corners_px, reach)
    alone = refine(image, truth.corners_px[7:8], reach[7:8])
    # cornerSubPix works in float32, on a part of the image that begins elsewhere.
    assert alone[0] == pytest.approx(together[7], abs=2e-3)


def test_no_room_at_the_border(scene):
    """A corner whose window leaves the image, or whose reach is below 2 px, is NaN; no corner at all is fine."""
    image, truth = scene
    starts = np.array([[2.0, 200.0], [636.0, 100.0], truth.corners_px[0], [300.0, 477.0]])
    refined = refine(image, starts, np.array([8.0, 8.0, 0.9, 8.0]))
    assert np.isnan(refined).all()
    assert refine(image, np.zeros((0, 2)), np.zeros(0)).shape == (0, 2)


def test_nan_starts_stay_nan(scene):
    """Unknown corners stay unknown and disturb nothing."""
    image, truth = scene
    starts = np.array([[np.nan, np.nan], truth.corners_px[3]])
    refined = refine(image, starts, np.array([8.0, 8.0]))
    assert np.isnan(refined[0]).all()
    assert refined[1] == pytest.approx(truth.corners_px[3], abs=0.1)


def test_spacing_is_to_the_nearest_neighbour():
    """Literals: columns at x = 0, 10, 30, rows at y = 0, 7."""
    grid = np.stack(np.meshgrid([0.0, 10.0, 30.0], [0.0, 7.0]), axis=2)
    assert spacing_px(grid).tolist() == [[7, 7, 7], [7, 7, 7]]
    assert spacing_px(grid * [1.0, 3.0]).tolist() == [[10, 10, 20], [10, 10, 20]]


def test_true_grid_passes_and_wrong_ones_do_not(scene):
    """The true corners are a grid; shifted by half a square, with a row skipped, or with two corners swapped they are none."""
    image, truth = scene
    grid = np.array(truth.corners_px.reshape(6, 9, 2))
    assert is_grid(grid, contrasts(image, grid))
    for wrong in ((grid[:-1, :-1] + grid[1:, 1:]) / 2, grid[[0, 1, 3, 4, 5]]):
        assert not is_grid(wrong, contrasts(image, wrong))
    swapped = grid.copy()
    swapped[2, [3, 4]] = swapped[2, [4, 3]]
    assert not is_regular(swapped)


def test_strays_are_found_and_good_corners_kept(scene):
    """Two corners moved by a fifth of the spacing are marked, one of them at the rim; all others stay as they are."""
    _, truth = scene
    moved = np.array(truth.corners_px)
    spacing = spacing_px(moved.reshape(6, 9, 2)).ravel()
    moved[[0, 31]] += 0.2 * spacing[[0, 31], None] * [0.6, 0.8]
    checked = without_strays(BOARD.object_points[:, :2] / BOARD.square_m, moved, 0.12 * spacing)
    assert np.flatnonzero(np.isnan(checked[:, 0])).tolist() == [0, 31]
    assert np.array_equal(np.delete(checked, [0, 31], axis=0), np.delete(truth.corners_px, [0, 31], axis=0))


def test_every_reading_is_brought_to_the_printed_one(scene):
    """All eight ways to read the grid, mirrored and transposed ones included, lead to the printed order."""
    image, truth = scene
    grid = np.array(truth.corners_px.reshape(6, 9, 2))
    for start in (grid, grid[::-1], grid[:, ::-1], grid[::-1, ::-1]):
        for reading in (start, np.swapaxes(start, 0, 1)):
            unmirrored = right_handed(reading)
            printed, values = oriented(unmirrored, contrasts(image, unmirrored), 9, 6)
            assert np.array_equal(printed, grid)
            assert np.array_equal(values > 0, np.ones((6, 9), bool))
    assert np.array_equal(right_handed(grid), grid)


def test_the_scene_is_inside_the_image(scene):
    """Premise of the tests above: all corners lie inside, 15 px and more from the border."""
    assert CAMERA.contains(scene[1].corners_px, 15).all()
