"""Solve and score a collection: every rig's dataset, then all their frames together."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import polars as pl

from solver.instrument.errors import InputError
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.bootstrap import share_interval
from vbaa_bench.scoring.child import Job, MethodRun, solve_each
from vbaa_bench.scoring.factors import factor_columns, factor_table, rig_factors
from vbaa_bench.scoring.information import scored_limits
from vbaa_bench.scoring.layout import Results
from vbaa_bench.scoring.metrics import checked_predictions, parsed, read_file, score_frames
from vbaa_bench.scoring.score import found_predictions, write_scores
from vbaa_bench.scoring.statistics import COLLECTION, compute
from vbaa_bench.scoring.strata_table import strata_rows
from vbaa_bench.scoring.summary import summarise


def solve_rigs(
    rigs: Mapping[int, Layout],
    methods: Mapping[str, str],
    centreline: str,
    limits: tuple[int, float, float],
    workers: int,
    done: Callable[[], None],
    hear: Callable[[str], None],
) -> dict[str, MethodRun]:
    """Run methods on all rigs, in `workers` processes; write each rig's predictions by name.

    `methods` are by the names of their predictions. A rig is set up once for all of them, so that a
    method of the user's own must be alone. `done` is called after each rig. Return the numbers of
    frames of all rigs together, with the table of the first rig. Raises InputError if a method
    cannot be found.
    """

    def solve_share(share: Sequence[Layout]) -> list[MethodRun]:
        jobs = [
            Job(method, layout, Results(layout.root).predictions / f"{name}.csv")
            for layout in share
            for name, method in methods.items()
        ]
        runs = []
        for run in solve_each(jobs, centreline, limits, hear):
            runs.append(run)
            if len(runs) % len(methods) == 0:
                done()
        return runs

    datasets = list(rigs.values())
    with ThreadPoolExecutor(workers) as threads:
        shares = [share for n in range(workers) if (share := datasets[n::workers])]
        runs = [run for share in threads.map(solve_share, shares) for run in share]
    by_name = {name: runs[n :: len(methods)] for n, name in enumerate(methods)}
    return {name: _together(of_method) for name, of_method in by_name.items()}


def _together(runs: Sequence[MethodRun]) -> MethodRun:
    """Add up the frames of a method's runs; they are refused if those of every rig are."""
    refusal = runs[0].refusal if all(run.refusal for run in runs) else ""
    traceback = next((run.traceback for run in runs if run.traceback), "")
    frames, crashed = sum(run.frames for run in runs), sum(run.crashed for run in runs)
    return MethodRun(runs[0].table, frames, crashed, traceback, refusal)


def score_rigs(root: Path, names: Sequence[str] | None = None) -> dict[str, Any]:
    """Score the predictions of all rigs; write the tables of `score` and factors.csv.

    `names` are those of methods, by default all that have predictions. Each row has the number of
    its rig, and the values in which rigs and frames differ. Intervals are over rigs. Raises
    InputError.
    """
    scored: list[pl.DataFrame] = []
    for number, layout in CollectionLayout(root).rigs().items():
        results, truth = Results(layout.root), open_truth(layout.truth, centrelines=False)
        limits = scored_limits(layout)
        columns = factor_columns(truth)
        for name, path in found_predictions(results).items():
            if names is None or name in names:
                table = checked_predictions(parsed(read_file(path), path), str(path))
                rows = score_frames(truth, table, name, str(path), limits)
                rows = rows.join(columns, on="frame_id", how="left")
                scored.append(rows.with_columns(rig=pl.lit(number), **rig_factors(truth)))
    if not scored:
        raise InputError(f"{root}: no rig has predictions; solve the collection first")
    scores = pl.concat(scored, how="diagonal_relaxed")
    parameters = strata_rows(scores, over=("rig",))
    summary = {
        **summarise(scores, parameters, over=("rig",)),
        "rigs": scores["rig"].n_unique(),
        "warnings": [],
    }
    for (name,), rows in scores.group_by("method", maintain_order=True):
        summary["methods"][name] |= _over_rigs(rows)
    tables = {"factors.csv": factor_table(scores)}
    write_scores(Results(root).scores, scores, parameters, summary, tables)
    return summary


def _over_rigs(rows: pl.DataFrame) -> dict[str, Any]:
    """Compute figures that count rigs: the interval of the consistent share, and `COLLECTION`."""
    rigs = rows.group_by("rig", maintain_order=True).agg(pl.col("consistent").sum(), cases=pl.len())
    counts = rigs.select(pl.col("consistent", "cases").cast(pl.Float64))
    ends = share_interval(counts["consistent"].to_numpy(), counts["cases"].to_numpy())
    return {
        "consistent_rate_95": None if ends is None else list(ends),
        **compute(COLLECTION, rows),
    }
