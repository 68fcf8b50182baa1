"""Corners of other tools: read as those tools mean them, written as they read them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from camcal.boards.checkerboard import Checkerboard
from camcal.boards.spec import parse_board
from camcal.cli import main
from camcal.errors import InputError
from camcal.formats.corner_exchange.table import FORMATS, format_of, read_corners, write_corners
from camcal.formats.corners_file import load_corners, save_corners
from camcal.observations import Detection
from camcal.workflows.export_corners import export_corners

# Columns and rows differ, so that rows taken for columns show.
BOARD = Checkerboard(4, 3, 0.02)
SIZE = (640, 480)
# What mrcal's own reader makes of a file, by its own Python.
MRCAL_READER = """
import sys, json, mrcal
seen, _, paths = mrcal.compute_chessboard_corners(
    int(sys.argv[2]), int(sys.argv[3]), corners_cache_vnl=sys.argv[1], jobs=-1, weight_column_kind=sys.argv[4])
print(json.dumps({path.split('/')[-1]: one for path, one in zip(paths, seen.tolist())}))
"""


def views(*, missing: tuple[int, ...] = ()) -> list[Detection]:
    """Two views whose corner with id i is at (100 + 31 i + 1/3, 50 + 17 i + 1/7), the second shifted; some ids not seen."""
    ids = np.array([one for one in range(12) if one not in missing])
    found = []
    for index, name in enumerate(("a_001.png", "a_002.png")):
        corners = np.stack([100 + 31 * ids + 1 / 3, 50 + 17 * ids + 1 / 7], axis=1) + index
        found.append(Detection(name, SIZE, ids, corners, np.full(ids.size, np.nan)))
    return found


def agree(found, expected, atol: float = 0.0) -> None:
    """The same views: names, sizes, ids, and positions up to a tolerance in pixels."""
    assert [view.source for view in found] == [view.source for view in expected]
    for one, other in zip(found, expected, strict=True):
        assert one.size == other.size
        assert one.ids.tolist() == other.ids.tolist()
        np.testing.assert_allclose(one.corners_px, other.corners_px, rtol=0, atol=atol)


@pytest.fixture(scope="session")
def mrcal_reads():
    """The reader of mrcal itself of corners, in the Python that has it; skipped by name where there is none."""
    python = "/usr/bin/python3"
    try:
        present = subprocess.run([python, "-c", "import mrcal"], capture_output=True, check=False).returncode == 0
    except OSError:
        present = False
    if not present:
        pytest.skip("mrcal is not installed here")

    def read(path: Path, board: Checkerboard, kind: str = "level") -> dict[str, np.ndarray]:
        arguments = [python, "-c", MRCAL_READER, str(path), str(board.columns), str(board.rows), kind]
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


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("filename,corner_id,u,v", "{name},{id},{x},{y}"),
        ("Image Name;Point ID;X;Y;Sigma", "{name};{id};{xc};{yc};0,25"),
        ("file\tid\tx_px\ty_px", "{name}\t{id}\t{x}\t{y}"),
        ("image,row,col,x,y", "{name},{row},{col},{x},{y}"),
        ('"y","x","frame"', "{y},{x},{name}"),
        ("image,width,height,corner,x,y", "{name},640,480,{id},{x},{y}"),
    ],
)
def test_plain_csv_of_many_kinds(tmp_path, header, row):
    """Names of columns, separators, row and column in place of an id, no id at all: the same corners each time."""
    seen = views()
    lines = [header]
    for view in seen:
        for one, (x, y) in zip(view.ids.tolist(), view.corners_px.tolist(), strict=True):
            comma = {"xc": repr(x).replace(".", ","), "yc": repr(y).replace(".", ",")}
            lines.append(row.format(name=view.source, id=one, x=repr(x), y=repr(y), row=one // 4, col=one % 4, **comma))
    (tmp_path / "plain.csv").write_text("\n".join(lines) + "\n")
    size = None if "width" in header else SIZE
    found = read_corners(tmp_path / "plain.csv", BOARD, size=size)
    agree(found, seen)
    if "Sigma" in header:
        assert (found[0].sigma_px == 0.25).all()


def test_an_aprilgrid_in_plain_csv(tmp_path):
    """Ids of an AprilGrid are told as they are; any subset of them."""
    board = parse_board("aprilgrid:4x3:30mm:0.3")
    (tmp_path / "p.csv").write_text("image,id,x,y\na.png,47,10.5,20.25\na.png,3,1,2\n")
    (view,) = read_corners(tmp_path / "p.csv", board, size=SIZE)
    assert view.ids.tolist() == [3, 47]
    assert view.corners_px.tolist() == [[1, 2], [10.5, 20.25]]


@pytest.mark.parametrize("name", list(FORMATS))
def test_round_trip(tmp_path, name):
    """Written and read: the same corners; MATLAB's shift by one pixel costs a few units in the last place."""
    seen = views(missing=(2, 7))
    path = tmp_path / f"corners{FORMATS[name].suffix}"
    write_corners(path, seen, BOARD, FORMATS[name])
    agree(read_corners(path, BOARD, size=SIZE), seen, atol=4 * np.spacing(1000.0) if name == "matlab" else 0.0)


