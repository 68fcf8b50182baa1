"""The one-line SPEC: exact both ways, and clear about what is wrong with it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from loaded_modules import loaded_by

from camcal.boards.aprilgrid import BORDER_BITS, FAMILIES, FIRST_TAGS, AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.boards.fields import format_length, parse_length
from camcal.boards.spec import KINDS, parse_board
from camcal.errors import InputError

lengths_m = st.floats(1e-5, 10.0)


@pytest.mark.parametrize(
    ("spec", "board"),
    [
        ("checkerboard:9x6:25mm", Checkerboard(9, 6, 0.025)),
        ("checkerboard:9x6:24.3mm", Checkerboard(9, 6, 0.0243)),
        ("checkerboard:7x5:9mm", Checkerboard(7, 5, 0.009)),
        ("checkerboard:7x5:3cm", Checkerboard(7, 5, 0.03)),
        ("checkerboard:8x6:1m", Checkerboard(8, 6, 1.0)),
        ("checkerboard:8x6:1in", Checkerboard(8, 6, 0.0254)),
        (" checkerboard : 8x6 : 1 in ", Checkerboard(8, 6, 0.0254)),
        ("aprilgrid:6x6:88mm:0.3", AprilGrid(6, 6, 0.088, 0.0264)),
        ("aprilgrid:6x6:88mm:26.4mm", AprilGrid(6, 6, 0.088, 0.0264)),
        ("aprilgrid:6x5:3cm:1cm:border=1:squares=no", AprilGrid(6, 5, 0.03, 0.01, border_bits=1, squares=False)),
        (
            "aprilgrid:5x4:20mm:0.25:family=tag36h10:first=top-left",
            AprilGrid(5, 4, 0.02, 0.005, family="tag36h10", first="top-left"),
        ),
        ("aprilgrid:5x4:first=top-left:20mm:0.25", AprilGrid(5, 4, 0.02, 0.005, first="top-left")),
    ],
)
def test_one_liners_name_boards(spec, board):
    """The lengths are the very floats of the decimal literals in metres."""
    assert parse_board(spec) == board


@pytest.mark.parametrize(
    ("board", "spec"),
    [
        (Checkerboard(9, 6, 0.025), "checkerboard:9x6:25mm"),
        (Checkerboard(8, 6, 1.0), "checkerboard:8x6:1m"),
        (AprilGrid(6, 6, 0.088, 0.0264), "aprilgrid:6x6:88mm:0.3"),
        (AprilGrid(6, 6, 0.03, 0.01), "aprilgrid:6x6:30mm:10mm"),
        (
            AprilGrid(5, 4, 0.02, 0.005, "tag36h10", "top-left", 1, False),
            "aprilgrid:5x4:20mm:0.25:family=tag36h10:first=top-left:border=1:squares=no",
        ),
    ],
)
def test_boards_write_their_canonical_one_liner(board, spec):
    """Defaults are left out, lengths are in mm below a metre, the spacing is a ratio where that is exact."""
    assert board.spec == spec


@given(st.integers(3, 100), st.integers(3, 100), lengths_m)
def test_checkerboard_specs_round_trip(columns, rows, square_m):
    """Any checkerboard's SPEC parses back to an equal board, bit for bit."""
    board = Checkerboard(columns, rows, square_m)
    assert parse_board(board.spec) == board


@st.composite
def aprilgrids(draw):
    """AprilGrids of every family and option, small enough for the smallest family."""
    tag_m = draw(st.floats(1e-4, 4.0))
    ratio = draw(st.one_of(st.floats(0.1, 2.0), st.sampled_from([0.1, 0.25, 0.3, 1 / 3])))
    return AprilGrid(
        columns=draw(st.integers(2, 5)),
        rows=draw(st.integers(2, 6)),
        tag_m=tag_m,
        gap_m=tag_m * ratio,
        family=draw(st.sampled_from(sorted(FAMILIES))),
        first=draw(st.sampled_from(FIRST_TAGS)),
        border_bits=draw(st.sampled_from(BORDER_BITS)),
        squares=draw(st.booleans()),
    )


@given(aprilgrids())
def test_aprilgrid_specs_round_trip(board):
    """Any AprilGrid's SPEC parses back to an equal board, bit for bit."""
    assert parse_board(board.spec) == board


@given(lengths_m)
def test_lengths_round_trip(length_m):
    """A length survives being written and read."""
    assert float(parse_length(format_length(length_m), "side")) == length_m


