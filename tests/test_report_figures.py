"""The figures of the report: each shows something, with titles and units, whatever the calibration says."""

from __future__ import annotations

import re

import numpy as np
import pytest
from capture_scenes import ordinary_poses
from figure_records import BY_NAME, CASES, FREE, LIGHT, NAMES, absurd, made, perfect, pixels

from camcal.report.figures import distortion, histogram, uncertainty
from camcal.report.figures.canvas import magnification, magnified, round_below
from camcal.report.figures.catalogue import FIGURES, STYLES, render, view_quiver


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("name", NAMES)
def test_every_figure_shows_something_in_every_style(record, name, style):
    """There is ink on more than a hundredth of the figure, and none in its outermost pixels, so nothing is cut off."""
    drawn = pixels(render(BY_NAME[name].draw(record, STYLES[style]), "png", 100))
    assert drawn.shape[1] == 720
    ground = drawn[0, 0]
    assert ground.tolist() == ([255] * 4 if style == "paper" else [255, 255, 255, 0])
    ink = (drawn != ground).any(axis=2)
    assert ink.mean() > 0.01
    assert not np.concatenate([ink[0], ink[-1], ink[:, 0], ink[:, -1]]).any()


@pytest.mark.parametrize("name", NAMES)
def test_axes_have_titles_and_units(record, name):
    """Axes are titled; labels name a unit, or what is counted, or what stands under each bar."""
    figure = BY_NAME[name].draw(record, LIGHT)
    titles = [axes.get_title() for axes in figure.axes] + [text.get_text() for text in figure.texts]
    assert any(titles)
    labels = {axes.get_xlabel() for axes in figure.axes} | {axes.get_ylabel() for axes in figure.axes}
    if name == "scene":
        labels |= {figure.axes[0].get_zlabel()}
    labels -= {"", "corners"}
    assert labels
    assert all(re.search(r"\((px|mm|m|°)\)$", label) for label in labels), labels


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("name", NAMES)
def test_every_case_can_be_drawn(case, name):
    """Few views, upright images, partial boards, folding lenses, absurd numbers and zeros all give a figure and a caption."""
    drawn = CASES[case]()
    kind = BY_NAME[name]
    figure = kind.draw(drawn, STYLES["page"])
    shown = pixels(render(figure, "png", 60))
    assert (shown != shown[0, 0]).any(axis=2).mean() > 0.005
    caption = kind.caption(drawn)
    assert caption.startswith("Good: ")
    assert "nan" not in caption
    assert "inf" not in caption.replace("infinity", "")


@pytest.mark.parametrize("case", CASES)
def test_a_view_of_every_case_can_be_drawn(case):
    """The quiver of a single view as well."""
    shown = pixels(render(view_quiver(CASES[case](), 1, STYLES["dark"]), "png", 60))
    assert (shown != shown[0, 0]).any(axis=2).mean() > 0.002


def test_unknown_uncertainty_is_said():
    """A covariance that overflows, and a lens without an inverse, are said to have nothing to show."""
    texts = [text.get_text() for axes in uncertainty.draw(absurd(), LIGHT).axes for text in axes.texts]
    assert sum(text.startswith("not available") for text in texts) == 2
    overflowing = made(ordinary_poses(4, 2), covariance=np.eye(len(FREE) + 6) * 1e307)
    texts = [text.get_text() for axes in uncertainty.draw(overflowing, LIGHT).axes for text in axes.texts]
    assert sum(text.startswith("not available") for text in texts) == 2
    assert any(text.get_text().startswith("not available") for text in distortion.draw(absurd(), LIGHT).axes[0].texts)
    assert any(text.get_text().startswith("not available") for text in histogram.draw(perfect(), LIGHT).axes[0].texts)


def test_round_numbers():
    """By hand."""
    assert [round_below(value) for value in (1.0, 1.99, 2.0, 4.9, 0.07, 730.0)] == pytest.approx([1, 1, 2, 2, 0.05, 500])
    assert (magnified(1500.0), magnified(1.5), magnified(0.02)) == ("magnified 1,500×", "magnified 1.5×", "shrunk 50×")
    assert magnification(np.zeros((4, 2)), 50.0) == 1.0
    assert magnification(np.full((9, 2), 0.1) / np.sqrt(2), 50.0) == pytest.approx(500)


def test_names_and_titles_are_told_apart():
    """They become files, ids and headings."""
    assert len(set(NAMES)) == len(FIGURES) == len({kind.title for kind in FIGURES})
    assert all(re.fullmatch(r"[a-z_]+", name) for name in NAMES)
