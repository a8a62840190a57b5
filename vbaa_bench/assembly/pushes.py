"""Pushes of a scene: draw, solve and check them."""

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.units import MILLIMETRE
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.impossible import Extremes, too_far_or_near, too_fine
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.mechanics.state import EquilibriumError, State
from vbaa_bench.scene.files import SceneFileError
from vbaa_bench.scene.frames import Frames, FrameSpec
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.part import KeyPath
from vbaa_bench.scene.push import Push
from vbaa_bench.scene.random_scene import RejectedDrawError, accepted
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

# Called with what is done and the total.
Progress = Callable[[int, int], None]
# Number of pushes whose states are cached. Chosen: those of a round of most grids, in 12 MB.
CACHED_PUSHES: Final = 64
SolvedPush = tuple[Experiment, list[State]]


@dataclass(frozen=True)
class _DrawnPush:
    """A push, and the scene with the values that were drawn for it by number and attempt."""

    push: Push
    draw: tuple[int, int] | None
    scene: Scene = field(compare=False)


@dataclass
class PushSolver:
    """Solver of the pushes of a scene; the states of the last ones are cached.

    Frames of one push are not consecutive. `folder` contains the files that the scene names.
    """

    scene: Scene
    rig: TrueRig
    folder: Path

    def __post_init__(self) -> None:
        self._cached = functools.lru_cache(maxsize=CACHED_PUSHES)(self._solved)

    def solved(self, spec: FrameSpec) -> SolvedPush:
        """Solve the push of a frame; return the states of its steps. Raises EquilibriumError."""
        # Repetitions of a push are equal, unless values are drawn for each.
        draw = (spec.push_number, spec.attempt) if self.scene.random_keys else None
        return self._cached(_DrawnPush(spec.push, draw, spec.scene))

    def pose(self, spec: FrameSpec) -> Pose:
        """Solve the push of a frame; return the frame's pose. Raises EquilibriumError."""
        experiment, states = self.solved(spec)
        return Pose(experiment, spec, states[spec.step])

    def _solved(self, drawn: _DrawnPush) -> SolvedPush:
        experiment = Experiment(drawn.scene, self.rig, drawn.push, self.folder)
        return experiment, experiment.states()


@dataclass
class Pushes:
    """Pushes of a scene by number, each drawn, solved and checked when it is requested."""

    file: SceneFile
    rig: TrueRig
    solver: PushSolver

    def __post_init__(self) -> None:
        self._frames = Frames(self.file.scene)
        self.frames = functools.lru_cache(maxsize=CACHED_PUSHES)(self._drawn)

    @property
    def count(self) -> int:
        """Number of frames of all pushes."""
        return self._frames.count

    def frame(self, index: int) -> FrameSpec:
        """Return a frame. Raises InputError if its push is impossible."""
        return next(
            spec for spec in self.frames(self._frames.push_of(index)) if spec.index == index
        )

    def _drawn(self, number: int) -> tuple[FrameSpec, ...]:
        """List the frames of a push. Raises InputError if it is impossible.

        A push with random values that is impossible is drawn again.
        """
        if self.file.scene.random_keys:
            return accepted(partial(self._possible, number), f"push {number}")
        try:
            return self._possible(number, 0)
        except RejectedDrawError as error:
            raise InputError(str(error)) from error

    def _possible(self, number: int, attempt: int) -> tuple[FrameSpec, ...]:
        """List the frames of a push in one attempt. Raises RejectedDrawError."""
        specs = self._frames.of_push(number, attempt)
        # Steps of a push differ at most in their looks.
        for spec in {id(spec.scene): spec for spec in specs}.values():
            drawn = self.file.with_scene(spec.scene)
            extremes = Extremes(drawn, self.rig)
            mistakes = impossible_targets(drawn, self.rig)
            if not mistakes and spec is specs[0]:
                mistakes = solve(drawn, specs, extremes, self.solver)
            mistakes += extremes.mistakes()
            if mistakes:
                raise RejectedDrawError((), mistakes[0])
        return specs


def impossible_targets(file: SceneFile, rig: TrueRig) -> list[str]:
    """List the contact distances that the beam does not have, and a ground that is too fine."""
    return too_far_or_near(file, rig) + too_fine(file, rig)


def solve(
    file: SceneFile,
    specs: Iterable[FrameSpec],
    extremes: Extremes,
    solver: PushSolver,
    progress: Progress = lambda _done, _total: None,
) -> list[str]:
    """Solve the pushes of some frames, add their states to `extremes`, and list what is impossible.

    Pushes that are equal except for their onset are solved once. `progress(done, total)` is called
    after each.
    """
    onsets: dict[Push, set[float]] = {}
    firsts: dict[Push, FrameSpec] = {}
    for spec in specs:
        onsets.setdefault(spec.push, set()).add(spec.onset)
        firsts.setdefault(spec.push, spec)
    mistakes = []
    for done, (push, spec) in enumerate(firsts.items(), start=1):
        try:
            extremes.add(*solver.solved(spec), onsets[push])
        except EquilibriumError as error:
            mistakes.append(file.message_at(_key(file, push), f"{_description(push)}: {error}"))
        except SceneFileError:
            raise
        except InputError as error:
            mistakes.append(file.message_at(("object",), f"is not possible: {error}"))
        progress(done, len(firsts))
    return mistakes


def _key(file: SceneFile, push: Push) -> KeyPath:
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
