"""Which columns look like the beam at rest, by how well the profile fits them."""

import numpy as np
import numpy.typing as npt

from solver.centreline.flags import FOREIGN, HIDDEN, Expected, flag_columns
from solver.centreline.profile_fit import Fits
from solver.instrument.arrays import Floats

COLUMNS, END = 300, 260


def flagged(misfit: Floats) -> npt.NDArray[np.uint8]:
    """Flag columns of these misfits (n,), of a beam that ends at the column END."""
    there, ones = np.arange(COLUMNS) < END, np.ones(COLUMNS)
    fits = Fits(
        centre=np.zeros(COLUMNS),
        sigma=np.where(there, 0.01, 2.0),
        amplitude=np.where(there, 100.0, 0.1),
        amplitude_sigma=ones,
        background=10 * ones,
        chi2=10 * np.where(there, misfit, 1.0),
        dof=np.full(COLUMNS, 10),
        saturated=np.zeros(COLUMNS, np.int64),
    )
    *_, flags = flag_columns(fits, Expected(100 * ones, 100 * ones, 0.0), 1.0, 0.0, False)
    return np.asarray(flags)


def test_a_beam_that_comes_nearer_to_the_camera_is_followed_to_its_tip() -> None:
    # It looks ever wider, where the pixels show it: in ten of fifteen columns.
    column = np.arange(COLUMNS)
    flags = flagged(1 + 6 * (column / END) ** 2 * (column % 15 < 10))
    assert (flags[:END] == 0).all()
    assert (flags[END:] == HIDDEN).all()


def test_a_clamp_at_the_end_is_foreign() -> None:
    misfit = np.ones(COLUMNS)
    misfit[END - 30 : END] = 80.0
    assert (flagged(misfit)[END - 30 : END] == FOREIGN).all()
