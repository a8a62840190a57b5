"""Frames of a scene: each with its opaque names and its own random numbers."""

import hashlib
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.scene.sampling import SamplingSpec
from vbaa_bench.scene.schema import PushSpec, Scene


@dataclass(frozen=True)
class StepTarget:
    """Target of one step of a push: a tip deflection or a pushing angle.

    `deflection` is the tip's displacement across the beam over its length; `pushing_angle` [rad]
    is the motor's rotation. One of the two is None.
    """

    deflection: float | None
    pushing_angle: float | None

    def __str__(self) -> str:
        """Format the target for a plot's legend."""
        if self.deflection is not None:
            return f"{self.deflection / PERCENT:.6g} %"
        return f"{(self.pushing_angle or 0.0) / DEGREE:.6g}°"


@dataclass(frozen=True)
class Push:
    """One push: first contact, then a sequence of targets.

    First contact is at `contact_distance` [m] (None against a wall), with an object whose normal
    is tilted by `normal` [rad] and which yields by `compliance` [m/N]. All, with `gravity` (3,)
    [m/s^2], is in the frame of the antenna at first contact.
    """

    contact_distance: float | None
    normal: float
    compliance: float
    targets: tuple[StepTarget, ...]
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Cover:
    """Occlusion of a frame: its kind and place, and the share of the beam that stays visible."""

    kind: str
    place: str
    availability: float


@dataclass(frozen=True)
class FrameSpec:
    """One frame to make: `step` of a push, in its repetition `repeat`, behind a `cover` or none.

    `index` counts the frames in the scene's grid. `frame_id` and `push_id` are opaque. Frames of
    one repetition of a push share `push_id` and `onset`, the motor's angle [rad] at first contact.
    """

    index: int
    frame_id: str
    push_id: str
    repeat: int
    push: Push
    step: int
    cover: Cover | None
    onset: float

    @property
    def target(self) -> StepTarget:
        """Target of this frame's step."""
        return self.push.targets[self.step]

    def motor_angle(self, pushing_angle: float) -> float:
        """Compute the true motor angle [rad].

        Seen from the camera the motor turns clockwise, which bends the beam to +y.
        """
        return self.onset - pushing_angle


def frame_specs(scene: Scene) -> list[FrameSpec]:
    """List all frames of a scene in the order of their opaque names, which is that of the files."""
    # Names do not depend on the title, nor on the number of random pushes.
    identity = scene.model_dump_json(exclude={"title": True, "sampling": {"count"}})
    # The scene is long and there are many frames, so it is hashed once.
    push_names, frame_names = (
        hashlib.blake2b(f"{kind} {identity} ".encode()) for kind in ("push", "frame")
    )
    pushes = list(_grid(scene.pushes) if scene.pushes else _samples(scene, scene.sampling))
    repeats = range(scene.pushes.repeats if scene.pushes else 1)
    covers = list(_covers(scene))
    specs: list[FrameSpec] = []
    # A push behind another cover counts as another push, so that no method can pair their frames.
    combinations = itertools.product(pushes, repeats, covers)
    # This is a separate random stream, so that no other draw depends on it.
    onsets, draw = _onsets(scene), random_generator(scene, "onset")
    for number, (push, repeat, cover) in enumerate(combinations):
        push_id = _name(push_names, number)
        onset = float(draw.uniform(*onsets)) * DEGREE
        rotated_push = replace(push, gravity=_in_antenna_frame(scene.gravity_m_s2, onset))
        for step in range(len(push.targets)):
            index = len(specs)
            frame_id = _name(frame_names, index)
            specs.append(
                FrameSpec(index, frame_id, push_id, repeat, rotated_push, step, cover, onset)
            )
    return sorted(specs, key=lambda spec: spec.frame_id)


def in_shards(scene: Scene, made: Sequence[FrameSpec]) -> tuple[tuple[FrameSpec, ...], ...]:
    """Cut the frames of a scene into its shards."""
    size = scene.frames_per_shard
    return tuple(tuple(made[i : i + size]) for i in range(0, len(made), size))


def _grid(spec: PushSpec) -> Iterator[Push]:
    targets = [StepTarget(percent * PERCENT, None) for percent in spec.deflection_pct or ()]
    targets += [StepTarget(None, degrees * DEGREE) for degrees in spec.pushing_angle_deg or ()]
    distances = spec.contact_distance_mm or (None,)
    for distance, normal, stiffness in itertools.product(
        distances, spec.normal_deg, spec.stiffness_n_m
    ):
        yield Push(
            None if distance is None else distance * MILLIMETRE,
            normal * DEGREE,
            0.0 if stiffness == "rigid" else 1 / stiffness,
            tuple(targets),
        )


def _samples(scene: Scene, spec: SamplingSpec | None) -> Iterator[Push]:
    assert spec is not None
    for sample in spec.draw(random_generator(scene, "sampling")):
        yield Push(
            sample["contact_distance_mm"] * MILLIMETRE,
            sample["normal_deg"] * DEGREE,
            1 / sample["stiffness_n_m"] if "stiffness_n_m" in sample else 0.0,
            (StepTarget(sample["deflection_pct"] * PERCENT, None),),
        )


def _onsets(scene: Scene) -> tuple[float, float]:
    """Return the range of the motor's angle [deg] at first contact."""
    pushes = scene.pushes or scene.sampling
    assert pushes is not None
    return pushes.motor_angle_at_contact_deg


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


def random_generator(scene: Scene, stream: str, index: int = 0) -> np.random.Generator:
    """Make the generator of one random stream of one frame, independent of all other draws."""
    return np.random.default_rng([scene.seed, index, int.from_bytes(_digest(stream)[:8])])


def render_seed(scene: Scene, stream: str, index: int = 0) -> int:
    """Derive a 32-bit seed for the renderer in the same way."""
    return int(random_generator(scene, stream, index).integers(2**32))


def _name(prefix: "hashlib.blake2b", number: int) -> str:
    """Make an opaque name: the digest of `prefix` with a number appended."""
    digest = prefix.copy()
    digest.update(str(number).encode())
    return digest.digest()[:8].hex()


def _digest(text: str) -> bytes:
    return hashlib.blake2b(text.encode("utf-8")).digest()
