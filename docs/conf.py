"""Settings of the documentation site: make docs."""

import re
from typing import Any

from sphinx.application import Sphinx

import chmarl_pb

project = "chmarl_pb"
author = "The chmarl_pb maintainers"
copyright = author
version = release = chmarl_pb.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"]
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = f"chmarl_pb {release}"
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_theme_options = {"navigation_with_keys": True}

myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_default_options = {"members": True}
autosummary_generate = False
napoleon_numpy_docstring = False
napoleon_use_ivar = True
suppress_warnings = ["misc.highlighting_failure"]  # the guide shows parts of TOML files
nitpicky = False  # types of NumPy, PyTorch and Gymnasium have no pages here

#: Files of the checkout that are pages of the site, and where they lie there.
PAGES = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md", "LICENSE": "licences.md"}
SCRIPT = re.compile(r"^\[`(examples/\w+\.py)`\]\(\.\./\1\)$", re.MULTILINE)


def prepare(_: Sphinx, page: str, source: list[str]) -> None:
    """Let links to the README lead to the front page; show a script below each link to it that is a paragraph."""
    source[0] = source[0].replace("](../README.md", "](index.md")
    if page == "tutorials":
        source[0] = SCRIPT.sub(r"\g<0>\n\n```{literalinclude} ../\1\n:language: python\n```", source[0])


def move_links(_: Sphinx, __: Any, ___: str, source: list[str]) -> None:
    """Let links of a page of the checkout's top folder lead to the same pages from docs/."""
    text = source[0].replace("](docs/", "](")
    for file, page in PAGES.items():
        text = text.replace(f"]({file})", f"]({page})")
    source[0] = text


def setup(app: Sphinx) -> None:
    """Register what changes sources."""
    app.connect("source-read", prepare)
    app.connect("include-read", move_links)
