"""Files of figures: the same bytes each time, SVG that fits into a page, colours that can be read, little time and space."""

from __future__ import annotations

import re
import threading
import time
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from capture_scenes import ordinary_poses
from figure_records import BY_NAME, LIGHT, NAMES, made

from camcal.boards.checkerboard import Checkerboard
from camcal.geometry.pose import Pose
from camcal.report.figures.catalogue import FIGURES, KINDS, STYLES, render, render_svg, view_quiver

SVG = "{http://www.w3.org/2000/svg}"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["uncertainty", "residuals", "view_rms", "scene"])
def test_files_are_the_same_each_time(record, name, kind):
    """Drawn twice, the bytes are equal."""
    first, second = (render(BY_NAME[name].draw(record, STYLES["paper"]), kind, 60) for _ in range(2))
    assert first == second
    assert first.startswith({"svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}[kind])


def test_unknown_kind_of_file(record):
    """There is no such file."""
    with pytest.raises(ValueError, match=r"kind: unknown \(got 'gif'"):
        render(BY_NAME["view_rms"].draw(record, LIGHT), "gif")


@pytest.mark.parametrize("name", NAMES)
def test_svg_stands_in_a_page(record, name):
    """Well-formed, sized by its viewBox; ids start with the prefix and every reference finds its id; no rule reaches out."""
    text = render_svg(BY_NAME[name].draw(record, STYLES["page"]), "fig7")
    assert text == render_svg(BY_NAME[name].draw(record, STYLES["page"]), "fig7")
    root = ET.fromstring(text)
    assert root.tag == f"{SVG}svg"
    assert "width" not in root.attrib
    assert root.attrib["viewBox"].startswith("0 0 518.4 ")
    assert "<style" not in text
    assert "http://www.w3.org/2000/svg" in text
    ids = re.findall(r'\bid="([^"]*)"', text)
    assert len(ids) == len(set(ids))
    assert all(found.startswith("fig7-") for found in ids)
    references = set(re.findall(r'(?:href="|url\()#([^")]*)', text))
    assert {found for found in references if not found.startswith("view-")} <= set(ids)
    left = set(re.findall(r"#[0-9a-f]{6}", re.sub(r"var\([^)]*\)", "", text)))
    assert not left & set(STYLES["page"].colours.values())


def test_svg_keeps_its_text(record):
    """Titles are text that can be searched, with their digits, and bars can be found by their view."""
    text = render_svg(BY_NAME["view_rms"].draw(record, STYLES["page"]), "bars")
    assert ">RMS of 12 views, worst first<" in text
    assert all(f'id="bars-bar-{i}"' in text and f'href="#view-{i}"' in text for i in range(12))
    assert "var(--figure-plain," in text
    assert "DejaVu Sans', 'Bitstream" not in text


def test_styles_declare_what_pages_refer_to(record):
    """Every variable that an SVG refers to is declared by the light and by the dark style."""
    text = "".join(render_svg(kind.draw(record, STYLES["page"]), kind.name) for kind in FIGURES)
    for style in ("light", "dark"):
        declared = set(re.findall(r"--figure-\w+", STYLES[style].css())) | {"--figure-font"}
        assert set(re.findall(r"--figure-\w+", text)) <= declared


@pytest.mark.parametrize("style", ["light", "dark"])
def test_colours_can_be_read(style):
    """Text keeps a contrast of 4.5 to its ground, and data one of 3 (WCAG 2.1)."""

    def luminance(colour: str) -> float:
        parts = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
        linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    colours = STYLES[style].colours
    ground = luminance(colours["paper"])

    def contrast(name: str) -> float:
        lighter, darker = sorted([luminance(colours[name]), ground], reverse=True)
        return (lighter + 0.05) / (darker + 0.05)

    assert min(contrast("ink"), contrast("muted"), contrast("strong")) >= 4.5
    assert min(contrast("plain"), contrast("bad")) >= 3.0


def test_colours_of_the_page_are_told_apart():
    """No colour of the style that is replaced by variables occurs twice, or it would become the wrong variable."""
    colours = list(STYLES["page"].colours.values())
    assert len(set(colours)) == len(colours)


def test_fifty_views_fit_in_a_page():
    """All figures of 50 views of 54 corners, and all quivers, take less than 2 of the page's 5 MB."""
    drawn = made(ordinary_poses(50, 8))
    whole = sum(len(render_svg(kind.draw(drawn, STYLES["page"]), kind.name)) for kind in FIGURES)
    assert whole + 50 * len(render_svg(view_quiver(drawn, 0, STYLES["page"]), "v")) < 2e6


def test_five_hundred_views_of_four_hundred_corners():
    """Each figure takes less than a second of processor time and 300 kB."""
    board = Checkerboard(20, 20, 0.01)
    centre = board.object_points.mean(axis=0)
    rng = np.random.default_rng(0)
    views = []
    for _ in range(500):
        turn = Pose.from_rvec(rng.uniform(-0.5, 0.5, 3), [0, 0, 0])
        views.append(Pose(turn.R, rng.uniform([-0.1, -0.1, 0.3], [0.1, 0.1, 0.6]) - turn.R @ centre))
    drawn = made(views, board=board)
    for kind in FIGURES:
        start = time.thread_time()
        text = render_svg(kind.draw(drawn, STYLES["page"]), kind.name)
        assert time.thread_time() - start < 1, kind.name
        assert len(text) < 300_000, kind.name


def test_threads_do_not_disturb_one_another(record):
    """Figures drawn by four threads at once equal those drawn one after the other."""
    kinds = [BY_NAME[name] for name in ("view_rms", "distortion", "stance", "residual_histogram")]
    alone = [render_svg(kind.draw(record, STYLES["page"]), "a") for kind in kinds]
    together: dict[int, str] = {}

    def work(index: int) -> None:
        together[index] = render_svg(kinds[index].draw(record, STYLES["page"]), "a")

    threads = [threading.Thread(target=work, args=(index,)) for index in range(len(kinds))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [together[index] for index in range(len(kinds))] == alone


def test_settings_of_the_user_neither_count_nor_change(record):
    """A user's own settings of matplotlib are left as they are and change no figure."""
    import matplotlib as mpl

    plain = render(BY_NAME["view_rms"].draw(record, LIGHT), "svg")
    with mpl.rc_context({"font.size": 30, "lines.linewidth": 9, "axes.facecolor": "red", "svg.fonttype": "none"}):
        before = dict(mpl.rcParams)
        assert render(BY_NAME["view_rms"].draw(record, LIGHT), "svg") == plain
        assert dict(mpl.rcParams) == before
