"""Sphinx: `make docs` builds the pages of this folder into build/docs."""

import sys
from pathlib import Path
from typing import Any

import typer
from docutils import nodes
from latex2mathml.converter import convert

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from beamstiff import __version__
from beamstiff.cli.main import app as commands

project = "beamstiff"
author = "The beamstiff authors"
copyright = "2026, The beamstiff authors"
release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["pictures"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
suppress_warnings = ["misc.highlighting_failure"]  # shortened listings
autodoc_typehints = "none"  # the docstrings say more: shapes and units
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True  # attributes of the same name in several classes are no targets
highlight_language = "none"
html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"beamstiff {__version__}"
html_show_sourcelink = False


def inline_math(page: Any, node: nodes.math) -> None:
    """Write an equation as MathML: browsers show it without any script from elsewhere."""
    page.body.append(convert(node.astext()))
    raise nodes.SkipNode


def block_math(page: Any, node: nodes.math_block) -> None:
    """Write an equation on a line of its own."""
    page.body.append(
        f'<div class="math" style="overflow-x:auto">{convert(node.astext(), display="block")}</div>'
    )
    raise nodes.SkipNode


def help_of_commands(_: Any, page: str, source: list[str]) -> None:
    """Append to the page of commands what their `--help` says."""
    if page == "commands":
        group = typer.main.get_command(commands)
        for name, command in group.commands.items():
            context = typer.Context(command, info_name=f"beamstiff {name}", max_content_width=90)
            source[0] += f"\n## {name}\n\n````\n{command.get_help(context)}\n````\n"


def setup(app: Any) -> None:
    """Tell Sphinx how to write equations."""
    app.connect("source-read", help_of_commands)
    app.add_html_math_renderer("mathml", (inline_math, None), (block_math, None))
