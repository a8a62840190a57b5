"""Shares of full scale -> gray values of so many bits."""

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, Grey

# Electrons need no more: counts are exact up to 2^24, and half the memory is twice the speed.
Image = npt.NDArray[np.float32]


def full_scale(bits: int) -> int:
    """The largest gray value."""
    return int(2**bits - 1)


def quantise(share: Floats | Image, bits: int) -> Grey:
    """Rounded gray values (h, w), cut at 0 and full scale: uint8 of 8 bits, uint16 of more."""
    gray = np.rint(np.clip(share, 0.0, 1.0) * full_scale(bits))
    return np.asarray(gray, dtype=np.uint8 if bits == 8 else np.uint16)
