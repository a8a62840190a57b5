"""The small dataset as a laboratory has it."""

from pathlib import Path

import pytest

from solver.antenna import Antenna
from solver.instrument.observation import Observations, open_observations
from solver.set_up import set_up


@pytest.fixture(scope="module")
def observations(dataset: Path) -> Observations:
    return open_observations(dataset / "observations")


@pytest.fixture(scope="module")
def antenna(observations: Observations) -> Antenna:
    return set_up(observations)
