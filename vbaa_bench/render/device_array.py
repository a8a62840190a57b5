"""Arrays of Dr.Jit from arrays of NumPy."""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from vbaa_bench.render.variant import is_scalar


def device_array(values: Floats) -> Any:
    """Convert an array to single precision, row by row, in memory of Dr.Jit.

    Dr.Jit uses the memory of an array of single precision as it is. Its alignment is random, and
    for each alignment of its arguments a frozen function is recorded anew.
    """
    if is_scalar():
        return np.ravel(values).astype(np.float32)
    array = mi.Float(mi.Float64(np.ravel(values)))
    dr.eval(array)
    return array
