"""Figures to bytes: SVG text that stands in a page among others, and files for papers."""

from __future__ import annotations

import io
import re
from typing import Any

from matplotlib.figure import Figure

from camcal.report.figures.style import css_variables, plain_settings

KINDS = ("svg", "png", "pdf")
"""The files that `render` makes."""

# Nothing that changes from day to day or from one version of the library to the next.
_METADATA: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": None},
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
_RASTER_DPI = 144
_SHARED_STYLE = (
    "stroke-linejoin:round;stroke-linecap:butt;font-family:var(--figure-font,'DejaVu Sans',Verdana,Helvetica,Arial,sans-serif)"
)
_NOT_NEEDED = re.compile(
    r"<metadata>.*?</metadata>|<style[^>]*>.*?</style>|<!--.*?-->| font-family:[^;\"]*;| target=\"_blank\"|"
    r" version=\"[^\"]*\"| transform=\"rotate\(-0 [^\"]*\"",
    re.DOTALL,
)
_GEOMETRY = re.compile(r' (?:d|x|y|points|transform|width|height)="[^"]*"')
_DECIMALS = re.compile(r"-?\d+\.\d{3,}")
_ID = re.compile(r' id="([^"]+)"')
_REFERENCE = re.compile(r'(href="#|url\(#)([^")]+)')


def render(figure: Figure, kind: str, dpi: float = 200) -> bytes:
    """Turn a figure into the bytes of a file, the same ones each time.

    Parameters
    ----------
    figure : Figure
    kind : str
        One of `KINDS`. Text is outlines in SVG and TrueType in PDF, so that any program shows it alike.
    dpi : float
        Pixels per inch of a PNG, and of what is rasterised in the others.

    Raises
    ------
    ValueError
        If there is no such kind.
    """
    if kind not in KINDS:
        raise ValueError(f"kind: unknown (got {kind!r}, expected one of {', '.join(KINDS)})")
    return _saved(figure, kind, dpi, {"svg.fonttype": "path"})


def render_svg(figure: Figure, prefix: str) -> str:
    """Turn a figure into SVG text to be put into a page as it stands.

    Parameters
    ----------
    figure : Figure
    prefix : str
        A name that no other SVG on the page has: every id starts with it and a hyphen, so what was drawn with the gid
        `bar-3` is `#PREFIX-bar-3`. Links to other places of the page (`href="#view-3"`) stay as they are.

    Returns
    -------
    str
        One <svg> element with a viewBox and no size: it is as wide as what it is put in. Text stays text, in the font of
        the CSS variable `--figure-font`; colours of the style "page" are CSS variables. The same figure gives the same text.
    """
    text = _saved(figure, "svg", _RASTER_DPI, {"svg.fonttype": "none"}).decode()
    text = _NOT_NEEDED.sub("", text[text.index("<svg") :]).replace("xlink:href", "href")
    width, height = figure.get_size_inches() * 72
    opening = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" style="{_SHARED_STYLE}">'
    body = text[text.index(">") + 1 :]
    body = _GEOMETRY.sub(lambda attribute: _DECIMALS.sub(_shortened, attribute[0]), body)
    body = re.sub(r"<defs>\s*</defs>", "", _with_prefix(body, prefix))
    return css_variables(opening + re.sub(r"\s*\n\s*", "\n", body).strip())


def _saved(figure: Figure, kind: str, dpi: float, settings: dict[str, Any]) -> bytes:
    file = io.BytesIO()
    with plain_settings(settings):
        figure.savefig(file, format=kind, dpi=dpi, metadata=_METADATA[kind])
    return file.getvalue()


def _shortened(number: re.Match[str]) -> str:
    """Round to a hundredth of a point."""
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")


def _with_prefix(body: str, prefix: str) -> str:
    """Keep the ids that something refers to, and those given by hand (with a hyphen), and start each with the prefix."""
    own = set(_ID.findall(body))
    referred = own & {reference[1] for reference in _REFERENCE.findall(body)}
    kept = referred | {name for name in own if "-" in name}
    body = _ID.sub(lambda found: f' id="{prefix}-{found[1]}"' if found[1] in kept else "", body)
    return _REFERENCE.sub(lambda found: f"{found[1]}{prefix}-{found[2]}" if found[2] in own else found[0], body)
