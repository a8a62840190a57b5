"""Methods by name: those of the solver, and functions of other modules."""

import importlib
from collections.abc import Iterable

from solver.instrument.errors import InputError, described, quoted
from solver.methods import METHODS, Method


def check_known(names: Iterable[str], others: str = "") -> None:
    """Raise InputError for the first name that METHODS does not have; `others` are allowed too."""
    for name in names:
        if name not in METHODS:
            known = f"allowed is one of {', '.join(METHODS)}{others}"
            raise InputError(f"method {quoted(name)} is unknown, {known}")


def find_method(name: str) -> Method:
    """Return a method by its name in METHODS or as package.module:function. Raises InputError."""
    module, colon, function = name.partition(":")
    if not (module and colon and function):
        check_known([name], ", or package.module:function")
        return METHODS[name]
    try:
        attribute = getattr(importlib.import_module(module), function)
    except Exception as error:
        raise InputError(f"method '{name}' cannot be imported: {described(error)}") from error
    if not callable(attribute):
        raise InputError(f"method '{name}' is a {type(attribute).__name__}, allowed is a function")
    method: Method = attribute
    return method
