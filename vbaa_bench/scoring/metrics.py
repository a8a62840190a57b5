"""Comparison of predictions with the truth: errors per frame."""

import codecs
import io
from pathlib import Path
from typing import Final

import polars as pl

from solver.instrument.errors import InputError, cell_text, quoted, truncated
from solver.instrument.estimate import Assumption, Outcome
from solver.instrument.hashes import read_bytes
from vbaa_bench.dataset.parquet import read_parquet
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.dataset.recorded import exists
from vbaa_bench.dataset.table_schema import LARGEST
from vbaa_bench.scoring.computed_scores import COMPUTED
from vbaa_bench.scoring.conditions import CONDITIONS
from vbaa_bench.scoring.information import information_of, with_limits
from vbaa_bench.scoring.information_sets import check_information
from vbaa_bench.scoring.refusals import right_refusals, rightly_refused
from vbaa_bench.scoring.scene_values import object_radius, scene_value
from vbaa_bench.scoring.scored_quantities import (
    COMPONENTS,
    CONSISTENT_SIGMAS,
    NUMBERS,
    SCORED_QUANTITIES,
    ScoredQuantity,
)
from vbaa_bench.scoring.strata import fixed_classes

_TEXTS = ("outcome", "message", "assumption", "information")
_QUANTITIES = (*SCORED_QUANTITIES, *COMPONENTS)
_MAX_MAGNITUDE = 1e12
# Largest predictions file. Chosen: a million frames of 40 columns in full precision have 1 GB.
MAX_FILE_BYTES: Final = 1 << 31
# Longest text in a cell [bytes]. Chosen: ten times the longest message that `solve` writes.
MAX_TEXT: Final = 10_000
# Characters that a message must not have in a table: see cell_text.
_UNFIT: Final = r"[\p{C}]|^\s*[=+\-@]"
_FAILED = [str(outcome) for outcome in Outcome if not outcome.has_values]


def read_predictions(path: Path) -> pl.DataFrame:
    """Read predictions from CSV or Parquet; absent columns are added as null.

    The columns frame_id and one of x_c_mm and force_n are required. A missing `outcome` is
    "contact" if x_c_mm or force_n is given, else "crashed". Raises InputError.
    """
    return checked_predictions(parsed(read_file(path), path), str(path))


def read_file(path: Path) -> bytes:
    """Read a predictions file, and check it if it is recorded. Raises InputError."""
    try:
        if not exists(path):  # a pipe or a device may never end
            raise InputError(f"{path}: is not a CSV or Parquet table (there is no such file)")
        return read_bytes(path, MAX_FILE_BYTES)
    except OSError as error:
        raise InputError(f"{path}: is not a CSV or Parquet table ({error.strerror})") from error


def parsed(data: bytes, path: Path) -> pl.DataFrame:
    """Parse the bytes of a table: Parquet, or CSV with commas or with Excel's semicolons.

    All columns of a CSV are texts. Raises InputError.
    """
    if path.suffix.lower() == ".parquet":
        return read_parquet(path, data)
    try:
        text = data.removeprefix(codecs.BOM_UTF8)
        head = text.partition(b"\n")[0]
        separator = ";" if b";" in head and b"," not in head else ","
        return pl.read_csv(io.BytesIO(text), infer_schema=False, separator=separator)
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"{path}: is not a CSV or Parquet table ({truncated(reason)})") from error


