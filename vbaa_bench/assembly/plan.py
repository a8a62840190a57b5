"""Planning of a scene: reject impossible rigs and pushes before anything is rendered."""

from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Final

from solver.instrument.errors import InputError
from vbaa_bench.assembly.impossible import (
    Extremes,
    board_out_of_view,
    check_files,
)
from vbaa_bench.assembly.pushes import Progress, Pushes, PushSolver, impossible_targets, solve
from vbaa_bench.scene.files import SceneFileError
from vbaa_bench.scene.frames import Frames, FrameSpec, in_order
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.scene.random_scene import RejectedDrawError, accepted
from vbaa_bench.scene.rigs import TrueRig, true_rig

# Pushes that are solved before the first image. Chosen: takes seconds, and includes every push of
# most grids. Of random pushes, the share that is impossible is then known to 6 %.
CHECKED_PUSHES: Final = 64
# Share of these that may be impossible if they are random: as of other random draws.
MAX_IMPOSSIBLE: Final = 0.5


@dataclass(frozen=True)
class Plan:
    """The true rig, and the frames in the order of the files.

    The equilibria are not kept. Solving again gives the same result.
    """

    rig: TrueRig
    frame_specs: tuple[FrameSpec, ...]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.frame_specs)


def plan(
    file: SceneFile,
    *,
    pushes: Collection[int] | None = None,
    progress: Progress = lambda _done, _total: None,
) -> Plan:
    """Solve every push of a scene. Raises InputError that lists all physical impossibilities.

    With `pushes`, only those with these numbers are solved and planned. A push with random values
    that is impossible is drawn again, but a file that cannot be used is an error.
    """
    check_files(file)
    rig, frames = _true_rig(file), Frames(file.scene)
    solver = PushSolver(file.scene, rig, file.folder)
    numbers = range(frames.pushes) if pushes is None else sorted(set(pushes))
    if file.scene.random_keys:
        drawn = Pushes(file, rig, solver)
        specs = [spec for number in numbers for spec in drawn.frames(number)]
    else:
        specs = [spec for number in numbers for spec in frames.of_push(number)]
        mistakes = rig_mistakes(file) + impossible_targets(file, rig)
        if not mistakes:
            extremes = Extremes(file, rig)
            mistakes = solve(file, specs, extremes, solver, progress) + extremes.mistakes()
        if mistakes:
            raise InputError("\n".join(dict.fromkeys(mistakes)))
    return Plan(rig, tuple(in_order(specs)))


def check_possible(file: SceneFile, progress: Progress, remark: Callable[[str], None]) -> None:
    """Check that a scene is possible, with some of its pushes, before anything is rendered.

    Up to CHECKED_PUSHES pushes are solved, evenly spread over all. Further pushes are solved when
    they are rendered. Raises InputError that lists what is impossible: the rig, a push of a grid,
    whose values the scene states, or more than half of random pushes. `remark` gets a sentence if
    fewer are. A file that cannot be used is an error, whether it is drawn or not.
    """
    check_files(file)
    frames = Frames(file.scene)
    count = min(frames.distinct_pushes, CHECKED_PUSHES)
    numbers = [i * frames.distinct_pushes // count for i in range(count)]
    if file.scene.pushes is not None and not file.scene.random_keys:
        plan(file, pushes=numbers, progress=progress)
        return
    if mistakes := rig_mistakes(file):
        raise InputError("\n".join(dict.fromkeys(mistakes)))
    rig, reasons = _true_rig(file), Counter[str]()
    pushes = Pushes(file, rig, PushSolver(file.scene, rig, file.folder))
    for done, number in enumerate(numbers, start=1):
        try:
            pushes.frames(number)
        except SceneFileError:
            raise
        except InputError as error:
            reasons[str(error)] += 1
        progress(done, count)
    if reasons.total() > MAX_IMPOSSIBLE * count:
        raise InputError("\n".join(reason for reason, _ in reasons.most_common(3)))
    if reasons:
        remark(
            f"{reasons.total()} of {count} checked pushes are impossible, such as: "
            f"{reasons.most_common(1)[0][0]}; frames of such pushes are left out"
        )


def rig_mistakes(file: SceneFile) -> list[str]:
    """List what is impossible before any push: a beam or board out of view or hidden by lamps."""
    rig = _true_rig(file)
    return board_out_of_view(file, rig) + Extremes(file, rig).mistakes()


def accepted_rig(file: SceneFile, number: int = 0) -> SceneFile:
    """Draw a rig of a scene that is possible before any push; a scene without random keys is one.

    Raises InputError if no rig is possible, or a file that may be drawn cannot be used.
    """
    check_files(file)
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
