"""Calibrated rigs as files: what was learned once, to start with at once.

A file is NumPy's .npz: the arrays, and "tree", a text that names classes of this package, their
fields and values. Reading it runs no code of the file.
"""

import dataclasses
import importlib
import io
import json
import zipfile
import zlib
from enum import Enum
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.lib.format import read_array

from solver.instrument.errors import InputError, described
from solver.lab.writing import write

_PACKAGE: Final = "solver."
_TREE: Final = "tree"
# What NumPy, zipfile and json raise for a file that is damaged or none of theirs.
_UNREADABLE: Final = (
    OSError, ValueError, KeyError, EOFError, TypeError, RuntimeError, zipfile.BadZipFile,
    zlib.error,
)  # fmt: skip
# What a tree raises whose classes or fields this version does not have.
_OTHER_VERSION: Final = (
    AttributeError, ImportError, KeyError, TypeError, ValueError, RecursionError,
)  # fmt: skip


def save_tree(path: Path, root: object) -> None:
    """Write a tree of dataclasses and named tuples of this package. Raises InputError."""
    arrays: dict[str, Any] = {}
    text = json.dumps(_encoded(root, arrays))
    arrays[_TREE] = np.array(text)
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    write(path, stream.getvalue())


def load_tree(path: Path) -> Any:
    """Read what `save_tree` has written.

    Raises InputError if the file cannot be read, or is of another version of this package.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as archive:
            arrays = {
                name.removesuffix(".npy"): read_array(io.BytesIO(archive.read(name)))
                for name in archive.namelist()
            }
        tree = json.loads(str(arrays.pop(_TREE)))
    except _UNREADABLE as error:
        raise InputError(f"{path}: is not a saved rig ({described(error)})") from error
    try:
        return _decoded(tree, arrays)
    except _OTHER_VERSION as error:
        raise InputError(
            f"{path}: was saved by another version of the antenna, or is damaged: open the rig's "
            f"folder and save it again ({described(error)})"
        ) from error


def _encoded(one: object, arrays: dict[str, Any]) -> object:
    """Convert a value to what JSON can express; arrays are put into `arrays`."""
    if one is None or (isinstance(one, bool | int | float | str) and not isinstance(one, Enum)):
        return one
    if isinstance(one, np.ndarray | np.generic):
        name = f"array_{len(arrays)}"
        arrays[name] = np.asarray(one)
        return {"array": name}
    if isinstance(one, Enum):
        return {"class": _name(type(one)), "value": one.value}
    if dataclasses.is_dataclass(one):
        values = {field.name: getattr(one, field.name) for field in dataclasses.fields(one)}
    elif isinstance(one, tuple) and hasattr(one, "_fields"):
        values = dict(zip(one._fields, one, strict=True))
    elif isinstance(one, tuple | list):
        return {type(one).__name__: [_encoded(entry, arrays) for entry in one]}
    else:
        raise InputError(f"a {type(one).__name__} cannot be saved")
    fields = {name: _encoded(value, arrays) for name, value in values.items()}
    return {"class": _name(type(one)), "fields": fields}


def _decoded(tree: Any, arrays: dict[str, Any]) -> Any:
    """Convert back. Raises errors of many kinds for what this version does not have."""
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        array = arrays[tree["array"]]
        return array if array.ndim else array[()]
    for sequence in (tuple, list):
        if sequence.__name__ in tree:
            return sequence(_decoded(entry, arrays) for entry in tree[sequence.__name__])
    cls = _class_of(tree["class"])
    if "value" in tree:
        return cls(tree["value"])
    stated = {name: _decoded(value, arrays) for name, value in tree["fields"].items()}
    names = getattr(cls, "_fields", None) or [field.name for field in dataclasses.fields(cls)]
    if set(names) != set(stated):
        raise ValueError(f"{cls.__name__} has other fields")
    return cls(**stated)


def _name(cls: type) -> str:
    if not cls.__module__.startswith(_PACKAGE) or "." in cls.__qualname__:
        raise InputError(f"a {cls.__qualname__} of {cls.__module__} cannot be saved")
    return f"{cls.__module__}:{cls.__qualname__}"


def _class_of(name: str) -> Any:
    """Return a dataclass, named tuple or enumeration of this package by its name."""
    module, _, qualname = name.partition(":")
    if not module.startswith(_PACKAGE) or module.endswith("__main__"):
        raise ValueError(f"{module} is not a module of this package")
    found = getattr(importlib.import_module(module), qualname)
    plain = isinstance(found, type) and (
        dataclasses.is_dataclass(found) or issubclass(found, tuple | Enum)
    )
    if not plain or found.__module__ != module:
        raise ValueError(f"{name} is no plain class")
    return found
