"""Frames of a scene: each with its opaque names and its own random numbers."""

import hashlib
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.scene.occlusion import REMOVED
from vbaa_bench.scene.push import (
    Push,
    StepTarget,
    expected_pushing_angle,
    grid_push,
    grid_size,
    sampled_push,
    targets,
)
from vbaa_bench.scene.random_scene import accepted, drawn_scene
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import true_gravity
from vbaa_bench.scene.schema import Scene
from vbaa_bench.scene.unit_values import Draw


@dataclass(frozen=True)
class Cover:
    """Occlusion of a frame: its kind and place, and the share of the beam that stays visible."""

    kind: str
    place: str
    availability: float

    @property
    def in_image(self) -> bool:
        """Whether it is a body in the image; else the stretch is only declared as missing."""
        return self.kind != REMOVED


@dataclass(frozen=True)
class FrameSpec:
    """One frame to make: `step` of a push, in its repetition `repeat`, behind a `cover` or none.

    `index` counts the frames in the scene's grid, `push_number` the pushes. `frame_id` and
    `push_id` are opaque. Frames of one repetition of a push share `push_id` and `onset`, the
    motor's angle [rad] at first contact. `scene` has the values that were drawn for this frame, in
    this `attempt`.
    """

    index: int
    frame_id: str
    push_number: int
    push_id: str
    # Larger sets have more rounds; all frames of a round are in files before those of the next.
    round: int
    repeat: int
    push: Push
    step: int
    cover: Cover | None
    onset: float
    attempt: int
    scene: Scene = field(compare=False, repr=False)

    @property
    def target(self) -> StepTarget:
        """Target of this frame's step."""
        return self.push.targets[self.step]

    def motor_angle(self, pushing_angle: float) -> float:
        """Compute the true motor angle [rad].

        Seen from the camera the motor turns clockwise, which bends the beam to +y.
        """
        return self.onset - pushing_angle


class FrameName(NamedTuple):
    """Opaque name of a frame, and its number in the scene's grid."""

    frame_id: str
    number: int


