"""A beam whose curvature is stated, against the integrated one: two roads to the same shape."""

import re
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from solver.beams.beam import BentBeam, Prior
from solver.beams.integrated import IntegratedBeam
from solver.beams.own_beam import Line, OwnBeam
from solver.fitting.beam_residuals import beam_residuals
from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import stated_shape
from solver.instrument.measurement import Measurement
from solver.methods.exact_fit import exact_fit
from tests.tapered import bent, measured

RADIUS = 0.01
# Load, place, friction ratio, two coefficients of the width, three of the bow.
SHAPES = {
    "gentle": np.array([1.2, 0.6, 0.1, -0.1, 0.02, 0.01, -0.02, 0.005]),
    "dragged back": np.array([1.5, 0.8, -0.2, 0.1, 0.0, 0.0, 0.01, 0.0]),
    "near the tip": np.array([0.5, 0.95, 0.0, -0.2, 0.05, 0.0, 0.0, 0.01]),
    "steep": np.array([4.0, 0.5, 0.3, -0.1, 0.02, 0.01, -0.02, 0.005]),
}


def both(p: Floats) -> tuple[BentBeam, BentBeam]:
    one, own = (beam.bent(p) for beam in (IntegratedBeam(2, 3, RADIUS), OwnBeam(2, 3, RADIUS)))
    assert one is not None
    assert own is not None
    return one, own


@pytest.mark.parametrize("p", SHAPES.values(), ids=SHAPES.keys())
def test_contact_and_moment_are_those_of_the_integrated_beam(p: Floats) -> None:
    one, own = both(p)
    assert own.contacts == pytest.approx(one.contacts, abs=1e-7)
    assert own.by_contacts == pytest.approx(one.by_contacts, abs=2e-6)
    assert own.moment == pytest.approx(one.moment, abs=1e-6)
    assert own.by_moment == pytest.approx(one.by_moment, abs=5e-6)


@pytest.mark.parametrize("p", SHAPES.values(), ids=SHAPES.keys())
def test_residuals_are_those_of_the_integrated_beam(p: Floats) -> None:
    one, _ = both(p)
    base = np.array([0.05, 1e-3, -1e-3, 0.02, 0.01])
    # Near the curve, as points of an image are.
    x = np.linspace(0.05, 0.95 * one.contacts[0, 2], 40)
    turn = base[3] + base[4] * one.moment
    u = one.curve.base[0] - x * np.cos(one.curve.base[2])
    order = np.argsort(one.curve.nodes[0])
    y = np.interp(u, one.curve.nodes[0][order], -one.curve.nodes[1][order]) + one.curve.base[1]
    points = np.vstack([x, x * turn + y, np.zeros(len(x)), np.full(len(x), 1e-2)])
    view, parameters, found = np.array([0.4, 0.0, 1.0]), np.append(p, base), []
    for beam in (IntegratedBeam(2, 3, RADIUS), OwnBeam(2, 3, RADIUS)):
        residual, jacobian = np.empty(len(x)), np.empty((len(parameters), len(x)))
        assert beam_residuals(beam, parameters, points, view, residual, jacobian)
        found.append((residual, jacobian))
    (residual, jacobian), (own_residual, own_jacobian) = found
    assert own_residual == pytest.approx(residual, abs=1e-3)
    assert own_jacobian == pytest.approx(jacobian, abs=5e-3 * float(np.abs(jacobian).max()))


def test_its_error_falls_with_the_fourth_power_of_its_steps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    p, errors = SHAPES["steep"], []
    exact, _ = both(p)
    for steps in (4, 8, 16):
        monkeypatch.setattr("solver.beams.own_beam._STEPS", steps)
        own = OwnBeam(2, 3, RADIUS).bent(p)
        assert own is not None
        errors.append(float(np.hypot(*(own.contacts - exact.contacts)[0, 2:4])))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 3).all(), orders


@pytest.mark.parametrize(
    "p", [[-0.1, 0.6, 0.0], [1.0, 1.2, 0.0], [1.0, 0.6, 20.0], [40.0, 0.9, 0.0]]
)
def test_a_shape_that_no_beam_has_is_none(p: list[float]) -> None:
    assert OwnBeam(0, 0, RADIUS).bent(np.array(p)) is None


class Sleeved(OwnBeam):
    """A beam with a sleeve over its first fifth, three times as stiff."""

    breaks = (0.2,)

    @property
    def prior(self) -> Mapping[str, Prior]:
        return {"sleeve": Prior(3.0, 0.3)}

    def stiffness(self, line: Line, p: Mapping[str, Floats]) -> Floats:
        return np.where(line.s < 0.2, p["sleeve"], 1.0)


