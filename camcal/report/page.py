"""Templates to one self-contained HTML page that asks the network for nothing."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Any

import jinja2
from markupsafe import Markup, escape

import camcal
from camcal.report.figures.style import STYLES

_TEMPLATES = "templates"
_PACKAGE = "camcal.report"
_NAME = re.compile(r"[fc][xy]\b|\w*[\d_]|\S+\.\w+:")
_OPTION = re.compile(r"(--[a-z][\w-]*(?: [kp]\d(?:,[kp]\d)*)?)")


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure with its caption."""

    name: str
    title: str
    svg: Markup
    caption: str


def render_page(template: str, context: Mapping[str, Any]) -> str:
    """Fill a template in.

    Parameters
    ----------
    template : str
        File name of a page that extends `base.html.j2`.
    context : mapping
        What it refers to; all text is escaped but what is marked as safe.

    Returns
    -------
    str
        An HTML document: style, script and images stand in it, and its Content-Security-Policy forbids all else.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader(_PACKAGE, _TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(sentence=_sentence, ended=_ended, with_options=_with_options)
    script = _text("report.js")
    frame = {
        "style": Markup(_style()),
        "script": Markup(script),
        "script_hash": base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        "version": camcal.__version__,
    }
    return environment.get_template(template).render({**frame, **context})


def _sentence(text: str) -> str:
    """Begin with a capital, unless the first word is a name: of a parameter, a figure or a file.

    Examples
    --------
    >>> _sentence("every view is flat"), _sentence("k3 is not supported"), _sentence("fx is off"), _sentence("a.png: blurred")
    ('Every view is flat', 'k3 is not supported', 'fx is off', 'a.png: blurred')
    """
    return text if _NAME.match(text) else text[:1].upper() + text[1:]


def _ended(text: str) -> str:
    """End with a full stop, unless the text ends as a sentence does.

    Examples
    --------
    >>> _ended("blurred"), _ended("is it a ChArUco board?")
    ('blurred.', 'is it a ChArUco board?')
    """
    return text if text.endswith((".", "?", "!")) else f"{text}."


def _with_options(text: str) -> Markup:
    """Set the options of a command line apart, and keep each on one line."""
    return Markup(_OPTION.sub(r"<code>\1</code>", str(escape(text))))


def _style() -> str:
    """The style sheet, with the colours of the figures on light and dark ground."""
    text = _text("style.css")
    for name in ("light", "dark"):
        text = text.replace(f"/* figures: {name} */", STYLES[name].css())
    return text


def _text(name: str) -> str:
    """Read a file of the package's templates."""
    return (resources.files(_PACKAGE) / _TEMPLATES / name).read_text(encoding="utf-8")
