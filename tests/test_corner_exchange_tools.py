"""Corners of mrcal and MATLAB: read as those tools mean them, written as they read them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exchange_corners import BOARD, SIZE, agree, views

from camcal.boards.checkerboard import Checkerboard
from camcal.formats.corner_exchange.table import FORMATS, read_corners, write_corners

# What mrcal's own reader makes of a file, by its own Python.
MRCAL_READER = """
import sys, json, mrcal
seen, _, paths = mrcal.compute_chessboard_corners(
    int(sys.argv[2]), int(sys.argv[3]), corners_cache_vnl=sys.argv[1], jobs=-1, weight_column_kind=sys.argv[4])
print(json.dumps({path.split('/')[-1]: one for path, one in zip(paths, seen.tolist())}))
"""


@pytest.fixture(scope="session")
def mrcal_reads(mrcal_python):
    """The reader of mrcal itself of corners, in the Python that has it."""

    def read(path: Path, board: Checkerboard, kind: str = "level") -> dict[str, np.ndarray]:
        arguments = [mrcal_python, "-c", MRCAL_READER, str(path), str(board.columns), str(board.rows), kind]
        done = subprocess.run(arguments, capture_output=True, text=True, check=True)
        return {name: np.array(values) for name, values in json.loads(done.stdout).items()}

    return read


def test_mrcal_reads_what_is_written(tmp_path, mrcal_reads):
    """Bit for bit, row by row of the grid; a missing corner has weight -1, every other weight 1."""
    seen = views(missing=(0, 6))
    write_corners(tmp_path / "corners.vnl", seen, BOARD, FORMATS["vnl"])
    told = mrcal_reads(tmp_path / "corners.vnl", BOARD)
    assert told.keys() == {"a_001.png", "a_002.png"}
    for view in seen:
        grid = told[view.source]
        assert grid.shape == (3, 4, 3)
        flat = grid.reshape(12, 3)
        assert (flat[view.ids, :2] == view.corners_px).all()
        assert (flat[view.ids, 2] == 1).all()
        assert (flat[[0, 6], 2] == -1).all()


def test_what_mrcal_reads_is_read(tmp_path, mrcal_reads):
    """Levels, dashes, coordinates below 0, an image without a board, comments: the same corners and relative weights."""
    lines = ["## made by hand", "# filename x y level", "none.png - -"]
    for index in range(12):
        level = ("0", "1", "2", "-", "-1")[index % 5]
        x = "-" if index == 5 else ("-3.5" if index == 10 else f"{100.25 + 30 * index}")
        lines.append(f"x7.png {x} {60.5 + 20 * index} {level}")
    path = tmp_path / "corners.vnl"
    path.write_text("\n".join(lines) + "\n")
    grid = mrcal_reads(path, BOARD)["x7.png"].reshape(12, 3)
    (view,) = read_corners(path, BOARD, size=SIZE)
    assert view.ids.tolist() == np.flatnonzero(grid[:, 2] > 0).tolist() == [0, 1, 2, 6, 7, 11]
    assert (view.corners_px == grid[view.ids, :2]).all()
    weights = 1 / view.sigma_px
    np.testing.assert_allclose(weights / weights.max(), grid[view.ids, 2] / grid[view.ids, 2].max(), rtol=1e-15)


def test_weights_are_read_as_mrcal_reads_them(tmp_path, mrcal_reads):
    """A column of weights in place of levels: one over a standard deviation, 0 and below are no corner."""
    rows = [f"x7.png {100 + 30 * i} {60 + 20 * i} {(0.5, 1.0, 0.0, 0.25)[i % 4]}" for i in range(12)]
    path = tmp_path / "corners.vnl"
    path.write_text("\n".join(["# filename x y weight", *rows]) + "\n")
    grid = mrcal_reads(path, BOARD, "weight")["x7.png"].reshape(12, 3)
    (view,) = read_corners(path, BOARD, size=SIZE)
    assert view.ids.tolist() == np.flatnonzero(grid[:, 2] > 0).tolist()
    np.testing.assert_allclose(view.sigma_px[0] / view.sigma_px, grid[view.ids, 2] / grid[0, 2], rtol=1e-15)


def test_vnl_by_hand(tmp_path):
    """The very lines: a legend, then the grid row by row; `- - -` for id 1; what is equal everywhere tells no sigma."""
    seen = views(missing=(1,))[:1]
    write_corners(tmp_path / "c.vnl", seen, BOARD, FORMATS["vnl"])
    lines = (tmp_path / "c.vnl").read_text().splitlines()
    assert lines[0] == "# filename x y level"
    assert lines[1] == f"a_001.png {100 + 1 / 3!r} {50 + 1 / 7!r} 0"
    assert lines[2] == "a_001.png - - -"
    assert len(lines) == 13
    (view,) = read_corners(tmp_path / "c.vnl", BOARD, size=SIZE)
    agree([view], seen)
    assert np.isnan(view.sigma_px).all()


def test_levels_double_the_standard_deviation(tmp_path):
    """Corners found in images halved 0, 1 and 2 times: sigma in the ratio 1 : 2 : 4."""
    rows = [f"x.png {100 + 30 * i} {60 + 20 * i} {i % 3}" for i in range(12)]
    (tmp_path / "c.vnl").write_text("\n".join(["# filename x y level", *rows]))
    (view,) = read_corners(tmp_path / "c.vnl", BOARD, size=SIZE)
    assert (view.sigma_px[:3] / view.sigma_px[0]).tolist() == [1, 2, 4]


def test_columns_of_a_vnl_may_stand_in_any_order(tmp_path):
    """The legend tells: vnl-filter reorders columns."""
    rows = [f"{60 + 20 * i} x.png {100 + 30 * i}" for i in range(12)]
    (tmp_path / "c.vnl").write_text("\n".join(["# y filename x", *rows]))
    (view,) = read_corners(tmp_path / "c.vnl", BOARD, size=SIZE)
    assert view.corners_px[1].tolist() == [130, 80]


def test_matlab_by_hand(tmp_path):
    """4x3 corners are boardSize [4 5] in squares. MATLAB's second point is the one below the first, whose id is 4."""
    (seen,) = views()[:1]
    write_corners(tmp_path / "points.csv", [seen], BOARD, FORMATS["matlab"])
    lines = (tmp_path / "points.csv").read_text().splitlines()
    assert lines[0] == "a_001.png x,a_001.png y"
    numbers = np.array([[float(cell) for cell in line.split(",")] for line in lines[1:]])
    assert numbers.shape == (12, 2)
    # From 0 to 1 for the first pixel's centre.
    np.testing.assert_allclose(numbers[0], [101 + 1 / 3, 51 + 1 / 7], rtol=1e-15)
    np.testing.assert_allclose(numbers[1], [101 + 31 * 4 + 1 / 3, 51 + 17 * 4 + 1 / 7], rtol=1e-15)
    np.testing.assert_allclose(numbers[3], [101 + 31 * 1 + 1 / 3, 51 + 17 * 1 + 1 / 7], rtol=1e-15)


