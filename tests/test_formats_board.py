"""Boards from files, names and one-liners."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from camcal import resources
from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.errors import InputError
from camcal.formats.board_file import board_yaml, load_board, save_board

BOARDS: list[Board] = [
    Checkerboard(9, 6, 0.025),
    Checkerboard(7, 5, 0.1 + 0.2),
    AprilGrid(6, 6, 0.088, 0.0264),
    AprilGrid(5, 4, 0.02, 0.005, family="tag36h10", first="top-left", border_bits=1, squares=False),
]


@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.spec)
def test_round_trip(tmp_path: Path, board: Board) -> None:
    """A board comes back equal from its file, from the file's folder and from its one-liner."""
    save_board(tmp_path / "board.yaml", board)
    assert load_board(str(tmp_path / "board.yaml")) == board
    assert load_board(str(tmp_path)) == board
    assert load_board(board.spec) == board


def test_layout() -> None:
    """The keys of both kinds."""
    assert yaml.safe_load(board_yaml(BOARDS[0])) == {"type": "checkerboard", "columns": 9, "rows": 6, "square_m": 0.025}
    assert yaml.safe_load(board_yaml(BOARDS[3])) == {
        "type": "aprilgrid",
        "columns": 5,
        "rows": 4,
        "tag_m": 0.02,
        "gap_m": 0.005,
        "family": "tag36h10",
        "first": "top-left",
        "border_bits": 1,
        "squares": False,
    }


def test_what_an_aprilgrid_leaves_out_is_as_on_kalibrs_boards(tmp_path: Path) -> None:
    """Four numbers are enough."""
    path = tmp_path / "mine.yml"
    path.write_text("type: aprilgrid\ncolumns: 6\nrows: 6\ntag_m: 88e-3\ngap_m: 0.0264\n")
    assert load_board(str(path)) == AprilGrid(6, 6, 0.088, 0.0264)


def test_kalibr_aprilgrid(tmp_path: Path) -> None:
    """Kalibr's example target: the spacing is a ratio of the tag's side, 0.3 of 88 mm being 26.4 mm exactly."""
    path = tmp_path / "target.yaml"
    path.write_text(
        "target_type: 'aprilgrid' #gridtype\ntagCols: 6               #number of apriltags\ntagRows: 5\n"
        "tagSize: 0.088           #size of apriltag, edge to edge [m]\ntagSpacing: 0.3\ncodeOffset: 0\n"
    )
    assert load_board(str(path)) == AprilGrid(6, 5, 0.088, 0.0264) == load_board("aprilgrid:6x5:88mm:0.3")


def test_kalibr_checkerboard(tmp_path: Path) -> None:
    """Kalibr counts inner corners as camcal does."""
    path = tmp_path / "target.yaml"
    path.write_text(
        "target_type: 'checkerboard'\ntargetCols: 6\ntargetRows: 7\nrowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n"
    )
    assert load_board(str(path)) == Checkerboard(6, 7, 0.06)


@pytest.mark.parametrize("name", resources.sample_board_names())
def test_sample_boards_are_known_by_name(name: str) -> None:
    """Every shipped board loads by its name, and its name says what it is."""
    board = load_board(name)
    kind, size, side, _ = name.split("_")
    assert board.spec.startswith(f"{kind}:{size}:{side}")


def test_a_file_goes_before_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file named like a sample board is that file; a folder named like one, without a board in it, is not."""
    name = resources.sample_board_names()[0]
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).mkdir()
    assert load_board(name) == load_board(str(resources.sample_board_path(name)))
    (tmp_path / name).rmdir()
    (tmp_path / name).write_text(board_yaml(BOARDS[1]))
    assert load_board(name) == BOARDS[1]


def test_relative_paths_start_at_the_given_folder(tmp_path: Path) -> None:
    """A path in a config is relative to the config; a one-liner is not a path."""
    save_board(tmp_path / "mine.yaml", BOARDS[0])
    assert load_board("mine.yaml", tmp_path) == BOARDS[0]
    assert load_board("checkerboard:7x5:30mm", tmp_path) == Checkerboard(7, 5, 0.03)


@pytest.mark.parametrize("spec", ["missing.yaml", "missing.YML", "boards/mine", "./x"])
def test_a_path_that_is_missing_is_a_missing_file(tmp_path: Path, spec: str) -> None:
    """What looks like a path is never taken for a SPEC."""
    with pytest.raises(InputError, match=r": no such board file\. Check the path\.$"):
        load_board(spec, tmp_path)


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("chessboard", "neither a file, nor a sample board"),
        ("", "neither a file, nor a sample board"),
        ("checkerboard", "wrong fields"),
        ("checkerbord:9x6:25mm", "Did you mean 'checkerboard'?"),
        ("x" * 5000, "neither a file, nor a sample board"),
    ],
)
def test_what_is_no_board_is_refused(tmp_path: Path, spec: str, message: str) -> None:
    """Neither a file, nor a name, nor a SPEC: says so on one line."""
    with pytest.raises(InputError) as caught:
        load_board(spec, tmp_path)
    assert message in str(caught.value)
    assert len(str(caught.value)) < 400


def test_only_known_kinds_have_a_file() -> None:
    """Another kind of board is a mistake of ours."""
    with pytest.raises(TypeError, match="no file format for object"):
        board_yaml(object())  # type: ignore[arg-type]
