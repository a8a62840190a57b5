"""Digests of modules' syntax trees, which layout, comments and docstrings do not change."""

import ast
import hashlib
import os
import sys
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

from solver.instrument.files import write_bytes


def syntax_digests(
    modules: Iterable[str], root: Path, packages: Collection[str], ignored: Collection[str] = ()
) -> dict[str, str]:
    """Digest `modules` and all that they import, also indirectly, from `packages` under `root`.

    The `ignored` modules, and what only they import, are left out.
    """
    digests: dict[str, str] = {}
    pending = list(modules)
    while pending:
        module = pending.pop()
        if module.partition(".")[0] not in packages or module in {*digests, *ignored}:
            continue
        stem = root.joinpath(*module.split("."))
        for path in (stem.with_suffix(".py"), stem / "__init__.py"):
            if path.is_file():
                tree = ast.parse(path.read_bytes())
                digests[module] = syntax_digest(tree)
                pending += _imports(tree)
    return dict(sorted(digests.items()))


def kept_result(package: Path, name: str, roots: Iterable[Path], compute: Callable[[], str]) -> str:
    """Return a text that follows from all sources in `roots`, computed once for their very bytes.

    Parsing them takes half a second at every start of a program. The text is kept in the cache of
    `package`, under `name`, and is computed each time if the package is not writable.
    """
    if not os.access(package, os.W_OK):
        return compute()
    state = hashlib.sha256(sys.version.encode())  # the format of syntax trees
    for root in roots:
        for path in sorted(root.rglob("*.py")):
            state.update(f"\0{path.relative_to(root.parent)}\0".encode() + path.read_bytes())
    cache = package / "__pycache__"
    kept = cache / f"{name}-{state.hexdigest()[:12]}"
    if kept.is_file():
        return kept.read_text(encoding="utf-8")
    text = compute()
    for older in cache.glob(f"{name}-*"):
        older.unlink(missing_ok=True)
    cache.mkdir(exist_ok=True)
    write_bytes(kept, text.encode())
    return text


def syntax_digest(tree: ast.Module) -> str:
    """Digest a module's syntax tree without its docstrings, which are removed from `tree`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant):
                node.body = node.body[1:]
    return hashlib.blake2b(ast.dump(tree).encode(), digest_size=8).hexdigest()


def _imports(tree: ast.Module) -> list[str]:
    """List names that a module imports anywhere; for `from a import b` both a and a.b."""
    names: list[str] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names += [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
    return names
