"""The program that makes a dataset: digests of its code, and versions of packages."""

import functools
import importlib.metadata
import json
import platform
from pathlib import Path
from typing import Final

from solver.instrument.hashes import digest
from solver.instrument.syntax import kept_result, syntax_digests

ROOT: Final = Path(__file__).parent.parent.parent
# The module that renders frames. Data depend on every module that it imports, also indirectly.
RENDERING_MODULE: Final = "vbaa_bench.generation.dataset_worker"
_OWN_PACKAGES: Final = ("vbaa_bench", "solver")
# Imported by RENDERING_MODULE, but without effect on the bytes of any file.
_WITHOUT_EFFECT: Final = {
    "solver.instrument.compiled",
    "solver.instrument.errors",
    "solver.instrument.files",
    "solver.instrument.hashes",
    "solver.instrument.syntax",
    "vbaa_bench.dataset.layout",
}
# Other packages that shape the data.
_PACKAGES: Final = (
    "mitsuba",
    "drjit",
    "numpy",
    "numba",
    "scipy",
    "opencv-contrib-python-headless",
    "OpenEXR",
    "trimesh",
    "polars",
)


@functools.cache
def code_digests() -> dict[str, str]:
    """Digest the syntax tree, without docstrings, of every module that data depend on, by name."""

    def digests() -> str:
        return json.dumps(syntax_digests([RENDERING_MODULE], ROOT, _OWN_PACKAGES, _WITHOUT_EFFECT))

    roots = [ROOT / package for package in _OWN_PACKAGES]
    texts: dict[str, str] = json.loads(kept_result(roots[0], "code", roots, digests))
    return texts


def versions() -> dict[str, str]:
    """Collect the versions of Python and of every package that shapes the data."""
    python = ".".join(platform.python_version_tuple()[:2])
    return {"python": python, **{name: importlib.metadata.version(name) for name in _PACKAGES}}


@functools.cache
def program_digest() -> str:
    """Compute a digest of the code and of the versions of packages that decide the data."""
    return digest(json.dumps([versions(), code_digests()], sort_keys=True).encode())