def test_own_corners_are_read_as_ever(tmp_path):
    """A file of camcal's needs no size, and keeps its choice of corners if asked."""
    seen = views()
    used = [np.arange(12) != 5, np.arange(12) >= 0]
    save_corners(tmp_path / "corners.csv", seen, used=used)
    agree(read_corners(tmp_path / "corners.csv", BOARD), seen)
    kept = read_corners(tmp_path / "corners.csv", BOARD, only_used=True)
    assert 5 not in kept[0].ids
    assert len(kept[1]) == 12


def test_sizes_come_from_the_images(tmp_path, monkeypatch):
    """From beside the file, or from the current folder; without either the option is named."""
    seen = views()
    write_corners(tmp_path / "corners.vnl", seen, BOARD, FORMATS["vnl"])
    with pytest.raises(InputError, match=r"a_001.png was not found .* --size WIDTHxHEIGHT"):
        read_corners(tmp_path / "corners.vnl", BOARD)
    for view in seen:
        cv2.imwrite(str(tmp_path / view.source), np.zeros((600, 800), np.uint8))
    assert {view.size for view in read_corners(tmp_path / "corners.vnl", BOARD)} == {(800, 600)}
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "corners.vnl").rename(tmp_path / "elsewhere" / "corners.vnl")
    monkeypatch.chdir(tmp_path)
    assert {view.size for view in read_corners("elsewhere/corners.vnl", BOARD)} == {(800, 600)}


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("c.vnl", "# filename x y level\na.png 1 2 0\n", r"c.vnl:2: a.png: wrong number of corners \(got 1, expected 12"),
        ("c.vnl", "# filename x y level\na.png 1 2 0 7 8\n", r"c.vnl:2: wrong number of values \(got 6, expected 4"),
        ("c.vnl", "# filename x y level\n" + "a.png 1 2 high\n" * 12, r"c.vnl:2: level: not a level \(got 'high'"),
        ("c.vnl", "# filename x y level\n" + "a.png one 2 0\n" * 12, r"c.vnl:2: x: not a number \(got 'one'\)"),
        (
            "c.vnl",
            "# filename x y\n" + "a.png 1 2\n" * 12 + "b.png - -\n" + "a.png 1 2\n" * 12,
            r"c.vnl:15: filename: 'a.png' again",
        ),
        ("c.vnl", "# filename x y level\na.png - - -\nb.png - - -\n", r"c.vnl: no corners \(2 images without any\)"),
        ("c.vnl", "# filename x y level\n" + "a.png 700 2 0\n" * 12, r"c.vnl:2: x: outside the image"),
        ("p.csv", "1,2\n3,4\n", r"p.csv: wrong number of rows \(got 2, expected 12 .* MATLAB's boardSize \[4 5\]\)"),
        ("p.csv", "1,2,3\n" * 12, r"p.csv: an odd number of columns \(got 3"),
        ("p.csv", "1,2\n" * 11 + "1,a\n", r"p.csv:12: not a number \(got 'a'"),
        ("p.csv", "NaN,NaN\n" * 12, r"p.csv: no corners \(all are NaN\)"),
        ("p.csv", "file,u,v\na.png,1,2\n", r"p.csv: a.png: no column id, and not all corners \(got 1, expected 12"),
        ("p.csv", "file,row,col,u,v\na.png,3,0,1,2\n", r"p.csv:2: row: not on the board \(got '3', expected 0 to 2"),
        ("p.csv", "file,id,u,v\na.png,0,1,2\na.png,0,1,2\n", r"p.csv:3: id: corner 0 of this image again"),
        ("p.csv", "file,id,u,v\n", r"p.csv: no corners \(only a header\)"),
        ("p.csv", "photo,corner,a,b\na.png,0,1,2\n", r"p.csv:1: image: missing column"),
    ],
)
def test_what_makes_no_sense_is_refused(tmp_path, name, content, told):
    """One line with the file, the line and the column where there is one."""
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=told):
        read_corners(tmp_path / name, BOARD, size=SIZE)


