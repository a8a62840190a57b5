"""Copy the Python sources of a user's method to a folder on the import path of its process."""

import ast
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

# Modules that every process can import. A copy of the solver would also be compiled anew.
_FOUND_ANYWAY: Final = sys.stdlib_module_names | {"solver", "vbaa_bench"}


def copy_sources(module: str, target: Path) -> None:
    """Copy a module and the local modules that it imports into the folder `target`.

    Modules and packages are searched in the current folder and on PYTHONPATH; installed ones are
    not copied. Only `*.py` files are copied: a dataset inside a package is not. Raises OSError.
    """
    elsewhere = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    places = [Path.cwd(), *(Path(name) for name in elsewhere if name)]
    done: set[str] = set()
    open_names = {module.partition(".")[0]}
    while open_names:
        name = open_names.pop()
        done.add(name)
        for place, source in _sources(name, places):
            copy = target / source.relative_to(place)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, copy)
            open_names |= _imported(copy) - done - _FOUND_ANYWAY


def _sources(name: str, places: list[Path]) -> Iterator[tuple[Path, Path]]:
    """Yield the folder and path of each source of a top-level module, by Python's import order."""
    if not name.isidentifier():
        return
    for place in places:
        package, module = place / name, place / f"{name}.py"
        if module.is_file() and not (package / "__init__.py").is_file():
            yield place, module
            return
        if package.is_dir():
            for folder, folders, files in os.walk(package):
                folders[:] = [one for one in folders if not one.startswith((".", "__pycache__"))]
                yield from ((place, Path(folder, one)) for one in files if one.endswith(".py"))
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