def checked_predictions(table: pl.DataFrame, source: str) -> pl.DataFrame:
    """Check and complete a table of predictions that was read from `source`. Raises InputError."""
    if "frame_id" not in table.columns:
        raise InputError(f"{source}: the column frame_id is missing")
    absent = [name for name in ("x_c_mm", "force_n") if name not in table.columns]
    if len(absent) == 2:
        raise InputError(
            f"{source}: the columns x_c_mm and force_n are both missing, one is required"
        )
    known = [name for name in (*NUMBERS, *_TEXTS) if name in table.columns]
    for name in [name for name in NUMBERS if name in known]:
        dtype = table[name].dtype
        if not (dtype.is_numeric() or dtype in (pl.String, pl.Null)):
            raise InputError(f"{source}: {name} holds {truncated(str(dtype))}, allowed are numbers")
    try:
        table = table.select(
            pl.col("frame_id").cast(pl.String),
            *(pl.col(n).cast(pl.String if n in _TEXTS else pl.Float64) for n in known),
        )
    except pl.exceptions.PolarsError as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            f"{source}: a column does not hold numbers ({truncated(reason)})"
        ) from error
    for name in ("frame_id", *(one for one in known if one in _TEXTS)):
        longest = int(table[name].str.len_bytes().max() or 0)  # type: ignore[arg-type]  # a number
        if longest > MAX_TEXT:
            raise InputError(
                f"{source}: {name} has a cell of {longest:,} bytes, allowed are {MAX_TEXT:,}"
            )
    if "message" in known and table["message"].str.contains(_UNFIT).any():
        message = pl.col("message").map_elements(cell_text, return_dtype=pl.String)
        table = table.with_columns(message)
    missing: list[pl.Expr] = [
        pl.lit(None, pl.String if n in _TEXTS else pl.Float64).alias(n)
        for n in (*NUMBERS, *_TEXTS)
        if n not in known
    ]
    table = table.with_columns(missing)
    # inf, NaN and absurdly large numbers count as missing.
    table = table.with_columns(
        pl.when(pl.col(name).abs() < _MAX_MAGNITUDE).then(pl.col(name)).alias(name)
        for name in NUMBERS
    )
    # A standard deviation that is not positive counts as missing.
    table = table.with_columns(
        pl.when(pl.col(quantity.sigma) > 0).then(pl.col(quantity.sigma)).alias(quantity.sigma)
        for quantity in _QUANTITIES
    )
    has_value = pl.col("x_c_mm").is_not_null() | pl.col("force_n").is_not_null()
    outcome = pl.col("outcome")
    contact, crashed = pl.lit(str(Outcome.CONTACT)), pl.lit(str(Outcome.CRASHED))
    return table.with_columns(
        outcome=pl.when(outcome.is_not_null())
        .then(outcome)
        .when(has_value)
        .then(contact)
        .otherwise(crashed)
    ).select("frame_id", *NUMBERS, *_TEXTS)


def score_frames(
    truth: Truth,
    predictions: pl.DataFrame,
    method: str,
    source: str,
    limits: pl.DataFrame | None = None,
    true: pl.DataFrame | None = None,
) -> pl.DataFrame:
    """Score predictions: one row per true frame with truth, estimates and errors.

    A frame without a prediction has crashed. A frame that lacks a quantity which the method
    estimates in other frames has failed. Without contact, "no contact" is the only right outcome.
    `refused` frames are failures with an outcome that states no values; `rightly_refused` are
    those for which this is right according to `refusals`, where a refusal that names a broken
    assumption is right only if the truth breaks it; `consistent` are these, a right
    "no contact", and an x_c within three stated sigmas. Errors are computed for frames that have
    not failed: each scored quantity, including components of vectors, in its own unit and in
    stated sigmas, x_c and s_c also in % of L, forces and the compliance of springs in %, and the
    norms of vector errors. `limits` are the dataset's information limits; each frame gets those of
    the information set that the predictions state, or else of the method's. `true` is the result of
    `true_frames`, which is the same for all methods. Raises InputError for frames that are not in
    this dataset or are predicted twice, and for an unknown outcome, assumption or information set.
    """
    _check_frame_ids(truth, predictions, source)
    true = true_frames(truth) if true is None else true
    information = information_of(method, truth.manifest["scene"])
    joined = true.join(predictions, on="frame_id", how="left").with_columns(
        pl.lit(method).alias("method"),
        pl.col("information").fill_null(information),
        pl.col("outcome").fill_null(str(Outcome.CRASHED)),
        pl.when(pl.col("outcome").is_null())
        .then(pl.lit("no prediction for this frame"))
        .otherwise(pl.col("message"))
        .alias("message"),
        last_step=pl.col("step") == pl.col("step").max().over("push_id"),
    )
    unknown_outcomes = set(joined["outcome"]) - {str(outcome) for outcome in Outcome}
    if unknown_outcomes:
        raise InputError(
            f"{source}: outcome {quoted(min(unknown_outcomes))} is unknown, allowed is one of "
            f"{', '.join(str(outcome) for outcome in Outcome)}"
        )
    unknown = set(joined["assumption"].drop_nulls()) - set(Assumption)
    if unknown:
        raise InputError(
            f"{source}: assumption {quoted(min(unknown))} is unknown, allowed is one of "
            f"{', '.join(Assumption)}"
        )
    for name in joined["information"].unique():
        check_information(name, source)
    scored = with_limits(joined, limits).with_columns(**_verdicts(predictions))
    scored = scored.with_columns(map(_error, _QUANTITIES))
    most = CONSISTENT_SIGMAS * pl.col("x_c_sigma_mm")
    is_within = (pl.col("x_c_error_mm").abs() <= most).fill_null(value=False)
    length = truth.manifest["true_rig"]["beam_length_mm"]
    return scored.with_columns(
        *(_in_sigmas(quantity) for quantity in _QUANTITIES),
        (pl.col("free") & ~pl.col("failed") | pl.col("rightly_refused") | is_within).alias(
            "consistent"
        ),
        *(one.value(length).alias(name) for name, one in COMPUTED.items()),
    ).drop("acceptable_outcomes", "violated")


