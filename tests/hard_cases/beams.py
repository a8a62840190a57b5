"""Pushes that every method can answer, and the same pushes in other units or seen in a mirror."""

from dataclasses import replace
from functools import cache
from math import inf, radians

import numpy as np
import numpy.typing as npt

from solver.instrument.arrays import Floats
from solver.instrument.beam import Beam
from solver.instrument.estimate import Estimate
from solver.instrument.measurement import Measurement, View
from solver.instrument.rig import Gravity, Rig, Sensors
from tests.draws import generator
from tests.inclined import on_plane_c
from tests.simulated import BEAM, columns, rig
from vbaa_bench.mechanics.planar import push

SIGMA = 0.05 * 0.51e-3  # 0.05 px [m]
# Off the beam's middle, so that perspective tells the plane and three points can answer.
VIEWPOINT = np.array([-0.12, 0.0, 0.36, 1.0])
ONSET = 0.17  # motor angle of first contact [rad]
# Sign of what turns about in a mirror that shows y as -y.
TURNED = ("psi_rad", "_angle_rad", "_y_m", "_y_n")


@cache
def _state(
    distance: float, angle_deg: float, deflection: float | None
) -> tuple[Floats, Floats, Floats]:
    """Centreline (n, 4), contact (3,), and what the clamp exerts: force and moment (6,)."""
    angle = radians(angle_deg) if deflection is None else None
    state = push(BEAM, distance, pushing_angle=angle, deflection=deflection, intervals=4000)
    return (
        state.centreline,
        state.contact.point,
        np.concatenate([state.base_force, state.base_moment]),
    )


def true_contact(distance: float, deflection: float) -> float:
    """x_c [m] of the exact beam pushed at `distance` [m] until y_tip / L is `deflection`."""
    return float(_state(distance, 0.0, deflection)[1][0])


def sensing_rig(psi: float = 0.0) -> Rig:
    """The reference rig with every sensor, a direction of gravity, a tolerance of everything."""
    nominal = rig(
        encoder=1e-4,
        base_position=1e-5,
        beam_length=1e-5,
        flexural_rigidity=0.01 * BEAM.flexural_rigidity,
    )
    sensors = Sensors(moment_y=1e-4, base_force=1e-4, base_moment=1e-5)
    # Gravity pulls across the beam where it is touched in the flat push, to some degrees.
    gravity = Gravity(radians(115), radians(5))
    return replace(nominal, sensors=sensors, known_psi=psi or None, gravity=gravity)


def pushed_beam(
    distance: float = 0.15,
    angle_deg: float = 15.0,
    *,
    deflection: float | None = None,
    psi: float = 0.0,
    sigma: float = SIGMA,
    seed: int | None = 1,
    earlier: tuple[float, ...] = (6.0, 10.0),
) -> Measurement:
    """The last frame of a push by a rig with every sensor, seen with noise, in a plane it knows.

    The last frame is pushed by `angle_deg`, or to `deflection` where that is given; `earlier` are
    the pushing angles [deg] of the frames before it. Without `seed` nothing errs.
    """
    random = None if seed is None else generator(__name__, seed)
    frames: tuple[Measurement, ...] = ()
    pushes = [*((angle, None) for angle in earlier), (angle_deg, deflection)]
    cosine, sine = np.cos(psi), np.sin(psi)
    turn = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])
    for angle, reached in pushes:
        line, _, load = _state(distance, angle, reached)
        seen = line.copy()
        seen[:, 1:3] = on_plane_c(line[:, 1:3], psi, VIEWPOINT)
        points = columns(seen)
        if random is not None:
            points = points + np.outer(random.standard_normal(len(points)), [0.0, sigma])
        force, moment = turn @ load[:3], turn @ load[3:]
        frame = Measurement(
            view=View(points, np.tile([0.0, sigma], (len(points), 1)), VIEWPOINT),
            base_covariance=np.diag([1e-5, 5e-6, 1e-4]) ** 2,
            scale_sigma=1e-4,
            motor_angle=ONSET - radians(angle),
            rig=sensing_rig(psi),
            moment_y=-float(moment[1]),
            base_force=(float(force[0]), float(force[1]), float(force[2])),
            base_moment=(float(moment[0]), float(moment[1]), float(moment[2])),
        )
        frames = (*frames, frame)
    return replace(frames[-1], earlier=frames[:-1])


# In plane C with its history, and in an inclined plane, so sharp that three points tell it.
REFERENCES = {
    "flat": pushed_beam(),
    "inclined": pushed_beam(0.15, deflection=0.2, psi=0.6, sigma=0.1 * SIGMA, earlier=()),
}


def with_points(
    measurement: Measurement, points: npt.ArrayLike, sigmas: npt.ArrayLike | None = None
) -> Measurement:
    """Other points (n, 2) [m] in the last frame, each with the first one's sigma if none is given.

    The frames before stay as they are.
    """
    given = np.asarray(points)
    if sigmas is None:
        sigmas = np.tile(measurement.sigma_vectors[0], (len(given), 1))
    view = replace(
        measurement.view,
        points=given,
        sigma_vectors=np.asarray(sigmas),
        lost_light=np.zeros(len(given)),
    )
    return replace(measurement, view=view)


