"""The simple model: exact where it holds; where it does not, as fitted on another road."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from solver.instrument.arrays import Floats
from tests.vbaa_bench.limits.experiments import push
from vbaa_bench.limits.frame_limits import FrameLimits
from vbaa_bench.limits.profile import SHIFT
from vbaa_bench.limits.simple_model import SimpleFit
from vbaa_bench.mechanics.loaded import Load, loaded
from vbaa_bench.render.variant import activate

PEG = {"kind": "peg", "friction": 0.4}
TIGHT = {
    "beam_length_mm": 0,
    "flexural_rigidity_pct": 0,
    "base_mm": 1e-9,
    "board_mm": 1e-9,
    "board_deg": 1e-9,
}


@pytest.fixture(autouse=True)
def _active(variant: str) -> None:
    activate(variant, 1)


def test_where_it_holds_it_has_no_bias_and_attains_the_limit() -> None:
    frame = push(tolerances={"true_rig": "drawn"})[1]
    fit = SimpleFit(frame, planar=True)
    assert not fit.is_needed
    result, limits = fit.result(), dict(frame.by_set())["planar"]
    assert np.abs(result.bias[:2]).max() < 1e-9
    np.testing.assert_allclose(result.sigmas[:3], limits[:3], rtol=1e-3)


def nearest(frame: FrameLimits) -> Floats:
    """Fit place and force of a frictionless beam to the true line across plane C, independently.

    With a rig that is known the image is a map of plane C, and the noise is even along the beam.
    """
    true = frame.imaged.beam.centreline
    arc = np.linspace(0.0, true[-1, 0], 400)
    weights = frame.rig.of_places(frame.imaged, frame.pose.state, frame.visible).of_length
    across = np.sqrt(np.interp(arc, true[1:-1, 0], weights[:, SHIFT, SHIFT]))

    def residuals(unknown: Floats) -> Floats:
        line = loaded(frame.imaged.rod, [Load(unknown[0] * 0.1, unknown[1])], arc).centreline
        y = np.interp(line[:, 1], true[:, 1], true[:, 2])
        slope = np.gradient(line[:, 2], line[:, 1])
        # Beyond the true tip the line is straight, as the beam is beyond its contact.
        beyond = line[:, 1] > true[-1, 1]
        end = (true[-1, 2] - true[-2, 2]) / (true[-1, 1] - true[-2, 1])
        y = np.where(beyond, true[-1, 2] + end * (line[:, 1] - true[-1, 1]), y)
        return np.asarray(across * (y - line[:, 2]) / np.hypot(1.0, slope))

    first = frame.imaged.loads[0]
    return np.asarray(least_squares(residuals, [first.s / 0.1, first.normal_force], xtol=1e-12).x)


@pytest.mark.thorough
def test_its_bias_under_friction_is_that_of_an_independent_fit() -> None:
    frame = push(object=PEG, tolerances=TIGHT)[1]
    fit = SimpleFit(frame, planar=True)
    assert fit.is_needed
    place, force = nearest(frame)
    load, bias = frame.imaged.loads[0], fit.result().bias
    assert bias[1] == pytest.approx(place * 0.1 - load.s, rel=0.05)
    size = float(np.linalg.norm(frame.pose.state.contact.force))
    assert bias[2] == pytest.approx(force - size, rel=0.02)
    # The bias is far beyond rounding, and grows with the friction.
    assert abs(bias[2]) > 0.005 * size


@pytest.mark.thorough
def test_a_taper_biases_the_contact_by_millimetres() -> None:
    frame = push(beam={"tip_ratio": 0.8})[1]
    fit = SimpleFit(frame, planar=True)
    assert fit.is_needed
    result = fit.result()
    assert abs(result.bias[0]) > 20 * result.sigmas[0]
