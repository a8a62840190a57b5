"""The reference kernel. See test_score for its column in the predictions of a method."""

import numpy as np
import pytest

from vbaa_bench.scoring.isolation import reference_kernel


def test_the_kernel_does_a_fixed_amount_of_work() -> None:
    memory = np.array([1.0, -2.0, 3.0])
    expected = np.exp(-9) + 2 * np.exp(-1) - 8
    assert reference_kernel._scattered_pass(memory, np.array([2, 0, 1, 0])) == pytest.approx(
        expected
    )
    small, matrix = reference_kernel._SMALL, reference_kernel._MATRIX
    roots = [np.sqrt(small**2 + n) for n in range(60)]
    # Least squares return the first column plus a constant, which the last column is.
    solved = sum(1.0 for n in range(0, 60, 10))
    total = sum(r.sum() + (r > r.mean()).sum() for r in roots) + solved
    assert reference_kernel._small_calls(small, matrix) == pytest.approx(total)
