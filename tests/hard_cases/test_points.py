"""What must not change an estimate: rounding, order, units, a mirror, where the clamp stands."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement
from solver.methods import METHODS
from solver.tracker import run_method
from tests.hard_cases.beams import (
    REFERENCES,
    TURNED,
    largest_change,
    mirrored,
    moved,
    rescaled,
    with_points,
)
from tests.simulated import BEAM

NAMES = sorted(METHODS)
# Methods that average pairs may gain or lose one that stands on the edge of being valid: one of
# some 50,000 moves the mean by up to 2e-5 of L.
PAIR = 2e-5
PAIRED = {"two_point", "three_point", "moment_sensor", "stiffness"}
ANSWERS: dict[tuple[str, str], Estimate] = {}


def answer(reference: str, name: str) -> Estimate:
    """A method's answer to one of the references, computed once."""
    if (reference, name) not in ANSWERS:
        ANSWERS[reference, name] = run_method(METHODS[name], REFERENCES[reference])
    return ANSWERS[reference, name]


def change(name: str, reference: str, other: Measurement) -> float:
    """The largest change of any value of a method's answer, in L, EI / L^2 and radians."""
    given_now = run_method(METHODS[name], other)
    return largest_change(answer(reference, name), given_now, BEAM, other.rig.beam)


def test_every_method_answers_one_of_the_references() -> None:
    # Else nothing below would be tested.
    for name in METHODS:
        assert any(answer(reference, name).values for reference in REFERENCES), name


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("name", NAMES)
def test_the_last_bit_of_the_points_does_not_matter(
    name: str, reference: str, random: np.random.Generator
) -> None:
    measurement = REFERENCES[reference]
    for _ in range(2):
        towards = np.where(random.random(measurement.points.shape) < 0.5, -np.inf, np.inf)
        nudged = with_points(measurement, np.nextafter(measurement.points, towards))
        allowed = PAIR if name in PAIRED else 1e-9
        assert change(name, reference, nudged) < allowed


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("name", NAMES)
def test_points_of_single_precision_do(name: str, reference: str) -> None:
    # 24 bits of 0.24 m are 15 nm, a two-thousandth of the noise.
    measurement = REFERENCES[reference]
    single = with_points(measurement, measurement.points.astype(np.float32))
    assert single.points.dtype == np.float64
    # Psi is estimated badly: to it alone even so little matters.
    allowed = 1e-4 if name in {"three_point", "exact_fit_3d"} else PAIR
    assert change(name, reference, single) < allowed


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("name", NAMES)
def test_the_order_of_the_points_does_not_matter(
    name: str, reference: str, random: np.random.Generator
) -> None:
    measurement = REFERENCES[reference]
    shuffled = random.permutation(measurement.points)
    assert change(name, reference, with_points(measurement, shuffled)) < 1e-9


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("name", NAMES)
def test_points_told_twice_tell_the_same_place(name: str, reference: str) -> None:
    measurement, once = REFERENCES[reference], answer(reference, name)
    twice = run_method(
        METHODS[name], with_points(measurement, np.repeat(measurement.points, 2, axis=0))
    )
    if not once.values or not twice.values:
        # Once in twenty noises, points in pairs look like those of another beam.
        assert twice.outcome in {once.outcome, Outcome.INVALID}
        return
    # Neighbours that err alike are distinguished from independent ones, so that nothing is gained
    # twice: the clamp's prior is not outweighed by more than its own sigma. The sigma may be that
    # of errors of many points: 1.9 times as large over eight seeds.
    assert abs(twice.values["x_c_m"] - once.values["x_c_m"]) < 5 * once.sigma("x_c_m")
    assert 0.1 < twice.sigma("x_c_m") / once.sigma("x_c_m") < 6


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=4)
@given(
    length=st.sampled_from([1e-4, 1e3]) | st.floats(-4, 3).map(lambda power: 10.0**power),
    rigidity=st.sampled_from([1e-20, 1.0, 1e12]) | st.floats(-20, 12).map(lambda p: 10.0**p),
)
def test_units_do_not_matter(name: str, reference: str, length: float, rigidity: float) -> None:
    # A beam from 24 micrometres to 240 m.
    once, measurement = (
        answer(reference, name),
        rescaled(REFERENCES[reference], length, rigidity),
    )
    again = run_method(METHODS[name], measurement)
    beam = measurement.rig.beam
    assert largest_change(once, again, BEAM, beam) < (PAIR if name in PAIRED else 1e-8)
    if once.values:
        assert again.sigma("x_c_m") / beam.length == pytest.approx(
            once.sigma("x_c_m") / BEAM.length, rel=1e-6
        )
        force, again_force = once.values["force_n"], again.values["force_n"]
        assert again.sigma("force_n") / again_force == pytest.approx(
            once.sigma("force_n") / force, rel=1e-6
        )


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("name", NAMES)
def test_a_mirror_turns_signs_and_nothing_else(name: str, reference: str) -> None:
    once, seen = (
        answer(reference, name),
        run_method(METHODS[name], mirrored(REFERENCES[reference])),
    )
    assert seen.outcome is once.outcome
    assert list(seen.values) == list(once.values)
    for quantity, value in once.values.items():
        # y_c is counted in the deformation plane, whatever the side.
        turned = quantity.endswith(TURNED) and quantity != "y_c_m"
        expected = -value if turned or quantity == "onset_angle_rad" else value
        assert seen.values[quantity] == pytest.approx(expected, rel=1e-9, abs=1e-12), quantity
        assert seen.sigma(quantity) == pytest.approx(once.sigma(quantity), rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("name", NAMES)
def test_where_the_clamp_stands_moves_the_contact_along(
    name: str, reference: str, random: np.random.Generator
) -> None:
    once, by = answer(reference, name), random.uniform(-1.0, 1.0, 3)
    there = run_method(METHODS[name], moved(REFERENCES[reference], by))
    along = dict(zip("xyz", by, strict=True))
    assert there.outcome is once.outcome
    for quantity, value in once.values.items():
        if not quantity.startswith("contact_world"):
            shift = along[quantity[-3]] if quantity.startswith("contact_antenna") else 0.0
            assert there.values[quantity] == pytest.approx(value + shift, abs=1e-9), quantity


WORLD_POINT = [f"contact_world_{axis}_m" for axis in "xyz"]


# Three points say nothing of the flat push, and the stiffness is no place.
@pytest.mark.parametrize("name", sorted(METHODS.keys() - {"three_point", "stiffness"}))
def test_where_the_clamp_stands_the_world_turns(name: str) -> None:
    # Assumption 4 of the paper: the motor's axis passes through the clamp, wherever that is.
    by = np.array([0.03, -0.02, 0.01])
    there = run_method(METHODS[name], moved(REFERENCES["flat"], by))
    here = [answer("flat", name).values[quantity] for quantity in WORLD_POINT]
    assert [there.values[quantity] for quantity in WORLD_POINT] == pytest.approx(here + by)
