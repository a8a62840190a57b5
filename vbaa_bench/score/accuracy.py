"""Scored datasets -> one table: a row for each scene and method."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.errors import InputError
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.score.layout import Results
from vbaa_bench.score.metrics import CONDITIONS
from vbaa_bench.score.remarks import remarks
from vbaa_bench.score.summary import facts

Row = dict[str, Any]

# Heads of the Markdown table and where their numbers stand in a row.
_COLUMNS: Final = {
    "x_c RMSE, % of L": "x_c_rmse_pct_L",
    "median": "x_c_median_abs_pct_L",
    "force, %": "force_rmse_pct",
    "psi, deg": "psi_rmse_deg",
    "1/k at a push's end, %": "compliance_last_rmse_pct",
    "1/k rigid, mm/N": "compliance_rigid_rmse_mm_per_n",
    "in 3 sigma, %": "x_c_within_3_sigma_pct",
    "sigma / RMSE": "x_c_sigma_over_rmse",
    "honest, %": "honest_pct",
}


def accuracy(datasets: Sequence[Path], by: str | None = None) -> list[Row]:
    """How each method did on each dataset, and with `by` for each value of one of CONDITIONS.

    A row holds all that `summary.facts` tells; of x_c the share within three stated sigmas and the
    stated sigmas over the RMSE, percentages, stand beside it by themselves. Raises InputError for
    a dataset that is not scored, and for an unknown condition.
    """
    if by is not None and by not in CONDITIONS:
        raise InputError(f"'{by}' is unknown, allowed is one of {', '.join(CONDITIONS)}")
    return [row for dataset in datasets for row in _rows(Results(dataset), by)]


def _rows(results: Results, by: str | None) -> list[Row]:
    table = results.scores / "scores.parquet"
    if not table.is_file():
        raise InputError(f"{results.scores}: holds no scores; score the dataset first")
    try:
        scores = pl.read_parquet(table)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise InputError(f"{table}: cannot be read") from error
    if "honest" not in scores.columns:
        raise InputError(f"{table}: is of an older version; score the dataset again")
    scene = open_truth(results.dataset.truth).manifest["scene"]
    said = " ".join(remarks(scene))
    order = scores["method"].unique(maintain_order=True).to_list()
    keys = ["method"] if by is None else ["method", by]
    parts = dict(scores.group_by(keys, maintain_order=True))
    ordered = sorted(parts, key=lambda key: (_sortable(key[1:]), order.index(key[0])))
    return [
        {
            "scene": results.root.resolve().name,
            "title": scene["title"],
            "method": str(key[0]),
            **({} if by is None else {by: key[1]}),
            **_row(parts[key]),
            "remark": said,
        }
        for key in ordered
    ]


def _row(rows: pl.DataFrame) -> Row:
    found = facts(rows)
    x_c = found["calibration"]["x_c"] or {}
    return found | {
        "x_c_within_3_sigma_pct": _percent(x_c.get("within_3_sigma")),
        "x_c_sigma_over_rmse": x_c.get("sigma_over_rmse"),
        "honest_pct": _percent(found["honest_rate"]),
    }


def markdown(rows: Sequence[Row], by: str | None = None) -> str:
    """The table, columns without a number left out, and below it the remarks on its scenes."""
    columns = {
        head: key for head, key in _COLUMNS.items() if any(row[key] is not None for row in rows)
    }
    texts = ["scene", *([] if by is None else [by]), "method"]
    heads = [*texts, *columns, "n", "outcomes"]
    lines = [heads, ["---" if head in (*texts, "outcomes") else "---:" for head in heads]]
    for row in rows:
        named = ["–" if row[key] is None else f"{row[key]}" for key in texts]
        numbers = ["–" if row[key] is None else f"{row[key]:.3g}" for key in columns.values()]
        said = ", ".join(f"{count} {outcome}" for outcome, count in row["outcomes"].items())
        lines.append([*named, *numbers, str(row["n"]), said])
    text = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    sentences = {row["scene"]: row["remark"] for row in rows if row["remark"]}
    notes = [f"- `{scene}`: {sentence}" for scene, sentence in sentences.items()]
    return "\n".join([text, "", *notes]) if notes else text


def _percent(share: float | None) -> float | None:
    return None if share is None else 100 * share


def _sortable(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """Numbers by size, texts such as '10 %' by the number they begin with, nothing last."""

    def key(value: Any) -> tuple[int, float, str]:
        if value is None:
            return (2, 0.0, "")
        first = str(value).rstrip("°").split()[0] if str(value) else ""
        try:
            return (0, float(first), str(value))
        except ValueError:
            return (1, 0.0, str(value))

    return tuple(key(value) for value in values)
