"""What a frame shows beside the beam: meshes of object, occluder, clamp and hub, and the board."""

from collections.abc import Collection, Iterator
from typing import Final

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.transforms import apply
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.pushes import PushSolver
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.geometry.board import cells
from vbaa_bench.mechanics.state import EquilibriumError
from vbaa_bench.scene.frames import Frames, FrameSpec
from vbaa_bench.scene.load import recorded_scene
from vbaa_bench.scene.rigs import nominal_rig

# Surfaces that are shown. The ground and the things on it would hide the rest.
_SHOWN: Final = ("object", "second_peg", "occluder", "hub", "adaptor", "jaw", "flange", "cable")


class Bodies:
    """Bodies in some frames of a dataset, from the scene in its manifest.

    The pushes of these frames are solved again, which gives the states of the truth. `reason` is a
    sentence on why no body can be built, or empty.
    """

    def __init__(self, truth: Truth, trials: Collection[int]) -> None:
        layout = Layout(truth.root.parent)
        self.reason, self._folder = "", layout.files
        self._specs: dict[int, FrameSpec] = {}
        try:
            file = recorded_scene(truth.manifest["scene"], layout.manifest, layout.files)
            frames = Frames(file.scene)
            planned = plan(file, pushes={frames.push_of(trial) for trial in trials})
        except (InputError, EquilibriumError) as error:
            self.reason = str(error).partition("\n")[0]
            return
        self._scene, self._rig = file.scene, planned.rig
        self._pushes = PushSolver(file.scene, planned.rig, self._folder)
        self._specs = {spec.index: spec for spec in planned.frame_specs}

    def board_lines(self) -> list[Floats]:
        """Compute the edges of the board's cells in view 0, lines (2, 3) [mm]."""
        if self.reason:
            return []
        x, y, _ = cells(nominal_rig(self._scene).board)
        down = [np.array([(at, y[0], 0.0), (at, y[-1], 0.0)]) for at in x]
        across = [np.array([(x[0], at, 0.0), (x[-1], at, 0.0)]) for at in y]
        pose = self._rig.antenna_from_board
        return [apply(pose, line) / MILLIMETRE for line in (*down, *across)]

    def of_frame(self, trial: int) -> Iterator[tuple[str, trimesh.Trimesh]]:
        """Yield name and mesh [m] of each body, in the frame in which the camera is fixed."""
        spec = self._specs.get(trial)
        if spec is None:
            return
        assembler = SceneAssembler(spec.scene, self._rig, self._folder)
        surfaces = assembler.surfaces(self._pushes.pose(spec))
        yield from ((name, surfaces[name].mesh) for name in _SHOWN if name in surfaces)
