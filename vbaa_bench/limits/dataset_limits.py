"""Information limits of all frames of a dataset, written beside its truth."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.instrument.image_frame import LEARN
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.dataset.derived import write_limits
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.limits.information import Information
from vbaa_bench.limits.table import SCHEMA, LimitsOfPushes
from vbaa_bench.limits.visible_places import visible_in_image
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.frames import Frames, FrameSpec
from vbaa_bench.scene.load import recorded_scene
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene
from vbaa_bench.workers.pool import Pool

Progress = Callable[[int, int], None]
# Starts and ends of hidden stretches [mm] by frame.
Hidden = dict[str, Sequence[float]]
Pushes = Sequence[Sequence[FrameSpec]]
# Pushes of one job. Chosen: a job takes seconds.
_PUSHES: Final = 8


@dataclass
class _Worker:
    """One process that computes limits."""

    scene: Scene
    rig: TrueRig
    folder: Path
    variant: str

    def __post_init__(self) -> None:
        activate(self.variant, 1)
        self._limits = LimitsOfPushes(self.scene, self.rig, self.folder)

    def pushes(
        self,
        on_progress: Callable[[], None],
        pushes: Pushes,
        hidden: Hidden,
        learned: Information | None,
    ) -> list[dict[str, Any]]:
        """Return the rows of some pushes; `learned` is the information to learn from on the rig."""
        rows = []
        for specs in pushes:
            of_others = None if _split(self.scene, specs) == LEARN else learned
            rows += self._limits.rows(specs, partial(_visible, hidden), of_others)
            on_progress()
        return rows

    def on_rig(
        self, _on_progress: Callable[[], None], pushes: Pushes, hidden: Hidden
    ) -> Information:
        """Return the information of some pushes on the rig."""
        total = Information((), np.zeros((0, 0)))
        for specs in pushes:
            total += self._limits.on_rig(specs, partial(_visible, hidden))
        return total


def _visible(hidden: Hidden, pose: Pose) -> Floats:
    return visible_in_image(pose, hidden[pose.spec.frame_id])


def dataset_limits(root: Path, variant: str, workers: int, progress: Progress) -> pl.DataFrame:
    """Compute the limits of a dataset's frames, and write them. Returns the table.

    Raises InputError.
    """
    layout = Layout(root)
    truth = open_truth(layout.truth, centrelines=False)
    file = recorded_scene(truth.manifest["scene"], layout.manifest, layout.files)
    rows = truth.frames.select("frame_id", pl.col("hidden_stretches_mm").fill_null([]))
    hidden: Hidden = dict(rows.iter_rows())
    frames = Frames(file.scene)
    names = itertools.chain.from_iterable(frames.in_shards())
    # Pushes of frames that failed may be impossible.
    planned = plan(
        file, pushes={frames.push_of(name.number) for name in names if name.frame_id in hidden}
    )
    specs = sorted(
        (spec for spec in planned.frame_specs if spec.frame_id in hidden),
        key=lambda spec: (spec.push_number, spec.step),
    )
    if len(specs) < len(hidden):
        raise InputError(
            f"{root}: {len(hidden) - len(specs)} frames are not those of its scene, allowed is a "
            "dataset that this version has generated"
        )
    pushes = [tuple(group) for _, group in itertools.groupby(specs, lambda one: one.push_number)]
    arguments, parts = (file.scene, planned.rig, file.folder, variant), list(_parts(pushes, hidden))
    with Pool(max(1, min(workers, len(parts))), _Worker, arguments) as pool:
        learned = None
        if to_learn := [push for push in pushes if _split(file.scene, push) == LEARN]:
            of_parts = pool.run([("on_rig", part) for part in _parts(to_learn, hidden)])
            learned = sum(of_parts, Information((), np.zeros((0, 0))))
        jobs = [("pushes", (*part, learned)) for part in parts]
        done = pool.run(jobs, partial(_report, progress, len(pushes)))
    table = pl.DataFrame(list(itertools.chain(*done)), schema=SCHEMA, orient="row")
    write_limits(layout, table.sort("frame_id", "information"))
    return table


def _parts(pushes: Pushes, hidden: Hidden) -> Iterator[tuple[Pushes, Hidden]]:
    """Divide pushes into jobs, with what is hidden in their frames."""
    for first in range(0, len(pushes), _PUSHES):
        some = pushes[first : first + _PUSHES]
        frames = itertools.chain.from_iterable(some)
        yield some, {spec.frame_id: hidden[spec.frame_id] for spec in frames}


def _split(scene: Scene, push: Sequence[FrameSpec]) -> str:
    """Return the split of a push; "" if the scene has none."""
    return scene.splits.name(scene.seed, push[0].push_number) if scene.splits else ""


def _report(progress: Progress, total: int, done: int) -> None:
    progress(done, total)
