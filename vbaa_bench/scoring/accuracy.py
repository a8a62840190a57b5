"""Accuracy of methods on scored datasets: one row per scene and method, and one for the bound."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.errors import InputError
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.conditions import CONDITIONS, STRATA
from vbaa_bench.scoring.remarks import remarks
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import read_scores
from vbaa_bench.scoring.scored_quantities import LIMITED
from vbaa_bench.scoring.statistics import RMS, TABLE, compute
from vbaa_bench.scoring.strata import class_order, with_labels
from vbaa_bench.scoring.summary import summarise_method

Row = dict[str, Any]

# Name of the rows of the information limits.
BOUND: Final = "bound"
# And of what a method reaches that assumes a uniform beam and one contact without friction, where
# every frame breaks these assumptions.
SIMPLE_MODEL: Final = "simple model"


def accuracy(datasets: Sequence[Path], by: str | None = None) -> list[Row]:
    """Tabulate each method's accuracy on each dataset; `by` splits by a condition or stratum.

    Where information limits were computed, a row follows for each information set that the methods
    use, "bound (image)": the RMSE of an unbiased method that attains the limit in every frame with
    contact. Where all frames break the assumptions of the simple model, "simple model (planar)" is
    what the best method with that model reaches.

    A row contains the values of `summarise_method` and the statistics `TABLE`. Raises InputError
    for a dataset that is not scored, and for an unknown condition.
    """
    if by is not None and by not in (*CONDITIONS, *STRATA):
        allowed = ", ".join((*CONDITIONS, *STRATA))
        raise InputError(f"'{by}' is unknown, allowed is one of {allowed}")
    return [row for dataset in datasets for row in _rows(Results(dataset), by)]


def _rows(results: Results, by: str | None) -> list[Row]:
    scores = read_scores(results)
    if by is not None:
        scores = with_labels(scores, by)
    truth = open_truth(results.dataset.truth, centrelines=False)
    scene = truth.manifest["scene"]
    remark = " ".join(remarks(scene))
    length = truth.manifest["true_rig"]["beam_length_mm"]
    order = scores["method"].unique(maintain_order=True).to_list()
    keys = ["method"] if by is None else ["method", by]
    parts = dict(scores.group_by(keys, maintain_order=True))
    ordered = sorted(
        parts, key=lambda key: ([class_order(value) for value in key[1:]], order.index(key[0]))
    )
    rows: list[Row] = []
    for values, keys_of_part in groupby(ordered, key=lambda key: key[1:]):
        methods = {str(key[0]): parts[key] for key in keys_of_part}
        figures = {name: _row(part) for name, part in methods.items()}
        figures |= _bounds(list(methods.values()), length)
        rows += [
            {
                "scene": results.root.resolve().name,
                "title": scene["title"],
                "method": name,
                **({} if by is None else {by: values[0]}),
                **row,
                "remark": remark,
            }
            for name, row in figures.items()
        ]
    return rows


def _bounds(methods: Sequence[pl.DataFrame], length_mm: float) -> dict[str, Row]:
    """Make a row for each information set of the methods for which there are limits."""
    figures = {}
    frames = pl.concat(methods).unique(["frame_id", "information"], maintain_order=True)
    touched = frames.filter(~pl.col("free"))
    limits = [quantity.limit for quantity in LIMITED]
    touched = touched.filter(pl.any_horizontal(pl.col(limits).is_not_null()))
    for (information,), rows in touched.group_by("information", maintain_order=True):
        last = rows.filter("last_step")
        springs = last.drop_nulls("k_s_n_m")
        rigid = last.filter(pl.col("k_s_n_m").is_null())
        relative_force = pl.col("force_limit_n") / pl.col("true_force_n")
        compliance = pl.col("compliance_limit_mm_per_n")
        figures[f"{BOUND} ({information})"] = dict.fromkeys(_row(methods[0].clear())) | {
            "x_c_rmse_pct_L": _rms(rows, 100 / length_mm * pl.col("x_c_limit_mm")),
            "s_c_rmse_pct_L": _rms(rows, 100 / length_mm * pl.col("s_c_limit_mm")),
            "force_rmse_pct": _rms(rows, 100 * relative_force),
            "psi_rmse_deg": _rms(rows, pl.col("psi_limit_deg")),
            "compliance_last_rmse_pct": _rms(
                springs, 100 * compliance / pl.col("true_compliance_mm_per_n")
            ),
            "compliance_rigid_last_rmse_mm_per_n": _rms(rigid, compliance),
            "n": rows.height,
            "outcomes": {},
        }
        if rows["x_c_simple_rms_mm"].null_count() == 0:
            relative_force = pl.col("force_simple_rms_n") / pl.col("true_force_n")
            figures[f"{SIMPLE_MODEL} ({information})"] = dict.fromkeys(_row(methods[0].clear())) | {
                "x_c_rmse_pct_L": _rms(rows, 100 / length_mm * pl.col("x_c_simple_rms_mm")),
                "force_rmse_pct": _rms(rows, 100 * relative_force),
                "n": rows.height,
                "outcomes": {},
            }
    return figures


def _rms(rows: pl.DataFrame, values: pl.Expr) -> float | None:
    root: float | None = rows.select(RMS.expression(values)).item()
    return root


def _row(rows: pl.DataFrame) -> Row:
    return summarise_method(rows) | compute(TABLE, rows)
