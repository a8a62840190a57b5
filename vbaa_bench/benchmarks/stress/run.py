"""Run the whole table: every row on every rig, in parallel, as a record and as text lines."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import cv2

from solver.instrument.errors import InputError
from vbaa_bench.benchmarks.stress.figures import Figure, figures, missed
from vbaa_bench.benchmarks.stress.rig_results import RigResult, stress_rig
from vbaa_bench.benchmarks.stress.rows import NAMES, ROWS, Row, Targets
from vbaa_bench.workers.pool import Pool

Record = dict[str, Any]
TITLE: Final = (
    "answered, consistent, detected, false: % of frames; RMSE, median |error| of x_c: % of L; "
    "ratio: RMS sigma over RMSE; 95 % intervals over rigs"
)
HEADS: Final = (
    "perturbation",
    "frames",
    "answered",
    "RMSE",
    "median",
    "consistent",
    "ratio",
    "detected",
    "false",
    "target",
    "met",
)


def chosen_rows(names: Sequence[str]) -> tuple[Row, ...]:
    """Find the rows of these names, or all without names. Raises InputError for an unknown one."""
    for name in names:
        if name not in NAMES:
            raise InputError(f"row '{name}' is unknown, allowed is one of {', '.join(NAMES)}")
    return tuple(row for row in ROWS if not names or row.name in names)


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


def lines(records: Sequence[Record]) -> list[tuple[str, ...]]:
    """Format records as rows of a table under HEADS."""
    return [_line(record) for record in records]


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


def _line(record: Record) -> tuple[str, ...]:
    targets = _format_targets(Targets(**record["wanted"]))
    name = f"{record['row']}: {record['done']}"
    if "skipped" in record:
        return (name, "0", *["–"] * 7, targets, f"skipped: {record['skipped']}")
    values = {name: Figure(**figure) for name, figure in record["figures"].items()}
    return (
        name,
        str(record["frames"]),
        _format_figure(values["answered"], "{:.0f}"),
        _format_figure(values["rmse"], "{:.3g}"),
        _format_figure(values["median"], "{:.2g}"),
        _format_figure(values["consistent"], "{:.0f}"),
        _format_figure(values["sigma_ratio"], "{:.2g}"),
        _format_figure(values["detected"], "{:.0f}"),
        _format_figure(values["false"], "{:.0f}"),
        targets,
        f"no: {', '.join(record['missed'])}" if record["missed"] else "yes",
    )


def _format_figure(figure: Figure, template: str) -> str:
    if figure.value is None:
        return "–"
    if figure.low is None:
        return template.format(figure.value)
    return f"{template} ({template}–{template})".format(figure.value, figure.low, figure.high)


def _format_targets(targets: Targets) -> str:
    templates = {
        "answered": "answered {:g}",
        "rmse": "RMSE {:g}",
        "consistent": "consistent {:g}",
        "sigma_ratio": "ratio {:g}",
        "detected": "detected {:g}",
        "alarmed": "alarms {:g}",
        "false": "false {:g}",
    }
    return ", ".join(templates[name].format(bound) for name, bound in targets.record().items())
