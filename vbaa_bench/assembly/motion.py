"""Motion during an exposure: the poses that one frame averages, and their weights in each row."""

import math
from dataclasses import replace

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.units import DEGREE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.mechanics.state import EquilibriumError
from vbaa_bench.scene.push import StepTarget
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene
from vbaa_bench.sensor.shutter import STEADY, Flicker, Shutter, effective_count

# Maximum movement of the tip [px] from one pose to the next.
STEP_PX = 0.25


def exposure_poses(pose: Pose, scene: Scene, rig: TrueRig) -> list[Pose]:
    """Compute the poses of a frame, an odd number; the requested pose is in the middle.

    The motor turns at constant speed. Poses of equal weight are in the middles of equal parts of
    the exposure; weighted ones include its start and its end. Raises InputError if a pose has no
    equilibrium.
    """
    turn = scene.motor_speed_deg_s * DEGREE * _shutter(scene).span
    if turn == 0:
        return [pose]
    beam = rig.beam
    scale = float(rig.camera.pixels_per_metre(np.array([[beam.length / 2, 0.0, 0.0]]))[0])
    half = math.ceil(abs(turn) * beam.length * scale / STEP_PX / 2)
    intervals = 2 * half + 1 if _equal_weights(scene) else 2 * half
    fractions = np.arange(-half, half + 1) / intervals
    targets = tuple(StepTarget(None, pose.state.pushing_angle + turn * float(s)) for s in fractions)
    push = replace(pose.experiment.push, targets=targets)
    experiment = Experiment(scene, rig, push, pose.experiment.folder)
    try:
        states = experiment.states()
    except EquilibriumError as error:
        speed = scene.motor_speed_deg_s
        raise InputError(f"motor_speed_deg_s is {speed:g}, and meanwhile {error}") from error
    poses = [
        Pose(experiment, replace(pose.spec, push=push, step=step), state, pose.state)
        for step, state in enumerate(states)
    ]
    poses[half] = pose
    return poses


def pose_weights(scene: Scene, poses: int, light: Flicker) -> Floats | None:
    """Compute the weights (rows, poses) of a frame's poses in an image; None if all are equal.

    They include the power of the light while a row is exposed.
    """
    return None if _equal_weights(scene) else _shutter(scene).weights(poses, light)


def averaged_poses(scene: Scene, poses: int) -> float:
    """Compute the number of a frame's poses over which the render's noise averages out."""
    weights = pose_weights(scene, poses, STEADY)
    return poses if weights is None else effective_count(weights)


def _equal_weights(scene: Scene) -> bool:
    """Return whether all rows are exposed at once and in constant light."""
    return scene.sensor.line_time_us == 0 and scene.flicker is None


def _shutter(scene: Scene) -> Shutter:
    sensor = scene.sensor
    return Shutter(sensor.exposure_s, sensor.line_time_s, scene.camera.height_px)
