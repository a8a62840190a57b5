"""Worlds that frames share: how often a scene with random keys needs new ones."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.render.world import World
from vbaa_bench.scene.distributions import LEVELS, Level
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.random_keys import RandomKey
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

# Keys that change no surface, and sections that only change surfaces that move.
_POSE: Final = {"pushes", "light_level"}
_MOVING: Final = {*_POSE, "object", "second_peg", "occlusion", "beam"}
# Number of the first rest image, beyond those of all frames.
_OF_REST_IMAGES: Final = 2**40


@dataclass
class Look:
    """Everything that frames with the same drawn values share, built when it is first used.

    Frames whose `world_number` is the same share a world, whose vertices are moved. Those whose
    `number` is the same share the light and all surfaces that do not move. `shared` says whether
    several frames do.
    """

    assembler: SceneAssembler
    number: int
    world_number: int
    shared: bool
    world: World | None = None

    def posed_world(self, pose: Pose) -> World:
        """Build the world in a pose, or move its vertices to it."""
        new = self.world is None
        if self.world is None:
            self.world = self.assembler.pushed_world(pose)
        if self.shared or not new:
            self.assembler.repose(self.world, pose)
        return self.world


def look_of(scene: Scene, rig: TrueRig, folder: Path, spec: FrameSpec, last: Look | None) -> Look:
    """Return the look of a frame: the `last` one, if it is the same, or a new one."""
    numbers: dict[Level, int] = {"rig": 0, "push": 1 + spec.push_number, "frame": 1 + spec.index}
    level = _level(scene, _MOVING)
    number, world_number = numbers[level], numbers[_level(scene, _POSE)]
    if last is not None and (last.number, last.world_number) == (number, world_number):
        return last
    steps = len(spec.push.targets)
    shared = level == "rig" or (level == "push" and steps > 1)
    # Surfaces that frames share must not depend on which of them is rendered first.
    still_scene = scene if level == "rig" else spec.scene
    dirt = numbers[_level_of_dirt(scene)]
    assembler = SceneAssembler(spec.scene, rig, folder, number, world_number, dirt, still_scene)
    return Look(assembler, number, world_number, shared)


def _level(scene: Scene, without: set[str]) -> Level:
    """Return the finest level of the random keys outside of some sections."""
    return _finest(key for key in scene.random_keys if key.key.split(".")[0] not in without)


def _level_of_dirt(scene: Scene) -> Level:
    """Return the level at which the beam gets a new pattern of dirt: that of its random keys."""
    return _finest(key for key in scene.random_keys if key.key.startswith("beam.grime"))


def _finest(keys: Iterable[RandomKey]) -> Level:
    """Return the finest level of some random keys."""
    return max((key.per for key in keys), key=LEVELS.index, default="rig")


def draws_new_dirt(scene: Scene) -> bool:
    """Test whether frames have other patterns of dirt than the rest images."""
    return _level_of_dirt(scene) != "rig"


def rest_dirt(scene: Scene, number: int) -> int:
    """Return the number of the pattern of dirt in a rest image; 0 if all images have the same."""
    return _OF_REST_IMAGES + number if draws_new_dirt(scene) else 0


def rest_look(scene: Scene, number: int) -> int:
    """Return the number of the look of a rest image; 0 if all images have the same."""
    return 0 if _level(scene, _MOVING) == "rig" else _OF_REST_IMAGES + number