def test_what_a_format_cannot_hold_is_refused(tmp_path):
    """AprilGrids are no grid of equal steps; mrcal cuts a name at a blank and reads ASCII only."""
    with pytest.raises(InputError, match=r"expected a checkerboard\). Use CSV."):
        write_corners(tmp_path / "c.vnl", [], parse_board("aprilgrid:4x3:30mm:0.3"), FORMATS["vnl"])
    for name in ("my photo.png", "#1.png", "größe.png"):
        seen = Detection(name, SIZE, np.arange(3), np.ones((3, 2)), np.full(3, np.nan))
        with pytest.raises(InputError, match="not a name for a vnl file"):
            write_corners(tmp_path / "c.vnl", [seen], BOARD, FORMATS["vnl"])
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="Did you mean 'matlab'"):
        format_of("c.csv", "mathlab")


def test_calibrate_takes_them_and_finds_the_same_camera(calibrated, tmp_path, capsys):
    """A camcal corners.csv without its sigmas, and the same corners by way of mrcal's and MATLAB's format: one camera."""
    board = str(calibrated / "board.yaml")
    detections = load_corners(calibrated / "corners.csv")
    bare = [Detection(d.source, d.size, d.ids, d.corners_px, np.full(len(d), np.nan)) for d in detections]
    save_corners(tmp_path / "own.csv", bare)
    fx = []
    for to, name in ((None, "own.csv"), ("vnl", "c.vnl"), ("matlab", "m.csv")):
        if to:
            export_corners(tmp_path / "own.csv", tmp_path / name, to=to, board=board)
        size = ("--size", "640x480") if to else ()
        folder = tmp_path / f"calib_{name}"
        arguments = ["calibrate", tmp_path / name, "--board", board, *size, "-o", folder, "--no-report", "--json"]
        assert main([str(argument) for argument in arguments]) == 0
        fx.append(json.loads(capsys.readouterr().out)["intrinsics"]["fx"])
    assert fx[0] == fx[1]
    assert fx[0] == pytest.approx(fx[2], rel=1e-9)


def test_export_back_to_camcals_own(calibrated, tmp_path):
    """From vnl to corners.csv: the same corners, the board taken from beside the file it was written next to."""
    export_corners(calibrated / "corners.csv", tmp_path / "c.vnl")
    back = export_corners(tmp_path / "c.vnl", tmp_path / "c.csv", board=str(calibrated / "board.yaml"), size=SIZE)
    seen = load_corners(calibrated / "corners.csv")
    agree(load_corners(tmp_path / "c.csv"), seen)
    assert (back.views, back.corners) == (len(seen), sum(len(view) for view in seen))
    with pytest.raises(InputError, match="the board is not told"):
        export_corners(tmp_path / "c.vnl", tmp_path / "d.csv", size=SIZE)
    with pytest.raises(InputError, match="output file exists"):
        export_corners(tmp_path / "c.vnl", tmp_path / "c.csv", board=str(calibrated / "board.yaml"), size=SIZE)


@pytest.mark.parametrize("size", ["640", "640x", "0x480", "640,480", "axb"])
def test_a_size_is_two_whole_numbers(tmp_path, capsys, size):
    """Exit code 2 and how it is to be written."""
    (tmp_path / "c.vnl").write_text("# filename x y level\n")
    code = main(["calibrate", str(tmp_path / "c.vnl"), "--board", "checkerboard:4x3:2cm", "-o", str(tmp_path), "--size", size])
    assert code == 2
    assert "is not WIDTHxHEIGHT in pixels, such as 1920x1080" in capsys.readouterr().err
