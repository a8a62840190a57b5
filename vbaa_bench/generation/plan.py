"""Planning of a dataset: solve every push of a scene, and reject impossible ones."""

import itertools
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.generation.impossible import (
    Extremes,
    board_out_of_view,
    environment_is_readable,
    images_are_readable,
    too_far_or_near,
    too_fine,
)
from vbaa_bench.mechanics.state import EquilibriumError
from vbaa_bench.scene.frames import Frames, FrameSpec, Push, in_order, in_shards
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.mistakes import Key
from vbaa_bench.scene.random_scene import RejectedDrawError, accepted
from vbaa_bench.scene.rigs import TrueRig, true_rig
from vbaa_bench.scene.schema import Scene

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Plan:
    """The true rig, the frames in shards, and the worst residual of all their equilibria.

    The equilibria are not kept, because a training set has millions. Solving again gives the same
    result.
    """

    rig: TrueRig
    shards: tuple[tuple[FrameSpec, ...], ...]
    worst_residual: float

    @property
    def frames(self) -> int:
        """Number of frames in all shards."""
        return sum(len(shard) for shard in self.shards)

    @property
    def frame_specs(self) -> Iterator[FrameSpec]:
        """All frames, shard by shard."""
        return itertools.chain.from_iterable(self.shards)


def plan(
    file: SceneFile,
    progress: Progress = lambda _done, _total: None,
    *,
    pushes: Collection[int] | None = None,
) -> Plan:
    """Solve every push of a scene. Raises InputError that lists all physical impossibilities.

    With `pushes`, only those with these numbers are solved and planned. A push with random values
    that is impossible is drawn again.
    """
    scene = file.scene
    rig = _true_rig(file)
    frames = Frames(scene)
    numbers = range(frames.pushes) if pushes is None else sorted(set(pushes))
    if scene.random_keys:
        drawn = _drawn_pushes(file, rig, frames, numbers, progress)
        by_push, residuals = zip(*drawn, strict=True)
        return _planned(scene, rig, itertools.chain.from_iterable(by_push), max(residuals))
    specs = [spec for number in numbers for spec in frames.of_push(number)]
    extremes = Extremes(file, rig)
    mistakes = rig_mistakes(file) + _impossible_targets(file, rig)
    if not mistakes:
        mistakes = _solve(file, rig, specs, extremes, progress) + extremes.mistakes()
    if mistakes:
        raise InputError("\n".join(dict.fromkeys(mistakes)))
    return _planned(scene, rig, specs, extremes.residual)


def _planned(scene: Scene, rig: TrueRig, specs: Iterable[FrameSpec], residual: float) -> Plan:
    return Plan(rig, in_shards(scene, in_order(specs)), residual)


def rig_mistakes(file: SceneFile) -> list[str]:
    """List what is impossible before any push: a beam or a board out of view, or hidden by lamps.

    Raises InputError if a file that the scene names cannot be used.
    """
    rig = _true_rig(file)
    environment_is_readable(file)
    images_are_readable(file)
    return board_out_of_view(file, rig) + Extremes(file, rig).mistakes()


def accepted_rig(file: SceneFile, number: int = 0) -> SceneFile:
    """Draw a rig of a scene that is possible before any push; a scene without random keys is one.

    Raises InputError if no rig is possible.
    """
    if not file.is_random:
        return file

    def attempted(attempt: int) -> SceneFile:
        rig = file.rig(number, attempt)
        if mistakes := rig_mistakes(rig):
            raise RejectedDrawError((), mistakes[0])
        return rig

    return accepted(attempted, f"{file.path}: rig {number}")


def _true_rig(file: SceneFile) -> TrueRig:
    try:
        return true_rig(file.scene)
    except ValueError as error:
        raise InputError(file.message_at(("camera", "look_at_mm"), str(error))) from error


def _impossible_targets(file: SceneFile, rig: TrueRig) -> list[str]:
    return too_far_or_near(file, rig) + too_fine(file, rig)


def _drawn_pushes(
    file: SceneFile, rig: TrueRig, frames: Frames, numbers: Sequence[int], progress: Progress
) -> Iterator[tuple[tuple[FrameSpec, ...], float]]:
    """Draw pushes that are possible; yield the frames of each, and its worst residual."""

    def attempted(number: int, attempt: int) -> tuple[tuple[FrameSpec, ...], float]:
        specs = frames.of_push(number, attempt)
        residual = 0.0
        # Steps of a push differ at most in their looks.
        for spec in {id(spec.scene): spec for spec in specs}.values():
            drawn = replace(file, scene=spec.scene)
            extremes = Extremes(drawn, rig)
            mistakes = _impossible_targets(drawn, rig)
            if not mistakes and spec is specs[0]:
                mistakes = _solve(drawn, rig, specs, extremes, lambda _done, _total: None)
            mistakes += extremes.mistakes()
            if mistakes:
                raise RejectedDrawError((), mistakes[0])
            residual = max(residual, extremes.residual)
        return specs, residual

    for done, number in enumerate(numbers):
        yield accepted(partial(attempted, number), f"{file.path}: push {number}")
        progress(done + 1, len(numbers))


def _solve(
    file: SceneFile,
    rig: TrueRig,
    specs: Iterable[FrameSpec],
    extremes: Extremes,
    progress: Progress,
) -> list[str]:
    """Solve the pushes of some frames, add their states to `extremes`, and list what is impossible.

    Pushes that are equal except for their onset are solved once.
    """
    mistakes = []
    pushes: dict[Push, set[float]] = {}
    for spec in specs:
        pushes.setdefault(spec.push, set()).add(spec.onset)
    for number, (push, onsets) in enumerate(pushes.items()):
        experiment = Experiment(file.scene, rig, push, file.path.parent)
        try:
            extremes.add(experiment, experiment.states(), onsets)
        except EquilibriumError as error:
            mistakes.append(file.message_at(_key(file, push), f"{_description(push)}: {error}"))
        except InputError as error:
            mistakes.append(file.message_at(("object",), f"is not possible: {error}"))
        progress(number + 1, len(pushes))
    return mistakes


def _key(file: SceneFile, push: Push) -> tuple[Key, ...]:
    """Find the key of the scene file that defines a push."""
    pushes = file.scene.pushes
    if pushes is None:
        return ("sampling", "contact_distance_mm")
    if push.contact_distance is None or pushes.contact_distance_mm is None:
        return ("object", "gap_mm")
    distances = np.array(pushes.contact_distance_mm) * MILLIMETRE
    index = int(np.argmin(np.abs(distances - push.contact_distance)))
    return ("pushes", "contact_distance_mm", index)


def _description(push: Push) -> str:
    targets = f"pushed to {', '.join(map(str, push.targets))}"
    if push.contact_distance is None:
        return targets
    return f"is {push.contact_distance / MILLIMETRE:g}, {targets}"
