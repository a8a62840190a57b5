"""Scene -> trials: every frame with its opaque names and its own random numbers."""

import hashlib
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.spec.sampling import SamplingSpec
from vbaa_bench.spec.scene import PushSpec, Scene


@dataclass(frozen=True)
class Goal:
    """How far a step of a push goes: until the tip has moved across the beam by `deflection` of
    its length, or until the motor has turned by `pushing_angle` [rad]; one of the two is None."""

    deflection: float | None
    pushing_angle: float | None

    def __str__(self) -> str:
        """The same, as a plot's legend says it."""
        if self.deflection is not None:
            return f"{self.deflection / PERCENT:.6g} %"
        return f"{(self.pushing_angle or 0.0) / DEGREE:.6g}°"


@dataclass(frozen=True)
class Push:
    """One push: first contact at `contact_distance` [m] (None against a wall), with an object
    whose normal is tilted by `normal` [rad] and which yields by `compliance` [m/N]; then on from
    goal to goal."""

    contact_distance: float | None
    normal: float
    compliance: float
    goals: tuple[Goal, ...]


@dataclass(frozen=True)
class Cover:
    """What is hidden in a frame, how and where, and the share of the beam that stays visible."""

    kind: str
    place: str
    availability: float


@dataclass(frozen=True)
class Trial:
    """One frame to be made: `step` of a push, seen `repeat` times, behind a `cover` or none.

    `index` counts the grid of the scene; `frame_id` and `push_id` tell nothing, but that frames
    of one repetition of a push share the latter.
    """

    index: int
    frame_id: str
    push_id: str
    repeat: int
    push: Push
    step: int
    cover: Cover | None

    @property
    def goal(self) -> Goal:
        """How far it is pushed."""
        return self.push.goals[self.step]


def trials(scene: Scene) -> list[Trial]:
    """All trials of a scene, in the order of their opaque names, which is that of the files."""
    # A title names nothing, and frames keep their names when more are drawn.
    identity = scene.model_dump_json(exclude={"title": True, "sampling": {"count"}})
    pushes = list(_grid(scene.pushes) if scene.pushes else _samples(scene, scene.sampling))
    repeats = range(scene.pushes.repeats if scene.pushes else 1)
    hidden = list(_covers(scene))
    made: list[Trial] = []
    # A push behind another cover is another push: its frames are no twins for a method to pair.
    seen = itertools.product(pushes, repeats, hidden)
    for number, (push, repeat, cover) in enumerate(seen):
        push_id = _digest(f"push {identity} {number}")[:8].hex()
        for step in range(len(push.goals)):
            index = len(made)
            frame_id = _digest(f"frame {identity} {index}")[:8].hex()
            made.append(Trial(index, frame_id, push_id, repeat, push, step, cover))
    return sorted(made, key=lambda trial: trial.frame_id)


def frame_count(scene: Scene) -> int:
    """Count the frames of a scene without listing them; of a sampled grid about so many."""
    hidden, hiding = 1, scene.occlusion
    if hiding is not None:
        hidden = len(hiding.kind) * len(hiding.place) * len(hiding.availability)
    if scene.sampling is not None:
        return scene.sampling.count * hidden
    spec = scene.pushes
    assert spec is not None
    goals = len(spec.deflection_pct or ()) + len(spec.pushing_angle_deg or ())
    pushes = len(spec.contact_distance_mm or (None,)) * len(spec.normal_deg)
    return pushes * len(spec.stiffness_n_m) * spec.repeats * goals * hidden


def in_shards(scene: Scene, made: Sequence[Trial]) -> tuple[tuple[Trial, ...], ...]:
    """Cut the trials of a scene into its shards."""
    size = scene.frames_per_shard
    return tuple(tuple(made[i : i + size]) for i in range(0, len(made), size))


def _grid(spec: PushSpec) -> Iterator[Push]:
    goals = [Goal(percent * PERCENT, None) for percent in spec.deflection_pct or ()]
    goals += [Goal(None, degrees * DEGREE) for degrees in spec.pushing_angle_deg or ()]
    distances = spec.contact_distance_mm or (None,)
    for distance, normal, stiffness in itertools.product(
        distances, spec.normal_deg, spec.stiffness_n_m
    ):
        yield Push(
            None if distance is None else distance * MILLIMETRE,
            normal * DEGREE,
            0.0 if stiffness == "rigid" else 1 / stiffness,
            tuple(goals),
        )


def _samples(scene: Scene, spec: SamplingSpec | None) -> Iterator[Push]:
    assert spec is not None
    for drawn in spec.draw(random_generator(scene, "sampling")):
        yield Push(
            drawn["contact_distance_mm"] * MILLIMETRE,
            drawn["normal_deg"] * DEGREE,
            1 / drawn["stiffness_n_m"] if "stiffness_n_m" in drawn else 0.0,
            (Goal(drawn["deflection_pct"] * PERCENT, None),),
        )


def _covers(scene: Scene) -> Iterator[Cover | None]:
    hiding = scene.occlusion
    if hiding is None:
        yield None
        return
    for kind, place, availability in itertools.product(
        hiding.kind, hiding.place, hiding.availability
    ):
        yield Cover(kind, place, availability)


def random_generator(scene: Scene, stage: str, trial: int = 0) -> np.random.Generator:
    """The generator of one stage of one trial: the same whatever else is made, and by whom."""
    return np.random.default_rng([scene.seed, trial, int.from_bytes(_digest(stage)[:8])])


def render_seed(scene: Scene, stage: str, trial: int = 0) -> int:
    """A 32-bit seed for the renderer, from the same derivation."""
    return int(random_generator(scene, stage, trial).integers(2**32))


def _digest(text: str) -> bytes:
    return hashlib.blake2b(text.encode("utf-8")).digest()
