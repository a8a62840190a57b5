import numpy as np
import pytest

from solver.centreline.area_weighted import area_weighted
from solver.instrument.arrays import Floats


def line(rows: Floats, width: float) -> Floats:
    """Cover (64, n) of a line of `width` px about `rows` (n,), between 0 and 1."""
    v = np.arange(64)[:, None]
    low = np.maximum(rows - width / 2, v - 0.5)
    high = np.minimum(rows + width / 2, v + 0.5)
    return np.asarray(np.clip(high - low, 0, 1))


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_deep_image_has_the_centreline_of_the_shallow_one(
    bits: int, noise: float, random: np.random.Generator
) -> None:
    rows = 20 + 0.07 * np.arange(200.0)
    share = np.clip(0.05 + 0.65 * line(rows, 1.6) + noise * random.standard_normal((64, 200)), 0, 1)
    deep = area_weighted(np.rint((2**bits - 1) * share).astype(np.uint16))
    shallow = area_weighted(np.rint(255 * share).astype(np.uint8))
    assert (deep.points[:, 0] == shallow.points[:, 0]).all()
    # Rounding errs by 0.3 of 166 gray values in each of some three pixels, 1.5 rows off at most;
    # a pixel that rounding moves across the threshold carries a quarter of the contrast at most.
    apart = np.abs(deep.points[:, 1] - shallow.points[:, 1])
    assert np.median(apart) < 0.003
    assert np.quantile(apart, 0.97) < 0.012
    assert deep.sigma == pytest.approx(shallow.sigma, rel=0.15 if noise else 0.5)
