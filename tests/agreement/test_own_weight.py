"""A beam that its own weight bends in plane C, by two roads: the world's rod, and the solver's."""

import math

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.beam_shape import stated_shape
from solver.instrument.estimate import Estimate
from solver.instrument.transforms import turn_about_z
from solver.methods.exact_fit import exact_fit
from solver.planes.own_weight import OwnWeight, bow_by_own_weight
from tests.simulated import BEAM, columns
from tests.tapered import bowed
from vbaa_bench.mechanics.loaded import Load, LoadedBeam, loaded
from vbaa_bench.mechanics.rod import Rod

LENGTH, EI = BEAM.length, BEAM.flexural_rigidity
DENSE = np.linspace(0.0, LENGTH, 1001)
SHAPE = stated_shape(taper=0.0, softness=0.0, section=0.02, friction=0.0)
# The tip's sag over the length: that of a steel wire of 0.8 mm, 4 mm of 240.
SAG = 0.017


def vector(sag: float, heading: float) -> Floats:
    return sag * np.array([math.cos(heading), math.sin(heading)])


def bent(sag: Floats, motor_angle: float, loads: list[Load]) -> LoadedBeam:
    """The world's rod with this sag (2,) over the length, where the motor has turned it."""
    x, y = 8 * sag * EI / LENGTH**3
    rod = Rod(BEAM, weight=(float(x), float(y), 0.0))
    return loaded(rod, loads, DENSE, turn_about_z(-motor_angle)[:3, :3])


def bow_of(beam: LoadedBeam) -> Floats:
    """Coefficients (3,) of x^2 to x^4 of a line, over the length."""
    x, y = beam.centreline[:, 1:3].T / LENGTH
    return np.asarray(np.linalg.lstsq(np.stack([x**2, x**3, x**4], axis=-1), y)[0])


def turn_of(beam: LoadedBeam, x: Floats) -> Floats:
    """Directions (n,) [rad] of a beam at x (n,) [m]."""
    line = beam.centreline
    return np.arctan(np.interp(x, line[:, 1], np.gradient(line[:, 2], line[:, 1])))


def by_weight(beam: LoadedBeam, bow: Floats, sag: Floats, motor_angle: float) -> OwnWeight:
    x = columns(beam.centreline)[:, 0]
    now = turn_about_z(-motor_angle)[:2, :2] @ sag
    return bow_by_own_weight(x / LENGTH, turn_of(beam, x), bow, now, sag)


@pytest.mark.parametrize("motor_angle", [-1.0, 0.6])
@pytest.mark.parametrize("heading", [0.0, 1.1, -math.pi / 2])
def test_a_beam_that_only_turns_has_the_bow_of_a_cantilever(
    heading: float, motor_angle: float
) -> None:
    """Euler and Bernoulli: the line is sag (6 s^2 - 4 s^3 + s^4) / 3 for the weight across it."""
    sag = vector(1e-4, heading)
    rest, turned = bent(sag, 0.0, []), bent(sag, motor_angle, [])
    change = by_weight(turned, bow_of(rest), sag, motor_angle).bow
    across = (turn_about_z(-motor_angle)[:2, :2] @ sag - sag)[1]
    assert change == pytest.approx(across * np.array([6, -4, 1]) / 3, abs=2e-3 * 1e-4)


@pytest.mark.parametrize("heading", [-math.pi / 2, 0.3])
def test_a_large_sag_is_that_of_the_rod(heading: float) -> None:
    sag, motor_angle = vector(2 * SAG, heading), 0.8
    rest, turned = bent(sag, 0.0, []), bent(sag, motor_angle, [])
    bow = bow_of(rest)
    found = bow + by_weight(turned, bow, sag, motor_angle).bow
    # Of third order in the sag.
    assert found == pytest.approx(bow_of(turned), abs=5 * (2 * SAG) ** 3)


def answer(beam: LoadedBeam, bow: Floats, weight: OwnWeight) -> Estimate:
    """The exact fit of a beam with a bow (3,) at rest, which its weight has changed since."""
    points = columns(beam.centreline)
    turn = turn_of(beam, points[:, 0])
    arc = np.interp(points[:, 0], beam.centreline[:, 1], beam.centreline[:, 0]) / LENGTH
    height = LENGTH * np.polyval([*(bow + weight.bow)[::-1], 0.0, 0.0], arc)
    normals = np.stack([-np.sin(turn), np.cos(turn)], axis=-1)
    removed = height[:, None] * normals
    points = points - LENGTH * weight.remainder[:, None] * normals
    return exact_fit(bowed(points, removed, bow * LENGTH, weight.bow * LENGTH, SHAPE))


@pytest.mark.parametrize("heading", [math.pi / 2, -math.pi / 2, 0.3])
@pytest.mark.parametrize("motor_angle", [-0.15, 0.6])
@pytest.mark.parametrize("place", [0.4, 0.8])
def test_contact_and_force_are_those_of_the_rod(
    place: float, motor_angle: float, heading: float
) -> None:
    sag, deflection = vector(SAG, heading), 0.1
    force = 3 * deflection * LENGTH / (place * LENGTH) ** 3 * EI
    bow = bow_of(bent(sag, 0.0, []))
    beam = bent(sag, motor_angle, [Load(place * LENGTH, force)])
    found = answer(beam, bow, by_weight(beam, bow, sag, motor_angle))
    x_c, size = beam.points[0, 0], float(np.linalg.norm(beam.forces[0]))
    # A twentieth of the noise of an image or less: first order in what the form of the bow leaves.
    assert found.values["x_c_m"] == pytest.approx(x_c, abs=3e-5 * LENGTH), found
    assert found.values["force_n"] == pytest.approx(size, rel=2e-4)
    if abs(motor_angle) > 0.5:
        # Without it the beam is another one, or the contact is elsewhere.
        none = OwnWeight(np.zeros(3), np.zeros(1))
        without = answer(beam, bow, none).values.get("x_c_m", math.inf)
        assert abs(without - x_c) > 4e-4 * LENGTH
