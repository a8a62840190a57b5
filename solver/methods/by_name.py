"""Methods by name, and beams of a user's own for them."""

import inspect
from collections.abc import Callable, Iterable
from functools import partial

from solver.fitting.frame_problem import OwnBeamOf
from solver.instrument.by_name import find_by_name
from solver.instrument.errors import InputError, quoted
from solver.instrument.estimate import Estimate
from solver.methods import METHODS, Method


def check_known(names: Iterable[str], others: str = "") -> None:
    """Raise InputError for the first name that METHODS does not have; `others` are allowed too."""
    for name in names:
        if name not in METHODS:
            known = f"allowed is one of {', '.join(METHODS)}{others}"
            raise InputError(f"method {quoted(name)} is unknown, {known}")


def find_method(name: str) -> Method:
    """Return a method by its name in METHODS or as package.module:function. Raises InputError."""
    return find_by_name("method", name, METHODS)


def with_beam(method: Method, beam: str | OwnBeamOf | None) -> Method:
    """Return a method that fits a beam of the user's own: a function, or package.module:function.

    None leaves the method as it is. Raises InputError for a name that is none, and for a method
    that has no argument `beam`.
    """
    if beam is None:
        return method
    own_beam: OwnBeamOf = find_by_name("beam", beam, {}) if isinstance(beam, str) else beam
    if not callable(own_beam):
        raise InputError(
            f"beam is a {type(beam).__name__}, allowed is a function of (measurement, beam)"
        )
    if not _takes_beam(method):
        able = ", ".join(name for name, one in METHODS.items() if _takes_beam(one))
        raise InputError(
            f"the method has no argument beam, allowed is one of {able}, or a function with it"
        )
    fit: Callable[..., Estimate] = method
    return partial(fit, beam=own_beam)


def _takes_beam(method: Method) -> bool:
    return "beam" in inspect.signature(method).parameters
