"""Sphinx: the pages of docs/, results/, scenes/ and solver/ as one site.  make docs

The source folder is the whole repository, so that a link between pages is the same in the site and
in the repository.
"""

import importlib
import tomllib
from pathlib import Path

import typer
from sphinx.application import Sphinx
from typer.cli import get_docs_for_click

ROOT = Path(__file__).parent.parent
with (ROOT / "pyproject.toml").open("rb") as file:
    _PROJECT = tomllib.load(file)["project"]

project = "VBAA-Bench"
author = "The VBAA-Bench authors"
copyright = f"2026, {author}"  # noqa: A001  # Sphinx's own name
release = version = _PROJECT["version"]

root_doc = "docs/index"
include_patterns = ["docs/*.md", "results/*/*.md", "scenes/README.md", "solver/README.md"]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 3
# Tables beside the README of a folder of results, which links to them.
suppress_warnings = ["toc.not_included"]
# Names in docstrings are in single back quotes.
default_role = "code"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "imported-members": True}
autodoc_typehints = "description"

html_theme = "furo"
html_title = f"VBAA-Bench {release}"
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


def setup(app: Sphinx) -> None:
    """Register what is written from the code."""
    app.connect("source-read", _write_commands)
