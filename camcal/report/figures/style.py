"""What the figures look like: the colours of a light page, of a dark one, of one that is both, and of a printed paper."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import matplotlib as mpl

P = ParamSpec("P")
T = TypeVar("T")

_TEXT_PT = 10.5
_SETTINGS = {
    "font.family": ["DejaVu Sans"],
    "font.size": _TEXT_PT,
    "axes.titlesize": _TEXT_PT,
    "axes.labelsize": _TEXT_PT - 0.5,
    "xtick.labelsize": _TEXT_PT - 1,
    "ytick.labelsize": _TEXT_PT - 1,
    "legend.fontsize": _TEXT_PT - 1,
    "axes.linewidth": 0.8,
    "xtick.major.width": 0.8,
    "ytick.major.width": 0.8,
    "grid.linewidth": 0.6,
    "hatch.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "svg.hashsalt": "camcal",
    "pdf.fonttype": 42,
    "image.composite_image": False,
}
_UNTOUCHED = {"backend", "backend_fallback", "interactive", "toolbar", "timezone", "datapath", "webagg.port"}
_LOCK = threading.RLock()


@dataclass(frozen=True, slots=True)
class Style:
    """Colours by what they are for, each as `#rrggbb`.

    Attributes
    ----------
    ink : str
        Text, and frames of images.
    muted : str
        Axes, ticks, and what is only there for comparison.
    grid : str
        Grid lines.
    paper : str
        What lies behind the figure; the figure itself is transparent.
    shade : str
        Areas that stand for "nothing here".
    plain, notable, bad : str
        Data as it should be, data to look at, and data that is wrong: blue, orange and vermilion, which colour-blind
        people can tell apart (Okabe and Ito 2008).
    strong : str
        The line that sums the data up, drawn over it.
    opaque : bool
        Whether the figure brings its paper along; else it is transparent.
    """

    ink: str
    muted: str
    grid: str
    paper: str
    shade: str
    plain: str
    notable: str
    bad: str
    strong: str
    opaque: bool = False

    @property
    def colours(self) -> dict[str, str]:
        """Every colour by the name of what it is for."""
        return {name: colour for name, colour in asdict(self).items() if isinstance(colour, str)}

    def css(self) -> str:
        """Return the colours as declarations of the CSS variables that a figure in the "page" style refers to."""
        return "".join(f"--figure-{name}:{colour};" for name, colour in self.colours.items())


STYLES = {
    "light": Style("#1c2026", "#5c6470", "#d9dde3", "#ffffff", "#eceff3", "#0072b2", "#d98200", "#c8470a", "#12161c"),
    "dark": Style("#e8eaee", "#a3abb8", "#3a414c", "#14171c", "#262b33", "#56b4e9", "#f0ad33", "#ff7a3d", "#f7f9fc"),
    # Every colour is one that reads on both grounds, told apart from all others so that it can stand for a variable.
    "page": Style("#767c87", "#7d838e", "#8f959f", "#808691", "#8a909a", "#2e8bc8", "#e19517", "#e05d21", "#868c97"),
    "paper": Style(
        "#000000", "#444444", "#dddddd", "#ffffff", "#eeeeee", "#0072b2", "#e69f00", "#d55e00", "#000000", opaque=True
    ),
}
"""By name. A figure in the style "page" becomes, through `render_svg`, one SVG for light and dark pages: its colours are
CSS variables (`--figure-ink` and so on) which the page declares with `Style.css` of "light" and of "dark"."""


def css_variables(svg: str) -> str:
    """Replace the colours of the style "page" in an SVG by the CSS variables that they stand for."""
    for name, colour in STYLES["page"].colours.items():
        svg = svg.replace(colour, f"var(--figure-{name},{colour})")
    return svg


@contextmanager
def plain_settings(settings: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Set matplotlib up as the figures need it, whatever the user's own settings are; one thread at a time."""
    wanted: Any = {name: value for name, value in mpl.rcParamsDefault.items() if name not in _UNTOUCHED}
    wanted.update(_SETTINGS)
    wanted.update(settings or {})
    with _LOCK, mpl.rc_context(wanted):
        yield


def with_plain_settings(draw: Callable[P, T]) -> Callable[P, T]:
    """Let a function draw with the figures' settings."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> T:
        with plain_settings():
            return draw(*args, **kwargs)

    return drawn
