"""Arrays are checked once, at the door, and cannot be written to afterwards."""

from typing import Any

import numpy as np
import numpy.typing as npt

from solver.instrument.compiled import njit

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
# Of 8 bits, or of up to 16.
Grey = npt.NDArray[np.uint8 | np.uint16]


def frozen_floats(name: str, values: Any, shape: tuple[int | None, ...]) -> Floats:
    """A finite, read-only float64 copy of `values`; None in `shape` allows any length.

    Raises ValueError where shape or finiteness fail.
    """
    array = np.array(values, dtype=np.float64)
    if len(array.shape) != len(shape) or any(
        want is not None and have != want for have, want in zip(array.shape, shape, strict=True)
    ):
        wanted = tuple("any" if n is None else n for n in shape)
        raise ValueError(f"{name} has shape {array.shape}, allowed is {wanted}")
    if not _finite(array.ravel("K")):
        raise ValueError(f"{name} holds a value that is not finite")
    array.setflags(write=False)
    return array


@njit(cache=True)
def _finite(values: Floats) -> bool:
    """Whether all of values (n,) are; compiled, for calls of numpy take longer than a few do."""
    return bool(np.isfinite(values).all())
