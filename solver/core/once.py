"""Compute once what depends on one object alone, and keep it as long as the object exists."""

import functools
import weakref
from collections.abc import Callable, Hashable
from typing import Any, TypeVar

One = TypeVar("One")
Result = TypeVar("Result")


def once(function: Callable[[One, Any], Result]) -> Callable[[One, Any], Result]:
    """Keep the results of a function of an object, whose arrays have no hash, and a setting.

    Results are kept by the object's identity, and dropped with it.
    """
    kept: dict[tuple[int, Hashable], Result] = {}

    @functools.wraps(function)
    def kept_result(one: One, setting: Any = None) -> Result:
        key = (id(one), setting)
        if key not in kept:
            kept[key] = function(one, setting)
            weakref.finalize(one, kept.pop, key, None)
        return kept[key]

    return kept_result