def test_matlab_points_go_with_its_world_points(tmp_path):
    """World points run down the columns: each row of the matrix maps to its world point by one similarity."""
    world = np.array([(column * 20.0, row * 20.0) for column in range(4) for row in range(3)])
    image = world * 2.5 + [50.0, 40.0]
    # imagePoints(:, :) of an M x 2 x 2 array, column-major, as writematrix writes it.
    array = np.stack([image + 1, image + 4], axis=2)
    matrix = array.reshape(12, 4, order="F")
    (tmp_path / "points.csv").write_text("\n".join(",".join(f"{value:.15g}" for value in row) for row in matrix))
    found = read_corners(tmp_path / "points.csv", BOARD, size=SIZE)
    assert [view.source for view in found] == ["view_1", "view_2"]
    for shift, view in enumerate(found):
        expected = BOARD.object_points[:, :2] * 1000 * 2.5 + [50.0, 40.0] + 3 * shift
        np.testing.assert_allclose(view.corners_px, expected, rtol=0, atol=1e-9)


def test_matlab_misses_are_nan(tmp_path):
    """NaN, in either column, and empty cells are corners that were not seen."""
    rows = [f"{100 + i},{50 + i}" for i in range(12)]
    rows[1], rows[3], rows[5] = "NaN,NaN", "7,NaN", ","
    (tmp_path / "p.csv").write_text("\n".join(rows))
    (view,) = read_corners(tmp_path / "p.csv", BOARD, size=SIZE)
    # Rows 1, 3 and 5 are (row, column) = (1, 0), (0, 1) and (2, 1): ids 4, 1 and 9.
    assert sorted(set(range(12)) - set(view.ids.tolist())) == [1, 4, 9]
