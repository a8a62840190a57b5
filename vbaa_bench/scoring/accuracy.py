"""Accuracy table of scored datasets: one row per scene and method."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import polars as pl
from polars import selectors

from solver.instrument.errors import InputError
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.conditions import CONDITIONS, STRATA
from vbaa_bench.scoring.layout import Results
from vbaa_bench.scoring.remarks import remarks
from vbaa_bench.scoring.score import read_scores
from vbaa_bench.scoring.strata import class_order
from vbaa_bench.scoring.summary import summarise_method

Row = dict[str, Any]

# Headings of the Markdown table, and the keys of their numbers in a row.
_COLUMNS: Final = {
    "x_c RMSE, % of L": "x_c_rmse_pct_L",
    "failures as L/2": "x_c_rmse_all_pct_L",
    "median": "x_c_median_abs_pct_L",
    "force, %": "force_rmse_pct",
    "psi, deg": "psi_rmse_deg",
    "psi in 3 sigma, %": "psi_within_3_sigma_pct",
    "1/k at end of push, %": "compliance_last_rmse_pct",
    "1/k at end, rigid, mm/N": "compliance_rigid_last_rmse_mm_per_n",
    "1/k at end in 3 sigma, %": "compliance_last_within_3_sigma_pct",
    "x_c in 3 sigma, %": "x_c_within_3_sigma_pct",
    "sigma / RMSE": "x_c_sigma_over_rmse",
    "consistent, %": "consistent_pct",
}
# Quantities whose stated sigmas are compared with errors in the table.
_STATED: Final = ("x_c", "psi", "compliance_last")


def accuracy(datasets: Sequence[Path], by: str | None = None) -> list[Row]:
    """Tabulate each method's accuracy on each dataset; `by` splits by a condition or stratum.

    A row contains the values of `summary.facts`. Separate columns repeat the fractions of x_c, psi
    and a push's last compliance within three stated sigmas [%], and the ratio of stated sigma to
    RMSE for x_c. Stiffness ratios are grouped by decade, because they differ in every frame. Raises
    InputError for a dataset that is not scored, and for an unknown condition.
    """
    if by is not None and by not in (*CONDITIONS, *STRATA):
        allowed = ", ".join((*CONDITIONS, *STRATA))
        raise InputError(f"'{by}' is unknown, allowed is one of {allowed}")
    return [row for dataset in datasets for row in _rows(Results(dataset), by)]


def _rows(results: Results, by: str | None) -> list[Row]:
    scores = read_scores(results)
    if by is not None:
        # Conditions are computed from equilibria; those of one setting differ in the last digits.
        scores = scores.with_columns((selectors.by_name(by) & selectors.float()).round_sig_figs(9))
        scores = scores.with_columns(_label(by))
    scene = open_truth(results.dataset.truth).manifest["scene"]
    remark = " ".join(remarks(scene))
    order = scores["method"].unique(maintain_order=True).to_list()
    keys = ["method"] if by is None else ["method", by]
    parts = dict(scores.group_by(keys, maintain_order=True))
    ordered = sorted(
        parts, key=lambda key: ([class_order(value) for value in key[1:]], order.index(key[0]))
    )
    return [
        {
            "scene": results.root.resolve().name,
            "title": scene["title"],
            "method": str(key[0]),
            **({} if by is None else {by: key[1]}),
            **_row(parts[key]),
            "remark": remark,
        }
        for key in ordered
    ]


def _label(by: str) -> pl.Expr:
    """Label a condition for the table: a spring's stiffness, or "rigid"."""
    column = pl.col(by)
    if by == "k_s_over_k_beam":
        decade = column.log10().floor()
        label = pl.format("{} – {}", 10.0**decade, 10.0 ** (decade + 1))
    elif by == "k_s_n_m":
        label = column.cast(pl.String)
    else:
        return column
    rigid = pl.when(~pl.col("free")).then(pl.lit("rigid"))
    trimmed = label.str.replace_all(r"\.0\b", "")
    return pl.when(column.is_null()).then(rigid).otherwise(trimmed).alias(by)


def _row(rows: pl.DataFrame) -> Row:
    values = summarise_method(rows)
    stated = {name: values["calibration"][name] or {} for name in _STATED}
    percentages = {
        f"{name}_within_3_sigma_pct": _percent(coverage.get("within_3_sigma"))
        for name, coverage in stated.items()
    }
    return values | {
        **percentages,
        "x_c_sigma_over_rmse": stated["x_c"].get("sigma_over_rmse"),
        "consistent_pct": _percent(values["consistent_rate"]),
    }


def markdown(rows: Sequence[Row], by: str | None = None) -> str:
    """Format the table without empty columns, followed by the remarks on its scenes."""
    columns = {
        head: key for head, key in _COLUMNS.items() if any(row[key] is not None for row in rows)
    }
    texts = ["scene", *([] if by is None else [by]), "method"]
    heads = [*texts, *columns, "n", "outcomes"]
    lines = [heads, ["---" if head in (*texts, "outcomes") else "---:" for head in heads]]
    for row in rows:
        labels = ["–" if row[key] is None else f"{row[key]}" for key in texts]
        numbers = ["–" if row[key] is None else f"{row[key]:.3g}" for key in columns.values()]
        counts = ", ".join(f"{count} {outcome}" for outcome, count in row["outcomes"].items())
        lines.append([*labels, *numbers, str(row["n"]), counts])
    text = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    sentences = {row["scene"]: row["remark"] for row in rows if row["remark"]}
    notes = [f"- `{scene}`: {sentence}" for scene, sentence in sentences.items()]
    return "\n".join([text, "", *notes]) if notes else text


def _percent(fraction: float | None) -> float | None:
    return None if fraction is None else 100 * fraction
