"""Score all predictions of a dataset, or of a collection: the frames of all its rigs together."""

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import read_bytes
from solver.methods import METHODS
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.document import Document, check_document, read_json
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.dataset.recorded import check_none_missing, exists, write_results
from vbaa_bench.dataset.tables import MAX_SCORED_VALUES, checked, read_parquet
from vbaa_bench.scoring.bootstrap import share_interval
from vbaa_bench.scoring.factors import factor_columns, factor_table, rig_factors
from vbaa_bench.scoring.frame_scores import score_frames, true_frames
from vbaa_bench.scoring.information import scored_limits
from vbaa_bench.scoring.predictions import (
    checked_predictions,
    parsed,
    read_file,
    unknown_columns,
)
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score_columns import SCORE_SCHEMA
from vbaa_bench.scoring.statistics import COLLECTION, compute
from vbaa_bench.scoring.strata_table import strata_rows
from vbaa_bench.scoring.summary import summarise
from vbaa_bench.scoring.wrong_units import doubtful_units

# Chosen: a CSV of more rows exceeds 100 MB, and no spreadsheet opens it.
MAX_CSV_ROWS: Final = 50_000
# All files that a scoring of a dataset or a collection writes.
FILES: Final = frozenset(
    {"scores.parquet", "scores.csv", "strata.csv", "factors.csv", "summary.json"}
)


def score(results: Results, predictions: Mapping[str, Path]) -> dict[str, Any]:
    """Score named prediction files; write scores.parquet, scores.csv, strata.csv and summary.json.

    Return the summary; its `warnings` are sentences on columns and magnitudes that seem to be
    mistakes. More than MAX_CSV_ROWS scores are written to scores.parquet only. Files from elsewhere
    are copied to `predictions/` under their names, so that they are included in the next scoring.
    Raises InputError, also if the truth is not what was generated.
    """
    truth = open_truth(results.dataset.truth, centrelines=False)
    true, limits = true_frames(truth), scored_limits(results.dataset)
    if not predictions:
        raise InputError(
            f"{results.predictions}: holds no predictions; solve the dataset or name a file"
        )
    for name, path in predictions.items():
        if not name.isprintable():  # it is a heading of tables, also in a terminal
            raise InputError(f"{path}: rename the file, allowed are names of printable characters")
    warnings: list[str] = []
    scored: list[pl.DataFrame] = []
    contents = {name: read_file(path) for name, path in predictions.items()}
    for name, path in predictions.items():
        table = parsed(contents[name], path)
        checked = checked_predictions(table, str(path))
        rows = score_frames(truth, checked, name, str(path), limits, true)
        warnings += [*unknown_columns(table.columns, str(path)), *doubtful_units(rows, str(path))]
        scored.append(rows)
    scores = pl.concat(scored)
    parameters = strata_rows(scores)
    summary = {**summarise(scores, parameters), "warnings": warnings}
    for name, path in predictions.items():
        _copy_predictions(results, name, path, contents[name])
    small = scores.height <= MAX_CSV_ROWS
    tables = {"scores.csv": scores} if small else {}
    _write_scores(results.scores, scores, parameters, summary, tables)
    return summary


def score_rigs(root: Path, names: Sequence[str] | None = None) -> dict[str, Any]:
    """Score the predictions of all rigs; write the tables of `score` and factors.csv.

    `names` are those of methods, by default all that have predictions. Each row has the number of
    its rig, and the values in which rigs and frames differ. Intervals are over rigs. Raises
    InputError.
    """
    scored: list[pl.DataFrame] = []
    for number, layout in CollectionLayout(root).rigs().items():
        results, truth = Results(layout.root), open_truth(layout.truth, centrelines=False)
        true, limits = true_frames(truth), scored_limits(layout)
        columns = factor_columns(truth)
        for name, path in found_predictions(results).items():
            if names is None or name in names:
                table = checked_predictions(parsed(read_file(path), path), str(path))
                rows = score_frames(truth, table, name, str(path), limits, true)
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
    _write_scores(Results(root).scores, scores, parameters, summary, tables)
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


