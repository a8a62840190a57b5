"""Methods by name: those of the solver, and functions of other modules."""

import importlib

from solver.instrument.errors import InputError, described
from solver.methods import METHODS, Method


def find_method(name: str) -> Method:
    """Return a method by its name in METHODS or as package.module:function. Raises InputError."""
    if name in METHODS:
        return METHODS[name]
    module, colon, function = name.partition(":")
    if not (module and colon and function):
        raise InputError(
            f"method '{name}' is unknown, allowed is one of {', '.join(METHODS)}, "
            "or package.module:function"
        )
    try:
        attribute = getattr(importlib.import_module(module), function)
    except Exception as error:
        raise InputError(f"method '{name}' cannot be imported: {described(error)}") from error
    if not callable(attribute):
        raise InputError(f"method '{name}' is a {type(attribute).__name__}, allowed is a function")
    method: Method = attribute
    return method
