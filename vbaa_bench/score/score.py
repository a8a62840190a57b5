"""Judge every predictions file of a dataset."""

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.files import write_bytes, write_text
from solver.methods import METHODS
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.score.judged import COMPONENTS, JUDGED
from vbaa_bench.score.layout import Results
from vbaa_bench.score.metrics import read_predictions, score_frames
from vbaa_bench.score.summary import summarise


def score(results: Results, predictions: Mapping[str, Path]) -> dict[str, Any]:
    """Write scores.parquet, scores.csv and summary.json for named prediction files; the summary.

    Raises InputError, also where the truth is not what was generated.
    """
    truth = open_truth(results.dataset.truth)
    if not predictions:
        raise InputError(f"{results.predictions}: holds no predictions; solve or name a file")
    scores = pl.concat(
        [
            score_frames(truth, read_predictions(path), name, str(path))
            for name, path in predictions.items()
        ]
    )
    summary = summarise(scores)
    parquet = io.BytesIO()
    scores.write_parquet(parquet)
    try:
        results.scores.mkdir(parents=True, exist_ok=True)
        write_bytes(results.scores / "scores.parquet", parquet.getvalue())
        write_text(results.scores / "scores.csv", scores.write_csv())
        write_text(results.scores / "summary.json", json.dumps(summary, indent=2) + "\n")
    except OSError as error:
        raise InputError(f"{results.scores}: cannot be written ({error.strerror})") from error
    return summary


def read_scores(results: Results) -> pl.DataFrame:
    """The table that `score` wrote. Raises InputError where there is none, or an older one."""
    table = results.scores / "scores.parquet"
    if not table.is_file():
        raise InputError(f"{results.scores}: holds no scores; score the dataset first")
    try:
        scores = pl.read_parquet(table)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise InputError(f"{table}: cannot be read") from error
    if not {"honest", *(one.in_sigmas for one in (*JUDGED, *COMPONENTS))} <= set(scores.columns):
        raise InputError(f"{table}: is of an older version; score the dataset again")
    return scores


def found_predictions(results: Results) -> dict[str, Path]:
    """The prediction files that `solve` left beside the dataset, by method; the solver's first.

    What a method makes of another centreline stands next to it.
    """
    found = {path.stem: path for path in sorted(results.predictions.glob("*.csv"))}
    own = [name for method in METHODS for name in found if name.partition("@")[0] == method]
    return {name: found[name] for name in [*own, *found]}