@pytest.mark.parametrize(
    ("spec", "problem"),
    [
        ("", "kind: unknown"),
        ("9x6", "kind: unknown"),
        ("chekerboard:9x6:25mm", "Did you mean 'checkerboard'"),
        ("AprilGrid:6x6:88mm:0.3", "Did you mean 'aprilgrid'"),
        ("charuco:5x7:30mm", "expected one of checkerboard, aprilgrid"),
        ("checkerboard", "wrong fields .got 0"),
        ("checkerboard:9x6", "wrong fields .got 1"),
        ("checkerboard::25mm", "wrong fields"),
        ("checkerboard:9x6:25mm:25mm", "wrong fields .got 3"),
        ("checkerboard:9x6:25mm:", "wrong fields"),
        ("checkerboard:9x6:25mm:border=1", "has none"),
        ("checkerboard:25mm:9x6", "COLUMNSxROWS in whole numbers"),
        ("checkerboard:9.5x6:25mm", "whole numbers"),
        ("checkerboard:9x:25mm", "whole numbers"),
        ("checkerboard:٣x6:25mm", "whole numbers"),
        ("checkerboard:1x6:25mm", "columns of inner corners: too few"),
        ("checkerboard:9x2:25mm", "rows of inner corners: too few"),
        ("checkerboard:-9x6:25mm", "too few"),
        ("checkerboard:999999999999x6:25mm", "too many"),
        ("checkerboard:9x6:25", "no unit .*Write 25mm"),
        ("checkerboard:9x6:mm", "not a length"),
        ("checkerboard:9x6:25km", "unknown unit .got 'km'"),
        ("checkerboard:9x6:1e-3m", "unknown unit"),
        ("checkerboard:9x6:24,5mm", "unknown unit"),
        ("checkerboard:9x6:0mm", "must be positive"),
        ("checkerboard:9x6:-25mm", "must be positive"),
        ("checkerboard:9x6:25m", "absurd size .got 25 m"),
        ("checkerboard:9x6:0.000001mm", "absurd size"),
        ("checkerboard:9x6:nanmm", "not a length"),
        ("checkerboard:9x6:" + "9" * 400 + "mm", "too long .got 419"),
        ("aprilgrid:6x6:88mm", "wrong fields .*COLUMNSxROWS:TAG:SPACING"),
        ("aprilgrid:6x6:88:0.3", "tag: no unit"),
        ("aprilgrid:6x6:88mm:26.4", "spacing: absurd .*a length needs its unit"),
        ("aprilgrid:6x6:88mm:0", "spacing: must be positive"),
        ("aprilgrid:6x6:88mm:-0.3", "spacing: must be positive"),
        ("aprilgrid:6x6:88mm:x", "spacing: not a length"),
        ("aprilgrid:1x6:88mm:0.3", "columns of tags: too few"),
        ("aprilgrid:6x6:88mm:0.3:famly=tag36h10", "Did you mean 'family'"),
        ("aprilgrid:6x6:88mm:0.3:family=36h11", "Did you mean 'tag36h11'"),
        ("aprilgrid:6x6:88mm:0.3:family=", "family: unknown"),
        ("aprilgrid:6x6:88mm:0.3:first=topleft", "Did you mean 'top-left'"),
        ("aprilgrid:6x6:88mm:0.3:border=3", "border: unknown .got '3', expected one of 1, 2"),
        ("aprilgrid:6x6:88mm:0.3:squares=maybe", "squares: unknown"),
        ("aprilgrid:6x6:88mm:0.3:border=1:border=2", "given twice"),
        ("aprilgrid:6x6:88mm:0.3:family=tag16h5", "at most 30"),
    ],
)
def test_nonsense_is_refused_with_a_clear_line(spec, problem):
    """One line that quotes the SPEC and says what is wrong."""
    with pytest.raises(InputError, match=problem) as caught:
        parse_board(spec)
    assert str(caught.value).startswith(f"board '{spec.strip()[:40]}")
    assert caught.value.exit_code == 2


def test_control_characters_never_reach_the_message():
    """Neither a line break nor an escape sequence gets through, so the error stays one line."""
    with pytest.raises(InputError) as caught:
        parse_board("checkerboard:9x6\n:\x1b[31m25mm")
    assert str(caught.value).isprintable()


def answer_to(spec: str) -> str:
    """The SPEC of the board that is named, or the error's line."""
    try:
        return parse_board(spec).spec
    except InputError as error:
        return str(error)


@given(st.text(max_size=60))
def test_any_text_is_a_board_or_an_input_error(text):
    """Nothing but a board or one printable line comes out of any text."""
    assert answer_to(f"checkerboard:9x6:{text}").isprintable()
    assert answer_to(text).isprintable()


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_shows_an_example_that_works(kind):
    """The example in the table parses and is canonical."""
    assert KINDS[kind].example.startswith(f"{kind}:")
    assert parse_board(KINDS[kind].example).spec == KINDS[kind].example


def test_naming_a_board_does_not_load_opencv():
    """OpenCV's start-up is paid only where tags are drawn."""
    code = "from camcal.boards.spec import parse_board; parse_board('aprilgrid:6x6:88mm:0.3').object_points"
    assert "cv2" not in loaded_by(code)
