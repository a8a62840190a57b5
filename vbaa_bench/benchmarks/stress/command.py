"""The command: draw and render rigs, run every row, compare the table with its targets."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from solver.instrument.errors import InputError
from solver.methods import METHODS
from vbaa_bench.benchmarks.stress.rigs import drawn_rig, render
from vbaa_bench.benchmarks.stress.run import Record, chosen_rows, measure
from vbaa_bench.scene.load import SceneFile


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
    if plan.method not in METHODS:
        raise InputError(
            f"method '{plan.method}' is unknown, allowed is one of {', '.join(METHODS)}"
        )
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


def without_frames(record: Record) -> Record:
    """Leave out the results of single frames."""
    rows = [{key: row[key] for key in row if key != "rigs"} for row in record["rows"]]
    return record | {"rows": rows}


def text(record: Record) -> str:
    """Format a record as JSON."""
    return json.dumps(record, indent=1, allow_nan=False) + "\n"
