"""Find methods, extractors and beams by name: ours, or package.module:function of others."""

import importlib
from collections.abc import Mapping
from typing import TypeVar, cast

from solver.instrument.errors import InputError, described, quoted

T = TypeVar("T")
ELSEWHERE = "package.module:function"


def find_by_name(kind: str, name: str, ours: Mapping[str, T]) -> T:
    """Return what has a name among `ours`, or a function of another module.

    Raises InputError, in which `kind` says what is looked for.
    """
    if name in ours:
        return ours[name]
    module, colon, function = name.partition(":")
    if not (module and colon and function):
        allowed = f"one of {', '.join(ours)}, or {ELSEWHERE}" if ours else ELSEWHERE
        raise InputError(f"{kind} {quoted(name)} is unknown, allowed is {allowed}")
    try:
        attribute = getattr(importlib.import_module(module), function)
    except Exception as error:
        raise InputError(f"{kind} '{name}' cannot be imported: {described(error)}") from error
    if not callable(attribute):
        raise InputError(
            f"{kind} '{name}' is of type {type(attribute).__name__}, allowed is a function"
        )
    return cast(T, attribute)
