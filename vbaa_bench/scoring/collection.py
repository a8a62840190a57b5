"""Solve and score a collection: every rig's dataset, then all their frames together."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from solver.instrument.errors import InputError
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.child import Job, MethodRun, solve_each
from vbaa_bench.scoring.factors import factor_columns, factor_table, rig_factors
from vbaa_bench.scoring.information import scored_limits
from vbaa_bench.scoring.layout import Results
from vbaa_bench.scoring.metrics import checked_predictions, parsed, read_file, score_frames
from vbaa_bench.scoring.parameters import parameter_rows
from vbaa_bench.scoring.score import found_predictions, write_scores
from vbaa_bench.scoring.summary import CONTACTS, summarise

# SNR above which a contact should be found. From the requirement on collections.
_CLEAR_SNR: Final = 10.0


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
    parameters = parameter_rows(scores, over=("rig",))
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
    """Compute figures that count rigs: intervals of the consistent share, and detection.

    `x_c_rms_in_sigmas` is the root mean square of the errors in stated sigmas, 1 if these are
    right; `detection_rate_snr_10` the share of the frames with an SNR above 10 that have values.
    """
    shares = [
        (float(group["consistent"].sum()), group.height)
        for _, group in rows.group_by("rig", maintain_order=True)
    ]
    in_sigmas = rows["x_c_error_in_sigmas"].drop_nulls().to_numpy()
    clear = rows.filter(~pl.col("free") & (pl.col("snr") > _CLEAR_SNR))
    return {
        "consistent_rate_95": share_interval(shares),
        "x_c_rms_in_sigmas": float(np.sqrt(np.mean(in_sigmas**2))) if len(in_sigmas) else None,
        "detection_rate_snr_10": (
            clear.filter(pl.col("outcome").is_in(CONTACTS)).height / clear.height
            if clear.height
            else None
        ),
    }


def share_interval(groups: Sequence[tuple[float, int]]) -> list[float] | None:
    """Compute the 95 % bootstrap interval over groups of a share, each (successes, cases).

    None for fewer than two groups.
    """
    if len(groups) < 2:
        return None
    successes, cases = np.array(groups).T
    draws = np.random.default_rng(0).integers(len(groups), size=(2000, len(groups)))
    shares = successes[draws].sum(1) / cases[draws].sum(1)
    return [float(value) for value in np.quantile(shares, [0.025, 0.975])]
