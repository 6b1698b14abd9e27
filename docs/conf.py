"""Sphinx: `make docs` builds the pages of this folder into build/docs."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from beamstiff import __version__

project = "beamstiff"
author = "The beamstiff authors"
copyright = "2026, The beamstiff authors"
release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
exclude_patterns = ["pictures"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
suppress_warnings = ["misc.highlighting_failure"]  # shortened listings
autodoc_typehints = "none"  # the docstrings say more: shapes and units
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
html_theme = "furo"
html_title = f"beamstiff {__version__}"
html_show_sourcelink = False
