"""Score all predictions of a dataset."""

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes, write_text
from solver.lab.writing import write
from solver.methods import METHODS
from vbaa_bench.dataset.derived import read_limits
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scoring.layout import Results
from vbaa_bench.scoring.metrics import (
    checked_predictions,
    parsed,
    read_file,
    score_frames,
    true_frames,
)
from vbaa_bench.scoring.parameters import parameter_rows
from vbaa_bench.scoring.plausible import doubtful_units, unknown_columns
from vbaa_bench.scoring.scored_quantities import COMPONENTS, SCORED_QUANTITIES
from vbaa_bench.scoring.summary import summarise

# Chosen: a CSV of more rows exceeds 100 MB, and no spreadsheet opens it.
MAX_CSV_ROWS: Final = 50_000


def score(results: Results, predictions: Mapping[str, Path]) -> dict[str, Any]:
    """Score named prediction files; write scores.parquet, scores.csv, strata.csv and summary.json.

    Return the summary; its `warnings` are sentences on columns and magnitudes that seem to be
    mistakes. More than MAX_CSV_ROWS scores are written to scores.parquet only. Files from elsewhere
    are copied to `predictions/` under their names, so that they are included in the next scoring.
    Raises InputError, also if the truth is not what was generated.
    """
    truth = open_truth(results.dataset.truth, centrelines=False)
    true, limits = true_frames(truth), read_limits(results.dataset)
    if not predictions:
        raise InputError(
            f"{results.predictions}: holds no predictions; solve the dataset or name a file"
        )
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
    parameters = parameter_rows(scores)
    summary = {**summarise(scores, parameters), "warnings": warnings}
    for name, path in predictions.items():
        _copy_predictions(results, name, path, contents[name])
    try:
        write_scores(results.scores, scores, parameters, summary)
        if scores.height <= MAX_CSV_ROWS:
            write_text(results.scores / "scores.csv", scores.write_csv())
        else:
            (results.scores / "scores.csv").unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{results.scores}: cannot be written ({error.strerror})") from error
    return summary


def write_scores(
    folder: Path,
    scores: pl.DataFrame,
    parameters: Sequence[Mapping[str, Any]],
    summary: Mapping[str, Any],
) -> None:
    """Write scores.parquet, strata.csv and summary.json into a folder. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    parquet = io.BytesIO()
    scores.write_parquet(parquet)
    write_bytes(folder / "scores.parquet", parquet.getvalue())
    table = pl.DataFrame(parameters, infer_schema_length=None)
    write_text(folder / "strata.csv", table.write_csv())
    write_text(folder / "summary.json", json.dumps(summary, indent=2) + "\n")


def _copy_predictions(results: Results, name: str, path: Path, data: bytes) -> None:
    """Write a copy of a predictions file into `predictions/`, unless it is already there."""
    target = results.predictions / f"{name}{_suffix(path)}"
    if path.resolve() == target.resolve():
        return
    write(target, data)
    for suffix in {".csv", ".parquet"} - {target.suffix}:  # remove an older file of this name
        target.with_suffix(suffix).unlink(missing_ok=True)


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
    if not table.is_file():
        raise InputError(f"{results.scores}: holds no scores; score the dataset first")
    try:
        scores = pl.read_parquet(table)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise InputError(f"{table}: cannot be read") from error
    if not {
        "consistent",
        "information",
        "x_c_limit_pct_L",
        *(quantity.in_sigmas for quantity in (*SCORED_QUANTITIES, *COMPONENTS)),
    } <= set(scores.columns):
        raise InputError(f"{table}: is from an older version; score the dataset again")
    return scores


def found_predictions(results: Results) -> dict[str, Path]:
    """Find the prediction files of a dataset, by method or name; the solver's methods first.

    Predictions of a method with another centreline follow those with the default one.
    """
    paths = sorted(results.predictions.glob("*.csv")) + sorted(
        results.predictions.glob("*.parquet")
    )
    tables = {path.stem: path for path in paths}
    solver_names = [
        name for method in METHODS for name in tables if name.partition("@")[0] == method
    ]
    return {name: tables[name] for name in [*solver_names, *tables]}