class Frames:
    """All frames of a scene, push by push.

    Pushes are numbered so that those of a larger set come after those of a smaller one: repetition
    by repetition of the grid. A push behind another cover counts as another push, so that no method
    can pair their frames.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        # Names depend on what the scene states, except its title and the size of the set.
        identity = scene.model_dump_json(
            exclude={
                "title": True,
                "rigs": True,
                "sampling": {"count"},
                "pushes": {"repeats"},
            },
            exclude_defaults=True,
        )
        # The scene is long and there are many frames, so it is hashed once.
        self._push_names, self._frame_names = (
            hashlib.blake2b(f"{kind} {identity} ".encode()) for kind in ("push", "frame")
        )
        grid, sampling = scene.pushes, scene.sampling
        self._samples = () if sampling is None else sampling.draw(scene.seed)
        self._grows = sampling is not None and sampling.grows
        self._covers = list(_covers(scene))
        self._grid = grid_size(grid) if grid else len(self._samples)
        self._per_push = len(targets(grid)) if grid else 1
        self._per_repeat = self._grid * len(self._covers)
        self.pushes = (grid.repeats if grid else 1) * self._per_repeat
        # This is a separate random stream, so that no other draw depends on it.
        self._onsets = random_generator(scene, "onset").random(self.pushes)

    @property
    def count(self) -> int:
        """Number of all frames."""
        return self.pushes * self._per_push

    @property
    def shards(self) -> int:
        """Number of shards in which the frames are written."""
        return math.ceil(self.count / self._scene.frames_per_shard)

    @property
    def distinct_pushes(self) -> int:
        """Number of pushes that differ, the first ones; repetitions differ by random keys only."""
        return self.pushes if self._scene.random_keys else self._per_repeat

    def push_of(self, index: int) -> int:
        """Return the number of the push of a frame."""
        return index // self._per_push

    def name(self, index: int) -> FrameName:
        """Name a frame; no value is drawn."""
        return FrameName(_name(self._frame_names, index), index)

    def in_shards(self) -> tuple[tuple[FrameName, ...], ...]:
        """Name all frames, shard by shard, in the order of the files; no value is drawn."""
        names = [
            (self._round(self.push_of(index)), self.name(index)) for index in range(self.count)
        ]
        return _shards(self._scene, [name for _, name in sorted(names)])

    def of_push(self, number: int, attempt: int = 0) -> tuple[FrameSpec, ...]:
        """List the frames of a push, in the order of its steps, with the values of one attempt.

        Raises RejectedDrawError.
        """
        repeat, place = divmod(number, self._per_repeat)
        row, cover = divmod(place, len(self._covers))
        first = number * self._per_push
        scenes = [
            drawn_scene(
                self._scene,
                {"push": Draw("push", number, attempt), "frame": Draw("frame", index, attempt)},
            )
            for index in range(first, first + self._per_push)
        ]
        grid = scenes[0].pushes
        push = grid_push(grid, row) if grid else sampled_push(self._samples[row])
        low, high = scenes[0].motor_angle_at_contact_deg
        onset = float(low + (high - low) * self._onsets[number]) * DEGREE
        if self._per_push == 1:
            onset += expected_pushing_angle(push, scenes[0].beam.length_mm * MILLIMETRE)
        push = replace(push, gravity=_in_antenna_frame(true_gravity(self._scene), onset))
        return tuple(
            FrameSpec(
                first + step,
                self.name(first + step).frame_id,
                number,
                _name(self._push_names, number),
                self._round(number),
                repeat,
                push,
                step,
                self._covers[cover],
                onset,
                attempt,
                scene,
            )
            for step, scene in enumerate(scenes)
        )

    def _round(self, push: int) -> int:
        """Return the round of a push: in a set that grows by pushes, each is a round."""
        repeat, place = divmod(push, self._per_repeat)
        return place // len(self._covers) if self._grows else repeat


def frame_specs(scene: Scene) -> list[FrameSpec]:
    """List all frames of a scene in the order of the files, which reveals nothing about them.

    Within a round this is the order of the opaque names. Of random keys, the first allowed draw
    is taken. Raises InputError if there is none.
    """
    frames = Frames(scene)
    return in_order(
        spec
        for number in range(frames.pushes)
        for spec in accepted(partial(frames.of_push, number), f"push {number}")
    )


def in_order(specs: Iterable[FrameSpec]) -> list[FrameSpec]:
    """Sort frames in the order of the files: round by round, by name."""
    return sorted(specs, key=lambda spec: (spec.round, spec.frame_id))


def _shards(scene: Scene, frames: Sequence[FrameName]) -> tuple[tuple[FrameName, ...], ...]:
    """Cut the frames of a scene into its shards."""
    size = scene.frames_per_shard
    return tuple(tuple(frames[i : i + size]) for i in range(0, len(frames), size))


def _in_antenna_frame(
    vector: tuple[float, float, float], motor_angle: float
) -> tuple[float, float, float]:
    """Rotate a vector of the world to the axes of the antenna at a motor angle [rad]."""
    x, y, z = vector
    cos, sin = math.cos(motor_angle), math.sin(motor_angle)
    return (cos * x + sin * y, cos * y - sin * x, z)


def _covers(scene: Scene) -> Iterator[Cover | None]:
    occlusion = scene.occlusion
    if occlusion is None:
        yield None
        return
    for kind, place, availability in itertools.product(
        occlusion.kind, occlusion.place, occlusion.availability
    ):
        yield Cover(kind, place, availability)


def _name(prefix: "hashlib.blake2b", number: int) -> str:
    """Make an opaque name: the digest of `prefix` with a number appended."""
    digest = prefix.copy()
    digest.update(str(number).encode())
    return digest.digest()[:8].hex()
