"""Calibrations are computed anew: that they repeat to the last bit is tested here."""

from collections.abc import Iterator

import pytest

from solver import calibrate
from tests.solver.conftest import DETECT_BOARD


@pytest.fixture(scope="module", autouse=True)
def _computed_anew() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibrate, "detect_board", DETECT_BOARD)
        yield
