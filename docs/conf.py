"""How Sphinx builds the documentation: `sphinx-build -W -n --keep-going -b html docs build/docs`."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import camcal

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

if TYPE_CHECKING:
    from docutils.nodes import Element
    from sphinx.addnodes import pending_xref
    from sphinx.application import Sphinx
    from sphinx.environment import BuildEnvironment

project = "camcal"
author = copyright = "The camcal developers"  # noqa: A001 - Sphinx's name
version = release = camcal.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax", "sphinx_click"]
exclude_patterns = ["_build", "_generated/parts"]
myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
myst_links_external_new_tab = False

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: name for name in ("BoolArray", "FloatArray", "Image", "Images", "Inputs", "IntArray", "Seen")}
default_role = "code"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = True
add_module_names = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 88

nitpicky = True
# The build has no network: numpy's and Python's own names stay plain text. Ours must resolve.
nitpick_ignore_regex = [(r"py:.*", r"(?!camcal\.).*")]

html_theme = "furo"
html_title = f"camcal {version}"
html_static_path = ["static"]
html_css_files = ["camcal.css"]
html_show_sphinx = False


def _public_place(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: Element) -> Element | None:
    """Point a reference to where a public name is defined (`camcal.geometry.camera.Camera`) to `camcal.Camera`."""
    target = str(node.get("reftarget", ""))
    name = target.rpartition(".")[2]
    if node.get("refdomain") != "py" or not target.startswith("camcal.") or name not in camcal.__all__:
        return None
    domain = env.get_domain("py")
    return domain.resolve_xref(env, node["refdoc"], app.builder, node["reftype"], f"camcal.{name}", node, content)


def _generate(app: Sphinx) -> None:
    """Make what is generated before the pages are read."""
    del app
    import logging

    import figures
    import generated

    # What camcal says of the calibrations in the figures is no matter of the build.
    logging.getLogger("camcal").setLevel(logging.ERROR)
    figures.main(HERE / "_generated" / "figures")
    generated.main(HERE / "_generated")


def _whole_properties(_app: Sphinx, what: str, *described: Any) -> None:
    """Keep napoleon from taking what stands before a colon in a property's first line for its type."""
    lines: list[str] = described[-1]
    if what in ("attribute", "property") and lines:
        # An empty comment, so that there is no colon in the first line.
        lines[:0] = ["..", ""]


def _plain_aliases(_app: Sphinx, _what: str, *described: Any) -> tuple[str | None, str | None]:
    """Show a type alias by its name also where it is one of several types."""
    signature, result = (text and re.sub(r"TypeAliasForwardRef\('(\w+)'\)", r"\1", text) for text in described[-2:])
    return signature, result


def setup(app: Sphinx) -> None:
    """Connect all of them."""
    app.connect("missing-reference", _public_place)
    app.connect("autodoc-process-docstring", _whole_properties, priority=400)
    app.connect("autodoc-process-signature", _plain_aliases)
    app.connect("builder-inited", _generate)
