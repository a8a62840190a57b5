"""Estimates do not depend on the processor: only last digits differ, far below the sigmas."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from solver.antenna import Antenna
from solver.instrument.observation import Observations, open_observations
from solver.methods import METHODS
from solver.set_up import set_up
from solver.tracker import PushTracker

ROOT = Path(__file__).parents[2]
METHOD = "exact_fit"
# The oldest kernels of OpenBLAS, NumPy and Numba that run on every x86-64. Elsewhere these names
# are unknown and change nothing. `make oldest` runs all tests with them.
OLDEST = {
    "OPENBLAS_CORETYPE": "Prescott",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",
    "NUMBA_CPU_NAME": "x86-64",
}


def other_kernels() -> dict[str, str]:
    """Return an environment with other kernels than those of this process.

    Numba would compile for half a minute: its kernels differ only where these tests run with them.
    """
    if os.environ.get("NUMBA_CPU_NAME") == OLDEST["NUMBA_CPU_NAME"]:
        return {name: value for name, value in os.environ.items() if name not in OLDEST}
    return {**os.environ, **{name: OLDEST[name] for name in OLDEST if "NUMBA" not in name}}


def estimates(antenna: Antenna, observations: Observations) -> list[list[float]]:
    """Estimate x_c and the force of every frame; each with its sigma."""
    tracker, rows = PushTracker(antenna, METHODS[METHOD]), []
    for frame in observations:
        estimate = tracker.solve(frame.image(), frame.readings, frame.push_id).estimate
        assert estimate.covariance is not None
        sigmas = np.sqrt(np.diag(estimate.covariance))
        rows.append([*(float(v) for v in estimate.values.values()), *map(float, sigmas)])
    return rows


def estimates_of(dataset: str) -> str:
    """Estimate as above, in another process."""
    observations = open_observations(Path(dataset) / "observations")
    return json.dumps(estimates(set_up(observations), observations))


@pytest.mark.thorough
def test_estimates_are_the_same_with_other_kernels(
    observations: Observations, antenna: Antenna, dataset: Path
) -> None:
    code = f"from {__name__} import estimates_of; print(estimates_of({str(dataset)!r}))"
    child = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        cwd=ROOT,
        env=other_kernels(),
        capture_output=True,
        text=True,
        check=True,
    )
    here = np.array(estimates(antenna, observations))
    there = np.array(json.loads(child.stdout.splitlines()[-1]))
    values, sigmas = np.split(here, 2, axis=1)
    # 6e-10 sigmas were measured. What rounding changes must stay far below what noise does.
    assert np.abs((there[:, : values.shape[1]] - values) / sigmas).max() < 1e-6
    assert there[:, values.shape[1] :] == pytest.approx(sigmas, rel=1e-6)
