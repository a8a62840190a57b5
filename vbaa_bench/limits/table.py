"""Information limits of all frames of a scene as a table."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.pushes import PushSolver
from vbaa_bench.limits.frame_limits import FrameLimits
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.push_limits import PushLimits
from vbaa_bench.limits.rig_information import RigInformation
from vbaa_bench.limits.simple_model import SimpleFit, SimpleModel
from vbaa_bench.mechanics.state import EquilibriumError
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene
from vbaa_bench.scoring.score_columns import LIMITS

T = TypeVar("T")
Visible = Callable[[Pose], Floats]

# As declared with the scores. Bias and sigma of the simple model are those of a method that assumes
# a uniform beam and one contact without friction, in frames without these.
SCHEMA: Final = {name: column.kind.dtype for name, column in LIMITS.items()}
# SI units of the columns of QUANTITIES.
_UNITS: Final = (MILLIMETRE, MILLIMETRE, 1.0, DEGREE, MILLIMETRE, 1.0)
_SIMPLE_UNITS: Final = _UNITS[:4]
_COMPLIANCE_UNIT: Final = MILLIMETRE
# Information sets for which the simple model is fitted.
_WITH_SIMPLE: Final = frozenset({"planar", "learned", "image"})


class Limit(NamedTuple):
    """Limits of a frame in an information set.

    `quantities` (6,) are those of QUANTITIES, `compliance` [m/N] that of the object's. `simple` is
    what the simple model reaches, if the frame breaks its assumptions.
    """

    step: int
    information: str
    quantities: Floats
    compliance: float = np.nan
    simple: SimpleModel | None = None

    def row(self, frame_id: str) -> dict[str, Any]:
        """Return a row with the columns of SCHEMA; a limit that is not finite is null."""
        missing = np.full(len(_SIMPLE_UNITS), np.nan)
        limits = self.quantities / _UNITS
        bias, sigmas = (of / _SIMPLE_UNITS for of in self.simple or SimpleModel(missing, missing))
        values = (*limits, self.compliance / _COMPLIANCE_UNIT, *bias, *sigmas)
        numbers = (float(value) if np.isfinite(value) else None for value in values)
        return dict(zip(SCHEMA, (frame_id, self.information, *numbers), strict=True))


@dataclass
class LimitsOfPushes:
    """Computation of the limits of a scene's frames, push by push.

    `folder` contains the files that the scene names.
    """

    scene: Scene
    rig: TrueRig
    folder: Path

    def __post_init__(self) -> None:
        self._rig = RigInformation(self.scene, self.rig, self.folder)
        self._pushes = PushSolver(self.scene, self.rig, self.folder)
        # Repetitions of a push differ in nothing that matters here.
        self._repeated: dict[object, list[Limit]] = {}

    def rows(
        self,
        specs: Sequence[FrameSpec],
        visible: Visible,
        learned: Information | None = None,
    ) -> list[dict[str, Any]]:
        """Return the rows of the frames of one push; none of a frame without contact.

        There are none in a scene of linear mechanics, as the limits are those of the exact beam,
        nor under a hung weight, whose force is not normal to the beam.

        `visible` computes the visible fraction (n,) of PLACES equal parts of the beam; `learned` is
        the information of other pushes on the rig.
        """
        if self.scene.mechanics == "linear" or specs[0].scene.object.mass() is not None:
            return []
        key = self._key(specs[0])
        limits = self._repeated.get(key)
        if limits is None or key is None:
            limits = list(self._limits(self._frames(specs, visible, learned)))
            self._repeated[key] = limits
        names = {spec.step: spec.frame_id for spec in specs}
        return [limit.row(names[limit.step]) for limit in limits]

    def on_rig(self, specs: Sequence[FrameSpec], visible: Visible) -> Information:
        """Return the information of the images of one push on the rig."""
        total = Information((), np.zeros((0, 0)))
        if self.scene.mechanics == "linear":
            return total
        for one in _solvable(frame.on_rig for frame in self._frames(specs, visible)):
            total += one
        return total

    def _frames(
        self, specs: Sequence[FrameSpec], visible: Visible, learned: Information | None = None
    ) -> list[FrameLimits]:
        """Solve the frames of one push; only those with contact have limits."""
        poses = map(self._pushes.pose, specs)
        return [
            FrameLimits(self._rig, pose, visible(pose), learned)
            for pose in poses
            if pose.state.contacts
        ]

    def _limits(self, frames: Sequence[FrameLimits]) -> Iterator[Limit]:
        for frame in frames:
            simple_model = cache(partial(_simple_model, frame))
            for name, values in _solvable(frame.by_set()):
                known = name in _WITH_SIMPLE
                simple = simple_model(planar=name != "image") if known else None
                yield Limit(frame.pose.spec.step, name, values, simple=simple)
        together = _solvable(PushLimits(frames).limits())
        for frame, values in zip(frames, together, strict=False):
            yield Limit(frame.pose.spec.step, "push", values[:-1], float(values[-1]))

    def _key(self, spec: FrameSpec) -> object:
        """Return what distinguishes pushes; None if every push differs."""
        if self.scene.random_keys or spec.cover is not None:
            return None
        # A camera that is fixed in the world sees the motor's angle.
        return spec.push, spec.onset if self.scene.camera.mount == "world" else None


def _simple_model(frame: FrameLimits, planar: bool) -> SimpleModel | None:
    """Fit the simple model, in plane C or in any; None if it is not needed, or does not fit."""
    fit = SimpleFit(frame, planar)
    if not fit.is_needed:
        return None
    try:
        return fit.result()
    except EquilibriumError:
        return None


def _solvable(values: Iterable[T]) -> Iterator[T]:
    """Yield values until there is no equilibrium next to a frame's own, from which to derive one.

    At the edge of what is possible a limit does not exist.
    """
    try:
        yield from values
    except EquilibriumError:
        return