def rescaled(measurement: Measurement, length: float, rigidity: float) -> Measurement:
    """The same push by a rig whose lengths and whose EI are so many times as large.

    By similarity forces grow as EI / L^2 and moments as EI / L; angles stay.
    """
    view, nominal = measurement.view, measurement.rig
    beam, tolerances, sensors = nominal.beam, nominal.tolerances, nominal.sensors
    force, moment = rigidity / length**2, rigidity / length
    unit = np.array([length, length, 1.0])
    pose = measurement.antenna_from_beam * np.array([[1, 1, 1, length]] * 3 + [[1, 1, 1, 1]])
    assert measurement.moment_y is not None
    assert measurement.base_force is not None
    assert measurement.base_moment is not None
    assert sensors.moment_y is not None
    assert sensors.base_force is not None
    assert sensors.base_moment is not None
    x, y, z = measurement.base_force
    turn_x, turn_y, turn_z = measurement.base_moment
    return replace(
        measurement,
        view=View(
            view.points * length,
            view.sigma_vectors * length,
            view.viewpoint * [length, length, length, 1.0],
        ),
        base_covariance=measurement.base_covariance * np.outer(unit, unit),
        antenna_from_beam=pose,
        moment_y=measurement.moment_y * moment,
        base_force=(x * force, y * force, z * force),
        base_moment=(turn_x * moment, turn_y * moment, turn_z * moment),
        rig=replace(
            nominal,
            beam=Beam(
                beam.length * length, beam.diameter * length, beam.flexural_rigidity * rigidity
            ),
            base_position=nominal.base_position * length,
            tolerances=replace(
                tolerances,
                beam_length=tolerances.beam_length * length,
                base_position=tolerances.base_position * length,
                flexural_rigidity=tolerances.flexural_rigidity * rigidity,
            ),
            sensors=Sensors(
                moment_y=sensors.moment_y * moment,
                base_force=sensors.base_force * force,
                base_moment=sensors.base_moment * moment,
            ),
        ),
        earlier=tuple(rescaled(frame, length, rigidity) for frame in measurement.earlier),
    )


def mirrored(measurement: Measurement) -> Measurement:
    """The same push by a rig that deflects towards -y: the beam's frame is a reflection.

    What sensors read in Sigma_a is reflected with it, a moment as the axial vector that it is.
    """
    assert measurement.motor_angle is not None
    assert measurement.base_force is not None
    assert measurement.base_moment is not None
    x, y, z = measurement.base_force
    turn_x, turn_y, turn_z = measurement.base_moment
    known, gravity = measurement.rig.known_psi, measurement.rig.gravity
    return replace(
        measurement,
        rig=replace(
            measurement.rig,
            deflects_towards=-1,
            known_psi=None if known is None else -known,
            gravity=None if gravity is None else replace(gravity, direction=-gravity.direction),
        ),
        motor_angle=-measurement.motor_angle,
        antenna_from_beam=np.diag([1.0, -1.0, 1.0, 1.0]) @ measurement.antenna_from_beam,
        base_force=(x, -y, z),
        base_moment=(-turn_x, turn_y, -turn_z),
        earlier=tuple(mirrored(frame) for frame in measurement.earlier),
    )


def moved(measurement: Measurement, by: Floats) -> Measurement:
    """The same push by an antenna that is clamped elsewhere, by (3,) [m] in Sigma_a."""
    pose = measurement.antenna_from_beam.copy()
    pose[:3, 3] += by
    return replace(
        measurement,
        rig=replace(measurement.rig, base_position=measurement.rig.base_position + by),
        antenna_from_beam=pose,
        earlier=tuple(moved(frame, by) for frame in measurement.earlier),
    )


def units(beam: Beam, names: npt.ArrayLike) -> Floats:
    """What each quantity is counted in (n,): L, EI / L^2, their quotients, radians."""
    length, force = beam.length, beam.flexural_rigidity / beam.length**2
    by_ending = {
        "_n_per_m": force / length,
        "_m_per_n": length / force,
        "_rad": 1.0,
        "friction": 1.0,
        "_n": force,
        "_m": length,
    }
    endings = [
        next(end for end in by_ending if str(name).endswith(end)) for name in np.array(names)
    ]
    return np.array([by_ending[end] for end in endings])


def in_units(answer: Estimate, beam: Beam) -> Floats:
    """An estimate's values (n,) without dimension, by L and EI."""
    return np.array([*answer.values.values()]) / units(beam, list(answer.values))


def largest_change(one: Estimate, other: Estimate, beam: Beam, other_beam: Beam) -> float:
    """The largest difference of values without dimension; infinite where outcomes differ."""
    if one.outcome is not other.outcome or list(one.values) != list(other.values):
        return inf
    change = in_units(one, beam) - in_units(other, other_beam)
    return float(np.abs(change).max(initial=0.0))


def is_sound(answer: Estimate) -> bool:
    """Whether an estimate says something: values that are finite with a covariance, or a reason.

    A covariance is symmetric and positive semi-definite to rounding; where the clamp is hardly
    known that rounding is magnified.
    """
    if not answer.values:
        return bool(answer.message or answer.outcome.sentence)
    covariance = answer.covariance
    if covariance is None or not np.isfinite([*answer.values.values()]).all():
        return False
    variance = np.diag(covariance)
    sigma = np.sqrt(np.where(variance > 0, variance, 1.0))
    correlation = covariance / np.outer(sigma, sigma)
    return bool(
        (variance >= 0).all()
        and np.abs(correlation - correlation.T).max() < 1e-6
        and np.linalg.eigvalsh((correlation + correlation.T) / 2).min() > -1e-6
    )
