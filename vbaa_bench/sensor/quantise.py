"""Quantisation: fractions of full scale -> gray values."""

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats, Grey

# 32 bits suffice: counts are exact up to 2^24, and half the memory doubles the speed.
Image = npt.NDArray[np.float32]


def full_scale(bits: int) -> int:
    """Return the largest gray value."""
    return int(2**bits - 1)


def quantise(share: Floats | Image, bits: int) -> Grey:
    """Round to gray values (h, w), clipped at 0 and full scale: uint8 for 8 bits, else uint16."""
    gray = np.rint(np.clip(share, 0.0, 1.0) * full_scale(bits))
    return np.asarray(gray, dtype=np.uint8 if bits == 8 else np.uint16)
