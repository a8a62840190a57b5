import math

import numpy as np
import pytest

from tests.vbaa_bench.mechanics.benches import BEAM, THIN, imbalance, obstacle, push_one
from vbaa_bench.mechanics.pushing import push
from vbaa_bench.mechanics.rod import Rod
from vbaa_bench.mechanics.rod_contact import Motor, Step
from vbaa_bench.mechanics.state import State
from vbaa_bench.mechanics.surfaces import upright

ROD = Rod(BEAM)
ANGLES = (0.05, 0.1, 0.15, 0.2)
THERE_AND_BACK = (*ANGLES, 0.199, 0.15, 0.1, 0.05)


def there_and_back(friction: float, nu: float = 0.0) -> list[State]:
    touched = obstacle(BEAM, 0.12, nu=nu, friction=friction)
    steps = [Step(pushing_angle=angle) for angle in THERE_AND_BACK]
    return push(ROD, Motor(), [touched], 0.12, steps)


def drag(state: State) -> float:
    """Force along the beam over that across; positive towards the tip."""
    contact = state.contact
    return float(contact.force @ contact.tangent) / float(contact.force @ contact.normal)


def test_without_friction_the_way_back_is_the_way_there() -> None:
    states = there_and_back(0.0)
    for there, back in zip(states[:3], reversed(states[5:]), strict=True):
        size = float(np.linalg.norm(there.contact.force))
        assert back.contact.force == pytest.approx(there.contact.force, abs=1e-10 * size)
        assert back.centreline == pytest.approx(there.centreline, abs=1e-10 * BEAM.length)


@pytest.mark.thorough
@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_friction_resists_on_the_way_there_and_on_the_way_back(friction: float) -> None:
    states = there_and_back(friction)
    free = there_and_back(0.0)
    for state in states:
        assert abs(drag(state)) <= friction * (1 + 1e-9)
        assert imbalance(state, np.zeros(3)) < 1e-8
    for there, smooth, back in zip(states[:3], free[:3], reversed(states[5:]), strict=True):
        # Pushing, the beam is drawn back over the edge: the force on it points to the tip, which
        # is the oracle's negative mu.
        assert drag(there) == pytest.approx(friction, rel=1e-8)
        assert drag(back) == pytest.approx(-friction, rel=1e-8)
        # The motor pays for it, and gets less back.
        assert -there.base_moment[2] > -smooth.base_moment[2] > -back.base_moment[2]


def test_friction_holds_the_contact_when_the_motor_turns_back() -> None:
    states = there_and_back(0.3)
    top, after = states[3], states[4]
    assert after.contact.s == pytest.approx(top.contact.s, abs=1e-4 * BEAM.length)
    assert abs(drag(after)) < 0.3 * (1 - 1e-3)
    # What sticks has rolled, not slipped: edge and beam keep the same two points together.
    assert after.contact.s == pytest.approx(top.contact.s, abs=1e-6)


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_friction_holds_the_beam_on_a_leaning_edge(friction: float) -> None:
    """Sliding aside, the force leans back by the angle of friction: psi is nu - atan(mu)."""
    nu = 0.6
    leaned = []
    for angle in (0.02, 0.01, 0.005):
        touched = obstacle(THIN, 0.12, nu=nu, friction=friction)
        leaned.append(push_one(Rod(THIN), touched, 0.12, angle=angle).contact.psi)
    errors = np.abs(np.array(leaned) - (nu - math.atan(friction)))
    assert errors[-1] < 1e-3
    assert (errors[1:] < 0.6 * errors[:-1]).all()


def test_a_repeated_step_changes_nothing() -> None:
    touched = obstacle(BEAM, 0.12, friction=0.3)
    once, repeated = (
        push(ROD, Motor(), [touched], 0.12, [Step(pushing_angle=angle) for angle in angles])
        for angles in ((0.05, 0.1, 0.15), (0.05, 0.1, 0.1, 0.15))
    )
    assert (repeated[2].centreline == repeated[1].centreline).all()
    assert (repeated[3].centreline == once[2].centreline).all()


