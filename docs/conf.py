"""Sphinx: the pages of docs/, results/, scenes/ and solver/ as one site.  make docs

The source folder is the whole repository, so that a link between pages is the same in the site and
in the repository.
"""

import importlib
import tomllib
from pathlib import Path

import typer
from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator
from typer.cli import get_docs_for_click

ROOT = Path(__file__).parent.parent
with (ROOT / "pyproject.toml").open("rb") as file:
    _PROJECT = tomllib.load(file)["project"]

project = "VBAA-Bench"
author = "The VBAA-Bench authors"
copyright = f"2026, {author}"  # noqa: A001  # Sphinx's own name
release = version = _PROJECT["version"]

root_doc = "docs/index"
include_patterns = [
    "docs/*.md",
    "results/*/*.md",
    "scenes/README.md",
    "solver/README.md",
    "solver/example/README.md",
]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 3
myst_enable_extensions = ["dollarmath"]
# Tables beside the README of a folder of results, which links to them.
suppress_warnings = ["toc.not_included"]
# Names in docstrings are in single back quotes.
default_role = "code"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "imported-members": True}
autodoc_typehints = "description"

# Equations are MathML, which browsers draw without a script or a network; with one of these fonts
# brackets and sums grow with their content.
html_math_renderer = "mathml"
_MATH_FONTS = "Latin Modern Math, STIX Two Math, Cambria Math, DejaVu Math TeX Gyre, math"
html_theme = "furo"
html_title = f"VBAA-Bench {release}"
html_static_path = ["_static"]
html_css_files = ["tables.css"]
html_copy_source = False
html_show_sourcelink = False

# Pages that are written from the code: in the repository they only say so.
_PAGE_OF_COMMANDS = "docs/command_options"
_COMMANDS = {"vbaa-bench": "vbaa_bench.cli", "python -m solver": "solver.lab.command_line"}


def _write_commands(_app: Sphinx, page: str, source: list[str]) -> None:
    """Append arguments and options of all commands, as their help shows them."""
    if page != _PAGE_OF_COMMANDS:
        return
    for name, module in _COMMANDS.items():
        group = typer.main.get_command(importlib.import_module(module).app)
        context = group.make_context(name, [], resilient_parsing=True)
        text = get_docs_for_click(obj=group, ctx=context, name=name)
        source[0] += "\n" + "".join(
            f"#{line}" if line.startswith("#") else line for line in text.splitlines(keepends=True)
        )


def _formula(node: nodes.Element, as_block: bool = False) -> str:
    """Convert a formula of a page to MathML."""
    formula: str = tex2mathml(node.astext(), as_block)
    return formula.replace("<math ", f'<math style="font-family: {_MATH_FONTS}" ', 1)


def _write_inline(writer: HTML5Translator, node: nodes.math) -> None:
    """Write a formula within a sentence."""
    writer.body.append(_formula(node))
    raise nodes.SkipNode


def _write_block(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write a displayed formula, which scrolls where the page is narrower."""
    formula = _formula(node, as_block=True)
    writer.body.append(f'<div style="overflow-x: auto; margin: 1em 0">{formula}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Register what is written from the code, and the writer of equations."""
    app.connect("source-read", _write_commands)
    app.add_html_math_renderer("mathml", (_write_inline, None), (_write_block, None))
