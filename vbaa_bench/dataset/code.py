"""Digests of the code that generates data; they identify the program that made a dataset."""

import ast
import functools
import hashlib
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parent.parent.parent
# The module that renders frames. Data depend on every module that it imports, also indirectly.
RENDERING_MODULE: Final = "vbaa_bench.generation.frame_renderer"
# Imported by RENDERING_MODULE, but without effect on the bytes of any file.
_WITHOUT_EFFECT: Final = {
    "solver.instrument.errors",
    "solver.instrument.files",
    "solver.instrument.hashes",
    "vbaa_bench.dataset.layout",
}


@functools.cache
def code_digests() -> dict[str, str]:
    """Digest the syntax tree, without docstrings, of every module that data depend on, by name."""
    digests: dict[str, str] = {}
    pending = [RENDERING_MODULE]
    while pending:
        module = pending.pop()
        path = _source(module)
        if module in digests or module in _WITHOUT_EFFECT or path is None:
            continue
        tree = ast.parse(path.read_bytes())
        digests[module] = _digest(tree)
        pending += _imports(tree)
    return dict(sorted(digests.items()))


def _source(module: str) -> Path | None:
    """Find the file of a module of this project; None for all others."""
    if module.partition(".")[0] not in ("vbaa_bench", "solver"):
        return None
    stem = ROOT.joinpath(*module.split("."))
    candidates = (stem.with_suffix(".py"), stem / "__init__.py")
    return next((path for path in candidates if path.is_file()), None)


def _imports(tree: ast.Module) -> list[str]:
    """List names that a module imports anywhere; for `from a import b` both a and a.b."""
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
    return names


def _digest(tree: ast.Module) -> str:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                node.body = node.body[1:]
    return hashlib.blake2b(ast.dump(tree).encode(), digest_size=8).hexdigest()
