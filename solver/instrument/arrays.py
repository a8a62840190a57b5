"""Array types, read-only arrays of frozen dataclasses, and a copy in compiled code."""

import numpy as np
import numpy.typing as npt

from solver.instrument.compiled import njit

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Mask = npt.NDArray[np.bool_]
# Gray images of 8 bits, or of up to 16 bits.
Grey = npt.NDArray[np.uint8 | np.uint16]


def freeze(owner: object, name: str, shape: tuple[int | None, ...], label: str = "") -> Floats:
    """Replace an array of a frozen dataclass by a read-only float64 copy; return the copy.

    None in `shape` allows any length. Raises ValueError, which names the array or its `label`, if
    the shape differs or a value is not finite.
    """
    array = np.array(getattr(owner, name), dtype=np.float64)
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(n not in (None, actual) for n, actual in zip(shape, array.shape, strict=True))
    ):
        allowed = tuple("any" if n is None else n for n in shape)
        raise ValueError(f"{label or name} has shape {array.shape}, allowed is {allowed}")
    if not _finite(array.ravel("K")):
        raise ValueError(f"{label or name} holds a value that is not finite")
    array.setflags(write=False)
    object.__setattr__(owner, name, array)
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
