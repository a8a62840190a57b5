"""Motion blur: the poses that one frame averages while the shutter is open."""

import math
from dataclasses import replace

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.units import DEGREE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.scene_assembler import Pose
from vbaa_bench.mechanics.state import EquilibriumError
from vbaa_bench.scene.frames import StepTarget
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

# Maximum movement of the tip [px] from one pose to the next.
STEP_PX = 0.25


def exposure_poses(pose: Pose, scene: Scene, rig: TrueRig) -> list[Pose]:
    """Compute the poses of a frame, an odd number; the requested pose is in the middle.

    The motor turns at constant speed, and the shutter is global. Raises InputError if a pose has no
    equilibrium.
    """
    turn = scene.motor_speed_deg_s * DEGREE * scene.sensor.exposure_s
    if turn == 0:
        return [pose]
    beam = rig.beam
    scale = float(rig.camera.pixels_per_metre(np.array([[beam.length / 2, 0.0, 0.0]]))[0])
    half = math.ceil(abs(turn) * beam.length * scale / STEP_PX / 2)
    fractions = np.arange(-half, half + 1) / (2 * half + 1)
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
