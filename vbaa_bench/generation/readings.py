"""Sensor readings of a frame: the columns of metadata.csv beside the image's name."""

import math

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.mechanics.state import State
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.occlusion import REMOVED
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.schema import Scene


def readings(
    scene: Scene,
    spec: FrameSpec,
    state: State,
    hidden: tuple[float, float] | None,
    table_from_antenna: Floats | None = None,
) -> dict[str, str | float | int]:
    """Collect the readings of a frame by column; all frames of a scene have the same columns.

    A cell is empty if there is no reading: the motor angle if the camera is fixed in the world, the
    removed stretch if nothing is removed. If `hidden` [m] is covered by an occluder in the image,
    it is not revealed. `table_from_antenna` (4, 4) is the true pose of a carriage.
    """
    values: dict[str, str | float | int] = {
        "motor_angle_deg": "" if scene.camera.mount == "world" else _encoder(scene, spec, state),
        "push_id": spec.push_id,
        "step": spec.step,
    }
    if scene.splits is not None:
        values["split"] = scene.splits.name(scene.seed, spec.push_number)
    if scene.occlusion is not None and REMOVED in scene.occlusion.kind:
        is_removed = hidden is not None and spec.cover is not None and not spec.cover.in_image
        first, last = hidden if is_removed and hidden is not None else (None, None)
        values["removed_from_mm"] = "" if first is None else first / MILLIMETRE
        values["removed_to_mm"] = "" if last is None else last / MILLIMETRE
    if scene.moment_sensor is not None:
        noise = random_generator(scene, "moment sensor", spec.index)
        # Moment of the beam on the sensor, so that m_y = x_c f_z (27); right-handed, -x_c f_z.
        moment = -state.base_moment[1] / MILLIMETRE
        values["moment_y_n_mm"] = float(noise.normal(moment, scene.moment_sensor.sigma_n_mm))
    if scene.force_sensor is not None:
        noise = random_generator(scene, "force sensor", spec.index)
        force = noise.normal(state.base_force, scene.force_sensor.force_sigma_n)
        moment_n_mm = np.asarray(state.base_moment) / MILLIMETRE
        moments = noise.normal(moment_n_mm, scene.force_sensor.moment_sigma_n_mm)
        values |= {f"base_force_{axis}_n": float(v) for axis, v in zip("xyz", force, strict=True)}
        values |= {
            f"base_moment_{axis}_n_mm": float(v) for axis, v in zip("xyz", moments, strict=True)
        }
    if scene.carriage is not None and table_from_antenna is not None:
        # The carriage is at rest during a push.
        noise = random_generator(scene, "carriage", spec.push_number)
        true = carriage_pose(table_from_antenna)
        position, turn = scene.carriage.position_sigma_mm, scene.carriage.turn_sigma_deg
        for (name, value), sigma in zip(true.items(), (position, position, turn), strict=True):
            values[f"carriage_{name}"] = float(noise.normal(value, sigma))
        values |= {"carriage_sigma_mm": position, "carriage_turn_sigma_deg": turn}
    return values


def carriage_pose(table_from_antenna: Floats) -> dict[str, float]:
    """Convert a pose (4, 4) of the antenna on the table to its position and turn, by column."""
    x, y = table_from_antenna[:2, 3] / MILLIMETRE
    turn = math.atan2(table_from_antenna[1, 0], table_from_antenna[0, 0])
    return {"x_mm": float(x), "y_mm": float(y), "turn_deg": turn / DEGREE}


def _encoder(scene: Scene, spec: FrameSpec, state: State) -> float:
    """Simulate the encoder's reading [deg], with noise and quantised to its steps."""
    noise = random_generator(scene, "encoder", spec.index)
    tolerance = scene.tolerances
    true = spec.motor_angle(state.pushing_angle) / DEGREE
    reading = float(noise.normal(true, tolerance.encoder_deg))
    if tolerance.encoder_step_deg > 0:
        reading = round(reading / tolerance.encoder_step_deg) * tolerance.encoder_step_deg
    return reading
