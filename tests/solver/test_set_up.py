"""What a refused calibration says of the cause."""

from collections.abc import Iterable
from dataclasses import replace

import pytest

from solver.antenna import Antenna
from solver.calibrate.calibration import Calibration, Stretch
from solver.instrument.arrays import Grey
from solver.instrument.errors import InputError
from solver.instrument.observation import Observations
from solver.instrument.rig import Rig
from solver.set_up import MOST_COEFFICIENTS, set_up


@pytest.mark.parametrize(
    ("with_most", "stretch", "sentence"),
    [
        (0.05, None, "the lens distorts as a fisheye"),
        (1.5, None, "coefficients describe the lens's distortion"),
        (1.5, Stretch(0.02, 1e-4), "2.00 .* % taller than wide"),
    ],
)
def test_a_poor_fit_of_the_board_names_its_cause(
    observations: Observations,
    antenna: Antenna,
    monkeypatch: pytest.MonkeyPatch,
    with_most: float,
    stretch: Stretch | None,
    sentence: str,
) -> None:
    def calibrated(_views: Iterable[Grey], rig: Rig, _turns: int = 0) -> Calibration:
        fits = rig.distortion_coefficients == MOST_COEFFICIENTS
        error = with_most if fits else 1.5
        return replace(antenna.calibration, reprojection_px=error, stretch=stretch)

    monkeypatch.setattr("solver.set_up.calibrate", calibrated)
    with pytest.raises(InputError, match=sentence):
        set_up(observations)
