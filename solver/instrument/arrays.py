"""Array types, a check that returns a read-only copy of an array, and a copy in compiled code."""

from typing import Any

import numpy as np
import numpy.typing as npt

from solver.instrument.compiled import njit

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Mask = npt.NDArray[np.bool_]
# Gray images of 8 bits, or of up to 16 bits.
Grey = npt.NDArray[np.uint8 | np.uint16]


def frozen_floats(name: str, values: Any, shape: tuple[int | None, ...]) -> Floats:
    """Return a read-only float64 copy of `values`; None in `shape` allows any length.

    Raises ValueError if the shape differs or a value is not finite.
    """
    array = np.array(values, dtype=np.float64)
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(n not in (None, actual) for n, actual in zip(shape, array.shape, strict=True))
    ):
        allowed = tuple("any" if n is None else n for n in shape)
        raise ValueError(f"{name} has shape {array.shape}, allowed is {allowed}")
    if not _finite(array.ravel("K")):
        raise ValueError(f"{name} holds a value that is not finite")
    array.setflags(write=False)
    return array


@njit
def _finite(values: Floats) -> bool:
    """Return whether all values (n,) are finite; compiled: NumPy is slower on short arrays."""
    return bool(np.isfinite(values).all())


@njit
def copy_into(target: Floats, source: Floats) -> None:
    """Copy an array to another of the same shape, in compiled code.

    Assignment to a slice would compile numba's message for arrays of unequal shape: 2 s.
    """
    for i in range(target.size):
        target.flat[i] = source.flat[i]