@pytest.mark.parametrize("place", [0.15, 0.199, 0.3, 0.75])
def test_a_jump_of_the_stiffness_is_integrated_exactly(place: float) -> None:
    """Against a solver of initial value problems, from the contact back to the clamp."""
    q = 0.5 / place**2
    bent = Sleeved(0, 0, RADIUS).bent(np.array([q, place, 0.0, 3.0]))
    assert bent is not None

    def rates(t: float, state: Floats) -> list[float]:
        u, _, psi = state
        stiffness = 3.0 if place - t < 0.2 else 1.0
        return [float(np.cos(psi)), float(np.sin(psi)), float(q * u / stiffness)]

    ends = sorted({0.0, max(place - 0.2, 0.0), place})
    state = np.zeros(3)
    for begin, end in pairwise(ends):
        solution = solve_ivp(rates, (begin, end - 1e-12), state, rtol=1e-11, atol=1e-13)
        state = solution.y[:, -1]
    u, along, psi = state
    x, y = u * np.cos(psi) + along * np.sin(psi), u * np.sin(psi) - along * np.cos(psi)
    assert bent.contacts[0, 1:4] == pytest.approx([psi, x, y], abs=2e-7)
    # The moment at the clamp is that of the force, whatever the stiffness there.
    assert bent.moment == pytest.approx(q * u, rel=1e-6)


@pytest.mark.parametrize(
    ("prior", "message"),
    [
        ({"tilt": Prior(0.0, 1.0)}, "prior of 'tilt': the name is taken"),
        ({"errors": Prior(0.0, 1.0)}, "prior of 'errors': the name is taken"),
        ({"load": (0.0, 1.0)}, r"allowed is Prior\(mean, sigma\)"),
        ({"load": Prior(0.0, -1.0)}, "sigma >= 0"),
        ({"load": Prior(np.nan, 1.0)}, "allowed are numbers"),
    ],
)
def test_a_wrong_prior_is_a_sentence(prior: dict[str, Prior], message: str) -> None:
    class Wrong(OwnBeam):
        @property
        def prior(self) -> Mapping[str, Prior]:
            return prior

    with pytest.raises(ValueError, match=message):
        Wrong(0, 0, RADIUS).bent(np.array([1.0, 0.6, 0.0, 0.0]))


def test_a_curvature_of_another_shape_is_a_sentence() -> None:
    class Row(OwnBeam):
        def curvature(self, line: Line, p: Mapping[str, Floats]) -> Floats:
            return np.asarray(super().curvature(line, p)[0])

    with pytest.raises(ValueError, match=r"the curvature of Row has shape \(66,\), allowed is"):
        Row(0, 0, RADIUS).bent(np.array([1.0, 0.6, 0.0]))


def test_a_prior_that_an_image_contradicts_is_named(random: np.random.Generator) -> None:
    shape = stated_shape(taper=0.005, softness=0.0, section=0.0, friction=0.0)
    frame = measured(bent(0.0, 0.6, 0.6), shape, random)

    def sleeved(_: Measurement, beam: IntegratedBeam) -> OwnBeam:
        return Sleeved(beam.widths, beam.bow, beam.radius)

    estimate = exact_fit(frame, beam=sleeved)
    assert not estimate.values
    found = re.search(r"parameter 'sleeve': it is (\S+), its prior 3 \+- 0.3", estimate.message)
    assert found is not None, estimate.message
    assert float(found[1]) == pytest.approx(1.0, abs=0.2)


def test_what_makes_no_beam_is_a_sentence(random: np.random.Generator) -> None:
    frame = measured(bent(0.0, 0.6, 0.6), stated_shape(0.005, 0.0, 0.0, 0.0), random)
    with pytest.raises(TypeError, match="beam made a NoneType, allowed is a Beam"):
        exact_fit(frame, beam=lambda *_: None)  # type: ignore[arg-type]


@pytest.mark.parametrize("breaks", [(48.0,), (np.nan,), (-0.1, 0.2), 0.2])
def test_breaks_that_are_no_arc_lengths_are_refused(breaks: object) -> None:
    class Sleeve(OwnBeam):
        pass

    Sleeve.breaks = breaks  # type: ignore[assignment]
    with pytest.raises(ValueError, match="allowed is a tuple of arc lengths over the beam's"):
        _ = Sleeve(0, 0, 0.002).parameters