@pytest.mark.parametrize("towards", [-1e-4, 1e-4])
def test_an_object_may_move_while_the_motor_stands_still(towards: float) -> None:
    """The states are the limit of those with a small turn of the motor."""
    touched, drift = obstacle(BEAM, 0.12, friction=0.3), (0.0, towards, 0.0)
    still, turned = (
        push(ROD, Motor(), [touched], 0.12, [Step(0.1), Step(angle, drift=drift), Step(0.15)])
        for angle in (0.1, 0.1 + 1e-9)
    )
    for one, other in zip(still, turned, strict=True):
        assert one.centreline == pytest.approx(other.centreline, abs=1e-8 * BEAM.length)
        assert drag(one) == pytest.approx(drag(other), abs=1e-5)


def test_only_the_pushed_object_may_have_friction() -> None:
    pegs = [obstacle(BEAM, 0.08), obstacle(BEAM, 0.16, friction=0.1)]
    with pytest.raises(ValueError, match="only the first"):
        push(ROD, Motor(), pegs, 0.08, [Step(pushing_angle=0.1)])


def test_sliding_aside_does_not_depend_on_how_many_steps_led_there() -> None:
    def pushed(count: int) -> State:
        angles = np.linspace(0, 0.24, count + 1)[1:]
        edge = obstacle(BEAM, 0.12, nu=0.6, friction=0.3)
        steps = [Step(pushing_angle=float(angle)) for angle in angles]
        return push(Rod(BEAM), Motor(), [edge], 0.12, steps)[-1]

    one, many = pushed(1), pushed(48)
    assert one.contact.psi == pytest.approx(many.contact.psi, abs=1e-4)
    assert one.contact.force == pytest.approx(many.contact.force, rel=3e-4)


def test_a_soft_object_drags_from_its_first_stride_on() -> None:
    stiffness = 3 * BEAM.flexural_rigidity / 0.129**3
    edge = obstacle(BEAM, 0.129, compliance=10 / stiffness, friction=0.6)
    for count in (1, 14):
        steps = [Step(pushing_angle=float(a)) for a in np.linspace(0, 0.024, count + 1)[1:]]
        last = push(ROD, Motor(), [edge], 0.129, steps)[-1]
        assert drag(last) == pytest.approx(0.6, rel=1e-8)


@pytest.mark.thorough
@pytest.mark.parametrize("strides", [24, 96])
def test_a_beam_turns_on_its_thickness_before_it_slides_towards_the_clamp(strides: int) -> None:
    """The surface slides back by r (theta - angle), and on by what the bent beam is longer.

    With linear theory's theta - angle = angle / 2 and arc - chord = x_0 angle^2 / 10, the way
    turns at angle = 2.5 r / x_0.
    """
    peg = obstacle(BEAM, 0.06, upright(2e-3), friction=0.8)
    angles = np.radians(np.linspace(0, 6, strides + 1)[1:])
    states = push(ROD, Motor(), [peg], 0.06, [Step(pushing_angle=float(a)) for a in angles])
    turn = 2.5 * BEAM.radius / 0.06
    for angle, state in zip(angles, states, strict=True):
        if abs(angle - turn) > 0.2 * turn:
            assert drag(state) == pytest.approx(math.copysign(0.8, angle - turn), rel=1e-6)


@pytest.mark.thorough
def test_a_beam_stays_on_its_side_of_a_peg() -> None:
    peg = obstacle(BEAM, 0.113, upright(0.01), friction=0.8)
    degrees = (1.56, 20.16, 19.16, 14.12, 9.07, 4.03)
    steps = [Step(pushing_angle=math.radians(one)) for one in degrees]
    for state in push(ROD, Motor(), [peg], 0.113, steps):
        assert state.contact.normal[1] > 0.8
        assert state.contact.point[1] > 0
