"""Corners in plain files of every kind: read, refused where they make no sense, calibrated from, and sent back."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
from exchange_corners import BOARD, SIZE, agree, views
from messages import one_line

from camcal.boards.spec import parse_board
from camcal.errors import InputError
from camcal.formats.corner_exchange.table import FORMATS, format_of, read_corners, write_corners
from camcal.formats.corners_file import load_corners, save_corners
from camcal.observations import Detection
from camcal.workflows.export_corners import export_corners


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


@pytest.mark.parametrize(
    ("to", "name", "told"),
    [
        ("matlab", "c.mat", "c.mat: not an ending of MATLAB's imagePoints as a matrix (got '.mat', expected .csv)."),
        ("matlab", "c.m", "(got '.m', expected .csv)."),
        ("vnl", "c.mat", "c.mat: not an ending of mrcal's corners.vnl (got '.mat', expected .vnl)."),
        ("vnl", "c.csv", "(got '.csv', expected .vnl)."),
        ("csv", "c.txt", "c.txt: not an ending of camcal's corners.csv (got '.txt', expected .csv)."),
        ("csv", "c", "(got 'none', expected .csv)."),
    ],
)
def test_an_ending_of_another_format_is_refused(run, calibrated, tmp_path, to, name, told):
    """Text of one kind never gets the name of another, which `calibrate` and MATLAB would take it for: exit code 2."""
    code, out, err = run("export", calibrated / "corners.csv", "--to", to, "-o", tmp_path / name)
    assert (code, out) == (2, "")
    assert one_line(err).endswith(told)
    assert list(tmp_path.iterdir()) == []


def test_calibrate_takes_them_and_finds_the_same_camera(run, calibrated, tmp_path):
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
        code, out, _ = run("calibrate", tmp_path / name, "--board", board, *size, "-o", folder, "--json")
        assert code == 0
        fx.append(json.loads(out)["intrinsics"]["fx"])
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
def test_a_size_is_two_whole_numbers(run, tmp_path, size):
    """Exit code 2 and how it is to be written."""
    (tmp_path / "c.vnl").write_text("# filename x y level\n")
    code, _, err = run("calibrate", tmp_path / "c.vnl", "--board", "checkerboard:4x3:2cm", "-o", tmp_path, "--size", size)
    assert code == 2
    assert "is not WIDTHxHEIGHT in pixels, such as 1920x1080" in err
