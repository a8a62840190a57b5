"""Users' modules, which add kinds to the families of a scene.

A module is one file of Python. It is used only where a command or a program names it: a scene, a
dataset and its records never load code. The digest of its code belongs to the identity of a dataset
whose scene has or may draw a kind of it. Worker processes get its source with their first job.
"""

import ast
import sys
import types
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.files import read_regular
from solver.instrument.syntax import syntax_digest
from vbaa_bench.scene.families import MODULES_IN_USE, module_of, rebuild
from vbaa_bench.scene.files import leaves, name_of
from vbaa_bench.scene.schema import Scene


@dataclass(frozen=True)
class UserModule:
    """A module in use: its name, and the source that was run."""

    name: str
    source: bytes

    @property
    def digest(self) -> str:
        """Digest of its code, which layout, comments and docstrings do not change."""
        return syntax_digest(ast.parse(self.source))

    def __reduce__(self) -> tuple[Any, ...]:
        # Where it is unpickled, it is used, too.
        return _used, (self.name, self.source, f"{self.name}.py")


_IN_USE: Final = dict[str, UserModule]()


def use_module(name: str) -> None:
    """Use the kinds of a module, in this process and in those that it starts.

    The module is NAME.py in the current folder or on Python's path. Raises InputError if there is
    none, or it cannot be imported.
    """
    folders = [Path.cwd(), *map(Path, sys.path)] if name.isidentifier() else []
    path = next((path for folder in folders if (path := folder / f"{name}.py").is_file()), None)
    if path is None:
        raise InputError(
            f"module {quoted(name)} is unknown, allowed is the name of a file here or on Python's "
            "path, without its .py"
        )
    other = sys.modules.get(name)
    if name not in _IN_USE and other is not None and getattr(other, "__file__", "") != str(path):
        raise InputError(f"module {name}: has the name of another module, allowed is any other")
    try:
        source = read_regular(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    _used(name, source, str(path))


def modules_in_use() -> tuple[UserModule, ...]:
    """Return the modules in use. Another process unpickles them before all that needs them."""
    return tuple(_IN_USE.values())


def module_digests(tree: Any) -> dict[str, str]:
    """Compute the digests of the modules whose kinds a scene's values have or may draw, by name."""
    names = {
        module_of(model, name_of(leaf.key), leaf.value)
        for leaf in leaves(tree, Scene)
        for model in leaf.models
    }
    return {name: _IN_USE[name].digest for name in sorted(_IN_USE.keys() & names)}


def _used(name: str, source: bytes, path: str) -> UserModule:
    """Run the source of a module, and allow its kinds in scenes. Raises InputError."""
    if (used := UserModule(name, source)) == _IN_USE.get(name):
        return used
    module, before = types.ModuleType(name), sys.modules.get(name)
    module.__file__ = path
    sys.modules[name] = module  # pickle and pydantic look there for the names in it
    try:
        exec(compile(source, path, "exec"), vars(module))
    except Exception as error:
        del sys.modules[name]
        if before is not None:
            sys.modules[name] = before
        reason = f"{type(error).__name__}: {truncated(str(error))}"
        raise InputError(f"{path}: cannot be imported ({reason})") from error
    MODULES_IN_USE.add(name)
    _IN_USE[name] = used
    rebuild(Scene)
    return used
