"""The stress test: render drawn rigs, run every row on every rig, and compare with the targets."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2

from solver.methods.by_name import check_known
from vbaa_bench.benchmarks.stress.figures import figures, missed
from vbaa_bench.benchmarks.stress.rig_results import RigResult, stress_rig
from vbaa_bench.benchmarks.stress.rigs import drawn_rig, render
from vbaa_bench.benchmarks.stress.rows import Row, chosen_rows
from vbaa_bench.scene.load import SceneFile
from vbaa_bench.workers.pool import Pool

Record = dict[str, Any]


@dataclass(frozen=True)
class Plan:
    """Scene, numbers of rigs and frames, seed, rows (none: all) and method of a stress test."""

    file: SceneFile
    rigs: int
    frames: int
    seed: int
    rows: Sequence[str]
    method: str


def stress(
    plan: Plan,
    work: Path,
    variant: str,
    workers: int,
    progress: Callable[[str, int, int], None],
) -> Record:
    """Make the missing datasets in `work`, and measure all rows.

    `progress(stage, done, total)` counts images of the stage "rendering" and trials of the stage
    "solving". Raises InputError for an unknown row or method, a scene that has no pushes to draw
    from, and a `work` with other contents.
    """
    rows = chosen_rows(plan.rows)
    check_known([plan.method])
    # One folder per seed: another seed does not affect the existing rigs.
    folder = work / f"seed_{plan.seed}_frames_{plan.frames}"
    files = [drawn_rig(plan.file, plan.seed, n, plan.frames) for n in range(plan.rigs)]
    layouts = render(
        files, folder, variant, workers, lambda *counts: progress("rendering", *counts)
    )
    records = measure(
        [layout.root for layout in layouts],
        rows,
        plan.method,
        plan.seed,
        workers,
        lambda *counts: progress("solving", *counts),
    )
    return {
        "scene": plan.file.scene.title,
        "seed": plan.seed,
        "method": plan.method,
        "rigs": plan.rigs,
        "frames": plan.frames,
        "rows": records,
        "holds": not any(row_record.get("missed") for row_record in records),
    }


def measure(
    roots: Sequence[Path],
    rows: Sequence[Row],
    method: str,
    seed: int,
    workers: int,
    progress: Callable[[int, int], None],
) -> list[Record]:
    """Run every row on the datasets of all rigs; one record per row, with every frame's result.

    Raises WorkerDiedError if a process dies, and InputError for an incomplete dataset.
    """
    # Rig after rig, so that images are read again soon after the first time.
    jobs = [
        ("attempt", (root, number, row.name)) for number, root in enumerate(roots) for row in rows
    ]
    with Pool(workers, Trials, (method, seed)) as pool:
        results = pool.run(jobs, lambda done: progress(done, len(jobs)))
    return [_record(row, results[index :: len(rows)], seed) for index, row in enumerate(rows)]


class Trials:
    """Task of a worker process: one row on one rig after another."""

    def __init__(self, method: str, seed: int) -> None:
        self._method, self._seed = method, seed
        cv2.setNumThreads(1)

    def attempt(
        self, piece_done: Callable[[], None], root: Path, number: int, name: str
    ) -> RigResult:
        """Run the row of this name on rig `number`, whose dataset is at `root`."""
        # A row is passed by name: its perturbation is a closure, which cannot be pickled.
        (row,) = chosen_rows([name])
        result = stress_rig(root, number, row, self._method, self._seed)
        piece_done()
        return result


def _record(row: Row, rigs: Sequence[RigResult], seed: int) -> Record:
    tested = [rig for rig in rigs if not rig.skipped]
    record: Record = {"row": row.name, "done": row.done, "wanted": row.wanted.record()}
    if not any(rig.frames for rig in tested):
        skipped = next((rig.skipped for rig in rigs if rig.skipped), "no frame has a contact")
        return record | {"skipped": skipped, "rigs": [asdict(rig) for rig in rigs]}
    values = figures(tested, seed)
    return record | {
        "frames": sum(len(rig.frames) for rig in tested),
        "figures": {name: asdict(figure) for name, figure in values.items()},
        "missed": missed(values, row.wanted),
        "rigs": [asdict(rig) for rig in rigs],
    }


def without_frames(record: Record) -> Record:
    """Leave out the results of single frames."""
    rows = [{key: row[key] for key in row if key != "rigs"} for row in record["rows"]]
    return record | {"rows": rows}


def text(record: Record) -> str:
    """Format a record as JSON."""
    return json.dumps(record, indent=1, allow_nan=False) + "\n"
