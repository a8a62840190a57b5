"""Points that no beam shows, and sigmas and clamps beyond reason: an outcome, never an error."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import Measurement, Tip, View
from solver.methods import METHODS
from solver.tracker import run_method
from tests.consistency import MOST_SIGMAS
from tests.draws import generator
from tests.hard_cases.beams import REFERENCES, is_sound, pushed_beam, true_contact, with_points
from tests.simulated import BEAM

NAMES = sorted(METHODS)
# What looks at the points.
VISUAL = sorted(METHODS.keys() - {"force_sensor"})
EXACT = {"exact_fit", "exact_fit_3d", "push_fit", "push_fit_friction", "force_sensor"}
FLAT = REFERENCES["flat"]
POINTS = FLAT.points
X = np.linspace(0.0, BEAM.length, 400)
RANDOM = generator(__name__, 5)


def sound(name: str, measurement: Measurement) -> Estimate:
    """A method's answer, which must be values with a covariance, or a sentence."""
    found = run_method(METHODS[name], measurement)
    assert found.outcome is not Outcome.CRASHED, found.message
    assert is_sound(found), found
    return found


def line(slope: float, offset: float = 0.0) -> Floats:
    return np.column_stack([X, slope * X + offset])


# Points that are not those of a pushed beam.
NO_BEAM = {
    "none": POINTS[:0],
    "one": POINTS[200:201],
    "two": POINTS[[100, 400]],
    "seven": POINTS[::65][:7],
    "all at the clamp": np.zeros((200, 2)),
    "all at one place": np.tile([0.1, 0.01], (200, 1)),
    "all at the tip": np.tile([0.24, 0.05], (200, 1)),
    "a straight line": line(0.0),
    "a line that is hardly turned": line(1e-6),
    "a turned line": line(0.05),
    "a line at 27 degrees": line(0.5),
    "a line beside the beam": line(0.0, 0.01),
    "a line across the beam": np.column_stack([np.full_like(X, 0.1), X]),
    "bent to the other side": POINTS * [1, -1],
    "behind the clamp": POINTS * [-1, 1],
    "far behind the clamp": POINTS - [0.3, 0.0],
    "a zigzag": np.column_stack([X, 0.05 * (-1.0) ** np.arange(len(X))]),
    "scattered": RANDOM.uniform(-0.3, 0.3, (300, 2)),
    "a million times as large": POINTS * 1e6,
    "a millionth as large": POINTS * 1e-6,
    "hardly more than nothing": POINTS * 1e-300,
}


# Those on which a fit takes longest; others of their kind are in the quick run.
LONG = {"a line across the beam", "a line beside the beam", "behind the clamp"}


@pytest.mark.parametrize(
    "points",
    [
        pytest.param(points, id=kind, marks=[pytest.mark.thorough] if kind in LONG else [])
        for kind, points in NO_BEAM.items()
    ],
)
@pytest.mark.parametrize("name", VISUAL)
def test_points_of_no_pushed_beam_give_a_sentence(name: str, points: Floats) -> None:
    alone = replace(with_points(FLAT, points), earlier=())
    # Only these use the frames before.
    with_history = name.startswith("push_fit") or name == "stiffness"
    for measurement in (with_points(FLAT, points), alone)[1 - with_history :]:
        found = sound(name, measurement)
        assert not found.values, found
        # The other outcomes say all by themselves.
        assert found.message or found.outcome is not Outcome.INVALID


@settings(max_examples=8)
@given(
    points=arrays.arrays(
        np.float64,
        st.tuples(st.integers(0, 90), st.just(2)),
        elements=st.floats(-1.0, 1.0, width=32),
    )
)
@pytest.mark.parametrize("name", NAMES)
def test_whatever_the_points_there_is_an_outcome(name: str, points: Floats) -> None:
    sound(name, with_points(FLAT, points))


