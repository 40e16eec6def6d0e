"""The site: `make docs` builds it into out/docs, without network, from the pages of this folder and from the code."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "extensions"))

project = "relume"
author = "The relume developers"
copyright = f"2026, {author}"
extensions = [
    "myst_nb",  # pages in Markdown; the lessons' code runs while the site is built
    "sphinx.ext.autodoc",
    "sphinx_design",
    "sphinx_copybutton",
    "anchors",  # links to headings by names that they had
    "mathml",
    "reference",
    "glossary_links",
    "notebooks",
]
exclude_patterns = ["extensions"]
smartquotes = False  # options are named with two hyphens

html_theme = "furo"
html_title = "relume"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_search_scorer = str(HERE / "static/search.js")  # how-to before decisions, headings before text
html_baseurl = ""
html_copy_source = False
html_show_sourcelink = False
html_math_renderer = "mathml"

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 4  # pages link to each other's headings
nb_execution_mode = "cache"
nb_execution_raise_on_error = True
nb_execution_timeout = 240
nb_merge_streams = True

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
