"""Copy a user's method, as Python sources alone, to where its process finds it."""

import ast
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

# What every process finds by itself. A copy of the solver would also be compiled anew.
_FOUND_ANYWAY: Final = sys.stdlib_module_names | {"solver", "vbaa_bench"}


def copy_sources(module: str, target: Path) -> None:
    """Copy a module and the neighbours that it imports into the folder `target`.

    Modules and packages are looked for in the current folder and on PYTHONPATH; those that are
    installed are not copied. Only `*.py` is copied: a dataset inside a package stays where it is.
    Raises OSError.
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
    """The place and the path of each source of a top-level module, as Python would choose them."""
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
    """Top-level names that a source imports; none where it is not Python."""
    try:
        tree = ast.parse(source.read_bytes())
    except (SyntaxError, ValueError, RecursionError, MemoryError):  # its own process says so
        return set()
    names = set[str]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module.partition(".")[0])
    return names