@pytest.mark.thorough
@pytest.mark.parametrize("scale", [0.0, 1e-12, 1e-6, -1.0, 1e3, 1e8])
@pytest.mark.parametrize("name", NAMES)
def test_whatever_the_sigmas_there_is_an_outcome(name: str, scale: float) -> None:
    found = sound(name, with_points(FLAT, POINTS, FLAT.sigma_vectors * scale))
    if scale == -1.0:  # a displacement by minus one sigma is as good
        once = run_method(METHODS[name], FLAT)
        assert found.outcome is once.outcome
        assert dict(found.values) == pytest.approx(dict(once.values))
    if scale > 1 and name in VISUAL:  # the beam is straight within such a noise
        assert found.outcome is Outcome.NO_CONTACT


@pytest.mark.parametrize("name", NAMES)
def test_sigmas_of_some_points_alone_may_vanish_or_lie_along_the_beam(name: str) -> None:
    half = FLAT.sigma_vectors.copy()
    half[::2] = 0.0
    for sigmas in (half, FLAT.sigma_vectors[:, ::-1]):
        sound(name, with_points(FLAT, POINTS, sigmas))


CLAMPS = {
    "known beyond reason": 1e-30 * np.eye(3),
    "to a nanometre": 1e-18 * np.eye(3),
    "to a metre and a radian": np.eye(3),
    "to a kilometre": 1e6 * np.eye(3),
    "not at all": 1e20 * np.eye(3),
    "nearly one number": 1e-10 * (np.ones((3, 3)) + 1e-6 * np.eye(3)),
}


@pytest.mark.parametrize("clamp", CLAMPS.values(), ids=CLAMPS.keys())
@pytest.mark.parametrize("name", NAMES)
def test_whatever_is_known_of_the_clamp_there_is_an_outcome(name: str, clamp: Floats) -> None:
    found = sound(name, replace(FLAT, base_covariance=clamp))
    if name in EXACT and found.values:
        # Where nothing is known of the clamp, it is off by 2.4 +- 1.3 of its sigmas.
        error = found.values["x_c_m"] - true_contact_of_flat()
        assert abs(error) < 2 * MOST_SIGMAS * found.sigma("x_c_m")


def true_contact_of_flat() -> float:
    """x_c [m] as the clamp's own sensors tell it, to 0.05 % of L."""
    return run_method(METHODS["force_sensor"], FLAT).values["x_c_m"]


@pytest.mark.parametrize(
    "clamp", [np.zeros((3, 3)), -np.eye(3), np.ones((3, 3)), np.full((3, 3), nan)]
)
def test_a_covariance_that_is_none_is_refused_at_the_door(clamp: Floats) -> None:
    with pytest.raises(ValueError, match="base_covariance"):
        replace(FLAT, base_covariance=clamp)
    with pytest.raises(ValueError, match="tip covariance"):
        Tip(POINTS[-1], clamp[:2, :2])


@pytest.mark.parametrize("wrong", [nan, inf, -inf])
def test_what_is_not_finite_is_refused_at_the_door(wrong: float) -> None:
    points = POINTS.copy()
    points[7, 1] = wrong
    with pytest.raises(ValueError, match="points holds a value that is not finite"):
        with_points(FLAT, points)
    with pytest.raises(ValueError, match="sigma_vectors holds a value that is not finite"):
        with_points(FLAT, POINTS, np.full_like(POINTS, wrong))
    with pytest.raises(ValueError, match="scale_sigma"):
        replace(FLAT, scale_sigma=wrong)
    with pytest.raises(ValueError, match="motor_angle holds a value that is not finite"):
        replace(FLAT, motor_angle=wrong)
    with pytest.raises(ValueError, match="moment_y holds a value that is not finite"):
        replace(FLAT, moment_y=wrong)
    with pytest.raises(ValueError, match="base_force holds a value that is not finite"):
        replace(FLAT, base_force=(0.0, wrong, 0.0))
    with pytest.raises(ValueError, match="base_moment holds a value that is not finite"):
        replace(FLAT, base_moment=(wrong, 0.0, 0.0))


