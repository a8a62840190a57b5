"""Copy the Python sources of a user's method to a folder on the import path of its process."""

import ast
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

# Modules that every process can import. A copy of the solver would also be compiled anew.
_NOT_COPIED: Final = sys.stdlib_module_names | {"solver", "vbaa_bench"}
# The folder, beside the observations, to which a user's own sources are copied.
SOURCES: Final = "method"


def import_from(sources: Path) -> None:
    """Import from this folder first, in this process and in those that it starts."""
    sys.path.insert(0, str(sources))
    os.environ["PYTHONPATH"] = str(sources)


def copy_sources(module: str, target: Path) -> None:
    """Copy a module and the local modules that it imports into the folder `target`.

    Modules and packages are searched in the current folder and on PYTHONPATH; installed ones are
    not copied. Only `*.py` files are copied: a dataset inside a package is not. Raises OSError.
    """
    python_path = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    folders = [Path.cwd(), *(Path(name) for name in python_path if name)]
    done: set[str] = set()
    pending = {module.partition(".")[0]}
    while pending:
        name = pending.pop()
        done.add(name)
        for folder, source in _sources(name, folders):
            copy = target / source.relative_to(folder)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copy)
            pending |= _imported(copy) - done - _NOT_COPIED


def _sources(name: str, roots: list[Path]) -> Iterator[tuple[Path, Path]]:
    """Yield the folder and path of each source of a top-level module, by Python's import order."""
    if not name.isidentifier():
        return
    for root in roots:
        package, module = root / name, root / f"{name}.py"
        if module.is_file() and not (package / "__init__.py").is_file():
            yield root, module
            return
        if package.is_dir():
            for folder, folders, files in os.walk(package):
                folders[:] = [
                    entry for entry in folders if not entry.startswith((".", "__pycache__"))
                ]
                yield from ((root, Path(folder, entry)) for entry in files if entry.endswith(".py"))
            return


def _imported(source: Path) -> set[str]:
    """Find the top-level names that a source imports; return none if it is not valid Python."""
    try:
        tree = ast.parse(source.read_bytes())
    except (SyntaxError, ValueError, RecursionError, MemoryError):  # its own process reports this
        return set()
    names = set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module.partition(".")[0])
    return names
