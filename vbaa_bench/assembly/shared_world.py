"""Cache of Mitsuba scenes for frames with equal draws."""

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
class SharedWorld:
    """World of frames with equal draws, built when it is first used.

    Frames with the same `moving_pattern_id` share the world, whose vertices are moved. Frames with
    the same `static_pattern_id` have the same light and the same surfaces that do not move;
    `shared` states whether there may be several of them.
    """

    assembler: SceneAssembler
    static_pattern_id: int
    moving_pattern_id: int
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


def shared_world(
    scene: Scene, rig: TrueRig, folder: Path, spec: FrameSpec, last: SharedWorld | None
) -> SharedWorld:
    """Return the world of a frame: the `last` one, if its draws are equal, or a new one."""
    numbers: dict[Level, int] = {"rig": 0, "push": 1 + spec.push_number, "frame": 1 + spec.index}
    level = _level(scene, _MOVING)
    static_id, moving_id = numbers[level], numbers[_level(scene, _POSE)]
    if last is not None and (last.static_pattern_id, last.moving_pattern_id) == (
        static_id,
        moving_id,
    ):
        return last
    steps = len(spec.push.targets)
    shared = level == "rig" or (level == "push" and steps > 1)
    # Surfaces that frames share must not depend on which of them is rendered first.
    still_scene = scene if level == "rig" else spec.scene
    grime_id = numbers[_grime_level(scene)]
    assembler = SceneAssembler(spec.scene, rig, folder, static_id, moving_id, grime_id, still_scene)
    return SharedWorld(assembler, static_id, moving_id, shared)


def _level(scene: Scene, without: set[str]) -> Level:
    """Return the finest level of the random keys outside of some sections."""
    return _finest(key for key in scene.random_keys if key.key.split(".")[0] not in without)


def _grime_level(scene: Scene) -> Level:
    """Return the level at which the beam gets a new pattern of grime: that of its random keys."""
    return _finest(key for key in scene.random_keys if key.key.startswith("beam.grime"))


def _finest(keys: Iterable[RandomKey]) -> Level:
    """Return the finest level of some random keys."""
    return max((key.per for key in keys), key=LEVELS.index, default="rig")


def draws_new_grime(scene: Scene) -> bool:
    """Test whether frames have other patterns of grime than the rest images."""
    return _grime_level(scene) != "rig"


def rest_grime_id(scene: Scene, number: int) -> int:
    """Number the pattern of grime in a rest image; 0 if all images have the same."""
    return _OF_REST_IMAGES + number if draws_new_grime(scene) else 0


def rest_static_pattern_id(scene: Scene, number: int) -> int:
    """Number the pattern of the surfaces that do not move in a rest image; 0 if all are equal."""
    return 0 if _level(scene, _MOVING) == "rig" else _OF_REST_IMAGES + number