def test_shapes_and_viewpoints_that_cannot_be_are_refused_at_the_door() -> None:
    with pytest.raises(ValueError, match="points has shape"):
        View(POINTS.T, FLAT.sigma_vectors.T, FLAT.view.viewpoint)
    with pytest.raises(ValueError, match="sigma_vectors has shape"):
        View(POINTS, FLAT.sigma_vectors[:-1], FLAT.view.viewpoint)
    with pytest.raises(ValueError, match="the viewpoint is in the calibration plane"):
        View(POINTS, FLAT.sigma_vectors, np.array([0.12, 0.3, 0.0, 1.0]))


@pytest.mark.parametrize("name", NAMES)
def test_a_few_points_behind_the_clamp_do_no_harm(name: str) -> None:
    stray = np.vstack([POINTS, [[-0.05, 0.0], [-0.1, 0.01], [-0.2, -0.01]]])
    found = sound(name, with_points(FLAT, stray))
    if name in EXACT:
        error = found.values["x_c_m"] - true_contact_of_flat()
        assert abs(error) < MOST_SIGMAS * found.sigma("x_c_m")
        assert found.sigma("x_c_m") < 1e-3 * BEAM.length


@pytest.mark.parametrize("name", NAMES)
def test_a_tip_that_is_none_does_not_draw_the_answer(name: str) -> None:
    # An occluder's edge, say, or a reflection: far from where the beam can end.
    for place in ([0.6, 0.3], POINTS[-60]):
        tip = Tip(np.array(place), 1e-9 * np.eye(2))
        found = sound(name, replace(FLAT, view=replace(FLAT.view, tip=tip)))
        if name in EXACT:
            assert abs(found.values["x_c_m"] - true_contact_of_flat()) < 4 * (
                found.sigma("x_c_m") + 1.3e-4
            )


@pytest.mark.parametrize("name", NAMES)
def test_a_history_of_nonsense_is_an_outcome(name: str) -> None:
    empty = replace(with_points(FLAT, POINTS[:0]), earlier=())
    scattered = tuple(with_points(frame, NO_BEAM["scattered"]) for frame in FLAT.earlier)
    for earlier in ((empty,) * 3, (replace(FLAT, earlier=()),) * 3, scattered):
        sound(name, replace(FLAT, earlier=earlier))


@pytest.mark.parametrize("deflection", [0.3, 0.45])
@pytest.mark.parametrize("distance", [0.03, 0.12, 0.2])
@pytest.mark.parametrize("name", NAMES)
def test_a_beam_bent_by_up_to_45_percent(name: str, distance: float, deflection: float) -> None:
    found = sound(name, pushed_beam(distance, deflection=deflection, earlier=()))
    if name in EXACT:
        true = true_contact(distance, deflection)
        assert found.outcome is Outcome.CONTACT
        assert abs(found.values["x_c_m"] - true) < MOST_SIGMAS * found.sigma("x_c_m")
        # What friction might be at, one frame does not tell.
        if name != "push_fit_friction":
            assert found.sigma("x_c_m") < 2e-3 * BEAM.length


@pytest.mark.parametrize("deflection", [0.02, 0.1])
@pytest.mark.parametrize("name", NAMES)
def test_a_contact_at_the_tip(name: str, deflection: float) -> None:
    distance = 0.2395 if deflection < 0.05 else 0.235
    found = sound(name, pushed_beam(distance, deflection=deflection, earlier=()))
    if name in EXACT:
        assert found.outcome in (Outcome.TIP_CONTACT, Outcome.CONTACT)
        true = true_contact(distance, deflection)
        assert abs(found.values["x_c_m"] - true) < MOST_SIGMAS * found.sigma("x_c_m")


@pytest.mark.parametrize("deflection", [0.02, 0.1])
@pytest.mark.parametrize("name", NAMES)
def test_a_contact_two_millimetres_from_the_clamp(name: str, deflection: float) -> None:
    # All columns show the straight part beyond the contact.
    found = sound(name, pushed_beam(0.002, deflection=deflection, earlier=()))
    if name in EXACT and found.values:
        true = true_contact(0.002, deflection)
        assert abs(found.values["x_c_m"] - true) < MOST_SIGMAS * found.sigma("x_c_m")
