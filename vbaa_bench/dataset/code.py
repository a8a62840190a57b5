"""Digests of the code that generates data; they identify the program that made a dataset."""

import functools
from pathlib import Path
from typing import Final

from solver.instrument.syntax import syntax_digests

ROOT: Final = Path(__file__).parent.parent.parent
# The module that renders frames. Data depend on every module that it imports, also indirectly.
RENDERING_MODULE: Final = "vbaa_bench.generation.dataset_worker"
# Imported by RENDERING_MODULE, but without effect on the bytes of any file.
_WITHOUT_EFFECT: Final = {
    "solver.instrument.compiled",
    "solver.instrument.errors",
    "solver.instrument.files",
    "solver.instrument.hashes",
    "solver.instrument.syntax",
    "vbaa_bench.dataset.layout",
}


@functools.cache
def code_digests() -> dict[str, str]:
    """Digest the syntax tree, without docstrings, of every module that data depend on, by name."""
    return syntax_digests([RENDERING_MODULE], ROOT, ("vbaa_bench", "solver"), _WITHOUT_EFFECT)
