"""Digests of the code that generates data; they identify the program that made a dataset."""

import functools
import json
from pathlib import Path
from typing import Final

from solver.instrument.syntax import kept_result, syntax_digests

ROOT: Final = Path(__file__).parent.parent.parent
# The module that renders frames. Data depend on every module that it imports, also indirectly.
RENDERING_MODULE: Final = "vbaa_bench.generation.dataset_worker"
_PACKAGES: Final = ("vbaa_bench", "solver")
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

    def digests() -> str:
        return json.dumps(syntax_digests([RENDERING_MODULE], ROOT, _PACKAGES, _WITHOUT_EFFECT))

    roots = [ROOT / package for package in _PACKAGES]
    texts: dict[str, str] = json.loads(kept_result(roots[0], "code", roots, digests))
    return texts
