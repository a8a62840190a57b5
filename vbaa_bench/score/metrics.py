"""Predictions against truth: errors per frame."""

from pathlib import Path

import polars as pl

from solver.instrument.errors import InputError
from solver.instrument.estimate import Outcome
from vbaa_bench.dataset.readers import Truth

_NUMBERS = ("x_c_mm", "x_c_sigma_mm", "s_c_mm", "force_n", "force_sigma_n", "image_ms")
_TEXTS = ("outcome", "message")
_LARGEST = 1e12
_FAILED = [str(outcome) for outcome in Outcome if not outcome.has_values]


def read_predictions(path: Path) -> pl.DataFrame:
    """Predictions from CSV or Parquet: frame_id and what else there is, missing columns as null.

    An `outcome` that is not stated is "contact" where x_c_mm is given. Raises InputError.
    """
    try:
        if path.suffix == ".parquet":
            table = pl.read_parquet(path, glob=False)
        else:
            table = pl.read_csv(path, infer_schema=False, glob=False)
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: is not a CSV or Parquet table ({reason})") from error
    if "frame_id" not in table.columns:
        raise InputError(f"{path}: the column frame_id is missing")
    absent = [name for name in ("x_c_mm", "force_n") if name not in table.columns]
    if len(absent) == 2:
        raise InputError(f"{path}: the columns x_c_mm and force_n are both missing, needed is one")
    known = [name for name in (*_NUMBERS, *_TEXTS) if name in table.columns]
    for name in _NUMBERS:
        if name in known and not (table[name].dtype.is_numeric() or table[name].dtype == pl.String):
            raise InputError(f"{path}: {name} holds {table[name].dtype}, allowed are numbers")
    try:
        table = table.select(
            pl.col("frame_id").cast(pl.String),
            *(pl.col(n).cast(pl.String if n in _TEXTS else pl.Float64) for n in known),
        )
    except pl.exceptions.PolarsError as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: a column does not hold numbers ({reason})") from error
    missing: list[pl.Expr] = [
        pl.lit(None, pl.String if n in _TEXTS else pl.Float64).alias(n)
        for n in (*_NUMBERS, *_TEXTS)
        if n not in known
    ]
    table = table.with_columns(missing)
    # inf, NaN and numbers beyond all sense are no answers.
    table = table.with_columns(
        pl.when(pl.col(name).abs() < _LARGEST).then(pl.col(name)).alias(name) for name in _NUMBERS
    )
    given = pl.col("x_c_mm").is_not_null() | pl.col("force_n").is_not_null()
    stated = pl.col("outcome")
    contact, crashed = pl.lit(str(Outcome.CONTACT)), pl.lit(str(Outcome.CRASHED))
    return table.with_columns(
        outcome=pl.when(stated.is_not_null())
        .then(stated)
        .when(given)
        .then(contact)
        .otherwise(crashed)
    ).select("frame_id", *_NUMBERS, *_TEXTS)


def score_frames(truth: Truth, predictions: pl.DataFrame, method: str, source: str) -> pl.DataFrame:
    """One row per true frame: what was, what was answered, and the errors.

    A frame without a prediction is a crashed one; one that lacks a quantity which the method
    answers elsewhere has failed too. Where nothing is touched, "no contact" alone is right.
    Errors: x_c and s_c in mm and in % of L, force in %. Raises InputError for frames that are not
    of this dataset, or answered twice.
    """
    ids = predictions["frame_id"]
    if ids.is_duplicated().any():
        twice = ids.filter(ids.is_duplicated())[0]
        raise InputError(f"{source}: frame_id {twice} stands there more than once")
    unknown = predictions.join(truth.frames, on="frame_id", how="anti")
    if unknown.height:
        raise InputError(
            f"{source}: frame_id {unknown['frame_id'][0]} and {unknown.height - 1} more are "
            "not of this dataset"
        )
    true = truth.frames.select(
        "frame_id",
        "push",
        "contact_distance_at_rest_mm",
        "deflection_pct",
        "pushing_angle_deg",
        "normal_deg",
        "k_s_n_m",
        pl.col("x_c_mm").alias("true_x_c_mm"),
        pl.col("s_c_mm").alias("true_s_c_mm"),
        pl.col("force_n").alias("true_force_n"),
    )
    length_mm: float = truth.manifest["true_rig"]["beam_length_mm"]
    joined = true.join(predictions, on="frame_id", how="left").with_columns(
        pl.lit(method).alias("method"),
        pl.col("outcome").fill_null(str(Outcome.CRASHED)),
        pl.when(pl.col("outcome").is_null())
        .then(pl.lit("no prediction for this frame"))
        .otherwise(pl.col("message"))
        .alias("message"),
    )
    unknown_outcomes = set(joined["outcome"]) - {str(outcome) for outcome in Outcome}
    if unknown_outcomes:
        raise InputError(
            f"{source}: outcome '{min(unknown_outcomes)}' is unknown, allowed is one of "
            f"{', '.join(str(outcome) for outcome in Outcome)}"
        )
    # What a method answers anywhere it must answer everywhere, or it could choose its frames.
    owed = [name for name in ("x_c_mm", "force_n") if predictions[name].is_not_null().any()]
    lacking = pl.any_horizontal(pl.lit(not owed), *(pl.col(name).is_null() for name in owed))
    free = pl.col("true_x_c_mm").is_null()
    right = (
        pl.when(free)
        .then(pl.col("outcome") == str(Outcome.NO_CONTACT))
        .otherwise(~(pl.col("outcome").is_in(_FAILED) | lacking))
    )
    failed = ~right
    return joined.with_columns(
        failed=failed,
        x_c_error_mm=pl.when(~failed).then(pl.col("x_c_mm") - pl.col("true_x_c_mm")),
        s_c_error_mm=pl.when(~failed).then(pl.col("s_c_mm") - pl.col("true_s_c_mm")),
        force_error_pct=pl.when(~failed).then(
            100 * (pl.col("force_n") - pl.col("true_force_n")) / pl.col("true_force_n")
        ),
    ).with_columns(
        x_c_error_pct_L=100 * pl.col("x_c_error_mm") / length_mm,
        s_c_error_pct_L=100 * pl.col("s_c_error_mm") / length_mm,
    )
