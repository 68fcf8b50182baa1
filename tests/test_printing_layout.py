"""Boards laid out on paper: on the sheet, clear of ruler and texts, with nothing in the white around them."""

from __future__ import annotations

import re

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.boards.page import Page, lay_out
from camcal.errors import InputError

CHECKERBOARD = Checkerboard(9, 6, 0.025)
APRILGRID = AprilGrid(6, 6, 0.024, 0.0072)


def clear_of_board(page: Page, white_mm: float) -> bool:
    """Whether ruler and texts stay `white_mm` below the board; capitals are .72 of a font's size high (Helvetica)."""
    tops = [page.ruler_mm[:, 1].min(), *(text.baseline_mm - 0.72 * text.size_mm for text in page.texts)]
    return min(tops) >= page.ink_mm[:, 3].max() + white_mm - 2e-3


sheets = st.one_of(
    st.sampled_from(["auto", "a4", "a3", "letter", "tabloid"]),
    st.tuples(st.integers(50, 700), st.integers(50, 700)).map(lambda size: f"{size[0]}x{size[1]}mm"),
)
boards = st.one_of(
    st.builds(Checkerboard, st.integers(3, 14), st.integers(3, 14), st.integers(1, 60).map(lambda mm: mm / 1000)),
    st.builds(
        lambda columns, rows, tag_mm, squares: AprilGrid(columns, rows, tag_mm / 1e3, tag_mm / 4e3, squares=squares),
        st.integers(2, 8),
        st.integers(2, 8),
        st.integers(5, 100),
        st.booleans(),
    ),
)


@settings(deadline=None)
@example(AprilGrid(2, 3, 0.005, 0.00125), "50x50mm", False)
@given(boards, sheets, st.booleans())
def test_whatever_fits_is_on_the_sheet_and_stands_clear(board, paper, landscape):
    """Ink and ruler keep off the sheet's edge, half the quiet zone stays white, and the advice of a refusal works."""
    try:
        page = lay_out(board, paper=paper, landscape=landscape)
    except InputError as error:
        advice = re.search(r"Use --paper (\S+?)( --landscape)?\.$", str(error))
        assert advice
        page = lay_out(board, paper=advice.group(1), landscape=bool(advice.group(2)))
    quiet_mm = 1e3 * float(board.pattern.x_edges_m[1] - board.pattern.x_edges_m[0])
    left, top = page.ink_mm[:, :2].min(axis=0)
    right = page.ink_mm[:, 2].max()
    edge = max(4.5, quiet_mm / 2) - 2e-3
    assert left >= edge
    assert top >= edge
    assert page.width_mm - right >= edge
    assert clear_of_board(page, quiet_mm / 2)
    assert left == pytest.approx(page.width_mm - right, abs=1e-6)
    assert page.ruler_mm[:, 3].max() <= page.height_mm - 4.5
    assert max(text.baseline_mm for text in page.texts) <= page.height_mm - 4.5
    assert page.ruler_mm[:, 0].min() >= 4.0
    assert page.ruler_mm[:, 2].max() <= page.width_mm - 4.0


@pytest.mark.parametrize(
    ("board", "paper"), [(Checkerboard(7, 5, 0.02), "a4"), (APRILGRID, "a4"), (Checkerboard(8, 6, 0.025), "a3")]
)
def test_the_whole_quiet_zone_is_white_where_the_sheet_has_room(board, paper):
    """Centred on the sheet, with the pattern's own white border untouched and on the paper."""
    page = lay_out(board, paper=paper, landscape=False)
    quiet_mm = 1e3 * float(board.pattern.x_edges_m[1] - board.pattern.x_edges_m[0])
    middle = (page.ink_mm[:, :2].min(axis=0) + page.ink_mm[:, 2:].max(axis=0)) / 2
    assert middle == pytest.approx([page.width_mm / 2, page.height_mm / 2], abs=1e-6)
    assert page.ink_mm[:, :2].min() >= quiet_mm
    assert clear_of_board(page, quiet_mm)


def test_narrow_paper_gets_a_shorter_ruler_that_says_so():
    """On a sheet 90 mm wide the ruler is 70 mm, and the caption asks for 70 mm."""
    page = lay_out(Checkerboard(5, 4, 0.01), paper="90x120mm", landscape=False)
    left, _, right, _ = page.ruler_mm[0]
    assert right - left == pytest.approx(70, abs=1e-9)
    texts = [text.text for text in page.texts]
    assert "70" in texts
    assert "80" not in texts
    assert texts[-1].endswith("the ruler must measure 70 mm.")


def test_long_captions_are_broken_and_lose_nothing():
    """On a 60 mm sheet the caption takes several lines, none wider than the margins allow; joined they are whole."""
    from reportlab.pdfbase.pdfmetrics import stringWidth

    board = AprilGrid(2, 2, 0.012, 0.0033, family="tag36h10", first="top-left", border_bits=1, squares=False)
    page = lay_out(board, paper="60x90mm", landscape=False)
    lines = [text for text in page.texts if text.text != "mm" and not text.text.isdigit()]
    assert len(lines) > 3
    assert max(stringWidth(line.text, "Helvetica", line.size_mm) for line in lines) <= 60 - 9
    assert f"--board{board.spec}" in "".join(line.text for line in lines).replace(" ", "")


def test_auto_takes_the_smallest_sheet_of_the_a_series():
    """Upright before turned, small before large; `landscape` insists on a turned one."""
    auto = {"paper": "auto", "landscape": False}
    sizes = [lay_out(board, **auto) for board in (APRILGRID, CHECKERBOARD, AprilGrid(6, 6, 0.03, 0.009))]
    assert [(page.width_mm, page.height_mm) for page in sizes] == [(210, 297), (297, 210), (297, 420)]
    turned = lay_out(Checkerboard(4, 3, 0.02), paper="auto", landscape=True)
    assert (turned.width_mm, turned.height_mm) == (297, 210)