def true_frames(truth: Truth) -> pl.DataFrame:
    """Tabulate what scores contain of the truth: one row per frame, without any method."""
    return (
        truth.frames.with_columns(
            friction=scene_value(truth, "object.friction").cast(pl.Float64),
            object_radius_mm=object_radius(truth),
        )
        .select(
            "frame_id",
            *CONDITIONS,
            # If no frame has a contact, the columns have no type.
            *(quantity.true.cast(pl.Float64).alias(quantity.truth) for quantity in _QUANTITIES),
        )
        .join(fixed_classes(truth), on="frame_id")
        .join(right_refusals(truth), on="frame_id")
    )


def _check_frame_ids(truth: Truth, predictions: pl.DataFrame, source: str) -> None:
    ids = predictions["frame_id"]
    if ids.is_duplicated().any():
        duplicate = ids.filter(ids.is_duplicated())[0]
        raise InputError(f"{source}: frame_id {truncated(str(duplicate))} occurs more than once")
    unknown = predictions.join(truth.frames, on="frame_id", how="anti")
    if unknown.height:
        first = truncated(str(unknown["frame_id"][0]))
        raise InputError(
            f"{source}: frame_id {first} and {unknown.height - 1} more are not of this dataset"
        )


def _verdicts(predictions: pl.DataFrame) -> dict[str, pl.Expr]:
    # A quantity estimated in any frame is required in all; a method must not choose its frames.
    required = [name for name in ("x_c_mm", "force_n") if predictions[name].is_not_null().any()]
    incomplete = pl.any_horizontal(
        pl.lit(not required), *(pl.col(name).is_null() for name in required)
    )
    free = pl.col("true_x_c_mm").is_null()
    failed = (
        pl.when(free)
        .then(pl.col("outcome") != str(Outcome.NO_CONTACT))
        .otherwise(pl.col("outcome").is_in(_FAILED) | incomplete)
    )
    crashed = pl.col("outcome") == str(Outcome.CRASHED)
    refused = failed & pl.col("outcome").is_in(_FAILED) & ~crashed
    return {
        "free": free,
        "failed": failed,
        "crashed": crashed,
        "refused": refused,
        "rightly_refused": refused & rightly_refused(),
    }


def _error(quantity: ScoredQuantity) -> pl.Expr:
    error = pl.col(quantity.column) - pl.col(quantity.truth)
    if quantity.unit == "deg":  # wrapped to +-180 degrees
        error = (error + 180) % 360 - 180
    return pl.when(~pl.col("failed")).then(error).alias(quantity.error)


def _in_sigmas(quantity: ScoredQuantity) -> pl.Expr:
    # A sigma may be so small that the ratio is infinite.
    ratio = pl.col(quantity.error) / pl.col(quantity.sigma)
    return ratio.clip(-LARGEST, LARGEST).alias(quantity.in_sigmas)
