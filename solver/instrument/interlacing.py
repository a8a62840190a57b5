"""Detection of interlaced images, whose even and odd rows are of two moments."""

from typing import Final

import numpy as np

from solver.instrument.arrays import Grey
from solver.instrument.medians import SIGMA_OVER_MAD

# Differences of neighbouring rows that count, in their robust scatter. Derived: noise alone exceeds
# it in three successive ones less than once in 10^18.
_SIGMAS: Final = 5.0
# Least share of the large differences that alternate. Measured: up to 0.006 in 240 rendered images
# of boards and beams, from 0.06 on where the image moves by two pixels or the beam by more between
# two fields. A strongly sharpened line, with flanks of the opposite sign, alternates too.
_MIN_SHARE: Final = 0.03


def rows_alternate(image: Grey) -> bool:
    """Return whether edges in an image (height, width) go up and down from row to row."""
    if min(image.shape) < 4:
        return False
    steps = np.diff(image.astype(np.float32), axis=0)
    scatter = SIGMA_OVER_MAD * float(np.median(np.abs(steps))) + 1.0  # the second for rounding
    large = np.where(np.abs(steps) > _SIGMAS * scatter, np.sign(steps), 0)
    alternating = (large[:-2] * large[1:-1] < 0) & (large[1:-1] * large[2:] < 0)
    # At least as if a hundred were large: a few pixels decide nothing.
    n_large = max(int(np.count_nonzero(large)), 100)
    return int(np.count_nonzero(alternating)) > _MIN_SHARE * n_large