def _write_scores(
    folder: Path,
    scores: pl.DataFrame,
    parameters: Sequence[Mapping[str, Any]],
    summary: Mapping[str, Any],
    tables: Mapping[str, pl.DataFrame],
) -> None:
    """Write scores.parquet, strata.csv, summary.json and other tables, as CSV, into a folder.

    Files of an earlier scoring are removed. Raises InputError.
    """
    parquet = io.BytesIO()
    scores.write_parquet(parquet)
    tables = {"strata.csv": pl.DataFrame(parameters, infer_schema_length=None), **tables}
    files = {
        "scores.parquet": parquet.getvalue(),
        "summary.json": (json.dumps(summary, indent=2) + "\n").encode(),
        **{name: table.write_csv().encode() for name, table in tables.items()},
    }
    write_results(folder, files, FILES - files.keys())


def _copy_predictions(results: Results, name: str, path: Path, data: bytes) -> None:
    """Write a copy of a predictions file into `predictions/`, unless it is already there."""
    target = results.predictions / f"{name}{_suffix(path)}"
    if path.resolve() == target.resolve():
        return
    older = [f"{name}{suffix}" for suffix in {".csv", ".parquet"} - {target.suffix}]
    write_results(results.predictions, {target.name: data}, older)


def _suffix(path: Path) -> str:
    return ".parquet" if path.suffix.lower() == ".parquet" else ".csv"


def with_own(results: Results, own: Sequence[Path]) -> dict[str, Path]:
    """Find all predictions of a dataset, and add a user's own files by their stems.

    An own file replaces an earlier one of the same stem. Raises InputError for a stem that is the
    name of a method of `solve`, and for two files of one stem.
    """
    predictions = found_predictions(results)
    stems = [path.stem for path in own]
    for path in own:
        if "." in path.stem or path.stem.partition("@")[0] in METHODS:
            raise InputError(
                f"{path}: {path.stem} is the name of a method of solve, and may be scored already; "
                "rename the file, without a dot"
            )
        if stems.count(path.stem) > 1:
            raise InputError(f"{path}: two files are called {path.stem}; rename one")
    return {**predictions, **dict(zip(stems, own, strict=True))}


def read_scores(results: Results) -> pl.DataFrame:
    """Read the table written by `score`. Raises InputError if there is none, or an older one."""
    table = results.scores / "scores.parquet"
    if not exists(table):
        raise InputError(f"{results.scores}: holds no scores; score the dataset first")
    try:
        scores = read_parquet(
            table, read_bytes(table), max_values=MAX_SCORED_VALUES, schema=SCORE_SCHEMA
        )
        if scores.is_empty():
            raise InputError(f"{table}: has no rows")
        numbers = [name for name, dtype in scores.schema.items() if dtype.is_float()]
        return checked(scores, SCORE_SCHEMA._replace(finite=numbers), str(table))
    except DamageError:
        raise
    except InputError as error:
        again = "it may be of an older version; score the dataset again"
        raise InputError(f"{error}; {again}") from error


class _Machine(Document):
    processor: str


class _Summary(Document):
    """What reports and comparisons read of a summary."""

    methods: dict[str, dict[str, Any]]
    machine: _Machine
    versions: dict[str, str]
    rigs: int = 0


def read_summary(results: Results) -> dict[str, Any]:
    """Read the summary written by `score`. Raises InputError if there is none, or it is damaged."""
    path = results.scores / "summary.json"
    if not exists(path):
        raise InputError(f"{results.scores}: holds no scores; score the dataset first")
    document = read_json(path)
    check_document(path, document, _Summary)
    return document


def found_predictions(results: Results) -> dict[str, Path]:
    """Find the prediction files of a dataset, by method or name; the solver's methods first.

    Predictions of a method with another centreline follow those with the default one. Raises
    DamageError if a file that was written is missing.
    """
    check_none_missing(results.predictions)
    paths = sorted(results.predictions.glob("*.csv")) + sorted(
        results.predictions.glob("*.parquet")
    )
    tables = {path.stem: path for path in paths}
    solver_names = [
        name for method in METHODS for name in tables if name.partition("@")[0] == method
    ]
    return {name: tables[name] for name in [*solver_names, *tables]}
