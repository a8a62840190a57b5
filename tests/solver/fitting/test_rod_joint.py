"""The covariance of a joint fit whose frames leave nothing of a shared parameter's information."""

import numpy as np
import pytest

from solver.fitting.rod_joint import _covariance, _System


def test_a_direction_that_the_frames_absorb_has_a_large_variance() -> None:
    # The second shared parameter is absorbed by the frame's own, but for rounding below zero.
    own = np.array([[[0.1 + 0.2]]])
    mixed = np.array([[[0.0, 0.3]]])
    shared = np.diag([4.0, 0.3])
    assert shared[1, 1] - mixed[0, 0, 1] ** 2 / own[0, 0, 0] < 1e-15
    at = _System(np.zeros((1, 3)), 0.0, own, mixed, shared, np.zeros((1, 1)), np.zeros(2))
    covariance = _covariance(at)
    assert covariance[0, 0] == pytest.approx(0.25)
    assert covariance[1, 1] > 1e10
    assert np.linalg.eigvalsh(covariance).min() > 0
