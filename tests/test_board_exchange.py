"""Boards of Kalibr's, both ways."""

from __future__ import annotations

import pytest
import yaml

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.boards.samples import SAMPLES
from camcal.boards.spec import parse_board
from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.workflows.export_board import export_board
from camcal.workflows.exportable import what_is


def test_an_aprilgrid_has_the_keys_that_kalibr_reads():
    """Kalibr's wiki: tagSize in metres, tagSpacing as a ratio of it; loaded by PyYAML, as Kalibr does."""
    content = yaml.safe_load(export_board("aprilgrid:6x5:88mm:0.3"))
    assert content == {"target_type": "aprilgrid", "tagCols": 6, "tagRows": 5, "tagSize": 0.088, "tagSpacing": 0.3}


def test_a_checkerboard_has_the_keys_that_kalibr_reads():
    """Inner corners, as camcal counts them, and the side of a square for rows and columns; a short side is a number too."""
    content = yaml.safe_load(export_board("checkerboard:9x6:0.05mm"))
    assert content == {
        "target_type": "checkerboard",
        "targetCols": 9,
        "targetRows": 6,
        "rowSpacingMeters": 5e-05,
        "colSpacingMeters": 5e-05,
    }


@pytest.mark.parametrize(
    "spec",
    [
        "checkerboard:9x6:25mm",
        "checkerboard:6x9:24.3mm",
        "aprilgrid:6x6:88mm:0.3",
        "aprilgrid:7x4:55mm:0.25",
        "aprilgrid:3x5:1in:4mm",
        *(sample.spec for sample in SAMPLES),
    ],
)
def test_round_trip(tmp_path, spec):
    """Read back: the same board; a gap that is no short ratio of the tag to within a few units in the last place."""
    export_board(spec, tmp_path / "target.yaml")
    back, board = load_board(str(tmp_path / "target.yaml")), parse_board(spec)
    if isinstance(board, AprilGrid):
        assert isinstance(back, AprilGrid)
        assert back.gap_m == pytest.approx(board.gap_m, rel=4e-16)
        assert (back.columns, back.rows, back.tag_m) == (board.columns, board.rows, board.tag_m)
        assert (back.family, back.first, back.border_bits, back.squares) == ("tag36h11", "bottom-left", 2, True)
    else:
        assert back == board


def test_a_board_file_becomes_kalibrs_and_comes_back(run, tmp_path):
    """board.yaml to target.yaml to board.yaml, byte for byte; by the command line."""
    own, target, back = tmp_path / "board.yaml", tmp_path / "target.yaml", tmp_path / "back.yaml"
    export_board("aprilgrid:6x6:88mm:0.3", own, to="camcal")
    assert run("export", own, "--to", "kalibr", "-o", target)[0] == 0
    assert load_board(str(target)) == AprilGrid(6, 6, 0.088, 0.0264)
    assert run("board", target, "-o", back)[0] == 0
    assert back.read_bytes() == own.read_bytes()


@pytest.mark.parametrize(
    ("option", "told"),
    [
        ("family=tag36h10", "got family=tag36h10, expected family=tag36h11"),
        ("first=top-left", "got first=top-left, expected first=bottom-left"),
        ("border=1", "got border=1, expected border=2"),
        ("squares=no", "got squares=no, expected squares=yes"),
        ("border=1:first=top-left", "got first=top-left, border=1, expected first=bottom-left, border=2"),
    ],
)
def test_what_kalibr_has_no_word_for_is_refused(tmp_path, option, told):
    """Its detector would look for other tags, or for tag 0 at the other end; nothing is written."""
    with pytest.raises(InputError, match=told):
        export_board(f"aprilgrid:6x6:88mm:0.3:{option}", tmp_path / "target.yaml")
    assert list(tmp_path.iterdir()) == []


def test_the_board_command_writes_a_board_file(run, tmp_path):
    """`camcal board SPEC -o board.yaml` is the board of the SPEC; it is not replaced unasked."""
    path = tmp_path / "board.yaml"
    arguments = ("board", "checkerboard:9x6:25mm", "-o", path)
    code, out, _ = run(*arguments)
    assert code == 0
    assert load_board(str(path)) == Checkerboard(9, 6, 0.025)
    assert "checkerboard:9x6:25mm" in out
    assert run(*arguments)[0] == 2
    assert run(*arguments, "--force")[0] == 0


def test_unknown_formats_get_the_nearest():
    """A mistyped name is answered."""
    with pytest.raises(InputError, match="Did you mean 'kalibr'"):
        export_board("checkerboard:9x6:25mm", to="kalbir")


def test_boards_and_cameras_are_told_apart(calibrated, tmp_path):
    """By what a file says, not by its name."""
    (tmp_path / "broken.yaml").write_text("a: [")
    assert what_is(str(calibrated / "board.yaml")) == "boards"
    assert what_is("checkerboard:9x6:25mm") == "boards"
    assert what_is("checkerboard_9x6_25mm_a4") == "boards"
    for other in (calibrated / "camera.yaml", calibrated, tmp_path / "broken.yaml", tmp_path / "missing.yaml"):
        assert what_is(str(other)) == "cameras"
