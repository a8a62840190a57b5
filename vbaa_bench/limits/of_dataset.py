"""Information limits of all frames of a dataset, written beside its truth."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from vbaa_bench.assembly.scene_assembler import Pose
from vbaa_bench.dataset.derived import write_limits
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.generation.plan import plan
from vbaa_bench.generation.workers import Pool
from vbaa_bench.limits.table import SCHEMA, LimitsOfPushes
from vbaa_bench.limits.visible_places import visible_in_image
from vbaa_bench.render.variant import activate
from vbaa_bench.scene.frames import Frames, FrameSpec
from vbaa_bench.scene.load import recorded_scene
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

Progress = Callable[[int, int], None]
# Starts and ends of hidden stretches [mm] by frame.
Hidden = dict[str, Sequence[float]]
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
        self, tick: Callable[[], None], pushes: Sequence[Sequence[FrameSpec]], hidden: Hidden
    ) -> list[dict[str, Any]]:
        """Return the rows of some pushes."""

        def visible(pose: Pose) -> Floats:
            return visible_in_image(pose, hidden[pose.spec.frame_id])

        rows = []
        for specs in pushes:
            rows += self._limits.rows(specs, visible)
            tick()
        return rows


def limits_of_dataset(
    root: Path, folder: Path, variant: str, workers: int, progress: Progress
) -> pl.DataFrame:
    """Compute the limits of a dataset's frames, and write them. Returns the table.

    `folder` contains the files that the scene names. Raises InputError.
    """
    layout = Layout(root)
    truth = open_truth(layout.truth, centrelines=False)
    file = recorded_scene(truth.manifest["scene"], folder)
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
    jobs = []
    for first in range(0, len(pushes), _PUSHES):
        some = pushes[first : first + _PUSHES]
        of_job = {spec.frame_id: hidden[spec.frame_id] for spec in itertools.chain(*some)}
        jobs.append(("pushes", (some, of_job)))
    arguments = file.scene, planned.rig, folder, variant
    with Pool(max(1, min(workers, len(jobs))), _Worker, arguments) as pool:
        done = pool.run(jobs, partial(_report, progress, len(pushes)))
    table = pl.DataFrame(list(itertools.chain(*done)), schema=SCHEMA, orient="row")
    write_limits(layout, table.sort("frame_id", "information"))
    return table


def _report(progress: Progress, total: int, done: int) -> None:
    progress(done, total)
