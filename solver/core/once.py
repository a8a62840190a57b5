"""Compute once what depends on one object and a setting alone, and keep it with the object."""

import dataclasses
import functools
from collections.abc import Callable
from typing import Any, TypeVar

One = TypeVar("One")
Result = TypeVar("Result")


def once(function: Callable[[One, Any], Result]) -> Callable[[One, Any], Result]:
    """Keep the results of a function of an object and a setting, which must not change.

    They are kept in the object, by the identity of the setting: neither needs a hash.
    """

    @functools.wraps(function)
    def kept_result(one: One, setting: Any) -> Result:
        kept: list[tuple[object, object, Any]] = vars(one).setdefault("_kept", [])
        for known, known_setting, result in kept:
            if known is function and known_setting is setting:
                found: Result = result
                return found
        result = function(one, setting)
        kept.append((function, setting, result))
        return result

    return kept_result


def copied(one: One, **changes: Any) -> One:
    """Return a copy of a dataclass with other fields, on which its kept results do not depend."""
    copy: One = dataclasses.replace(one, **changes)  # type: ignore[type-var]  # of any dataclass
    if "_kept" in vars(one):
        vars(copy)["_kept"] = vars(one)["_kept"]
    return copy
