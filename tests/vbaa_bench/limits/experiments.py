"""Pushes of the paper's rig, with their limits, for tests."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from tests.draws import scene_seed
from vbaa_bench.api.scene import Scene
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.limits.frame_limits import FrameLimits
from vbaa_bench.limits.imaged_beam import PLACES
from vbaa_bench.limits.rig_information import RigInformation
from vbaa_bench.scene.frames import Frames
from vbaa_bench.scene.rigs import true_rig


def push(**keys: object) -> list[FrameLimits]:
    """Return the frames of the first push of a scene with other keys than the paper's."""
    pushes = {"contact_distance_mm": [140], "deflection_pct": [5, 10]}
    file = Scene(**{"title": "One push", "seed": scene_seed(1), "pushes": pushes, **keys})
    scene, rig, folder = file.scene, true_rig(file.scene), Path()
    specs = Frames(scene).of_push(0)
    experiment = Experiment(specs[0].scene, rig, specs[0].push, folder)
    states, known = experiment.states(), RigInformation(scene, rig, folder)
    return [
        FrameLimits(known, Pose(experiment, spec, states[spec.step]), np.ones(PLACES))
        for spec in specs
    ]


paper_push = lru_cache(maxsize=1)(push)
