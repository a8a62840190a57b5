"""Arrays of Dr.Jit from arrays of NumPy, and indices of their values."""

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


def index_of(place: Any, count: int) -> Any:
    """Round places (Dr.Jit) down to indices of an array of `count` values.

    Places beyond an end of the array have the index of that end, and NaN has the index 0. `dr.clip`
    lets NaN pass; the conversion to an integer then gives an index far outside of the array.
    """
    return mi.UInt32(dr.select(place > 0, dr.minimum(place, count - 1), 0))
