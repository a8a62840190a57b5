"""Comparison of predictions with the truth, frame by frame: errors and verdicts."""

from typing import Final

import polars as pl

from solver.instrument.errors import InputError, quoted, truncated
from solver.instrument.estimate import Assumption, Outcome
from vbaa_bench.dataset.document import LARGEST
from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.computed_scores import COMPUTED
from vbaa_bench.scoring.conditions import CONDITIONS
from vbaa_bench.scoring.information import with_limits
from vbaa_bench.scoring.information_sets import check_information, information_of
from vbaa_bench.scoring.refusals import (
    THRESHOLDS,
    Thresholds,
    right_refusals,
    rightly_refused,
)
from vbaa_bench.scoring.scene_values import object_radius, scene_value
from vbaa_bench.scoring.scored_quantities import (
    COMPONENTS,
    CONSISTENT_SIGMAS,
    SCORED_QUANTITIES,
    ScoredQuantity,
)
from vbaa_bench.scoring.strata import fixed_classes

_QUANTITIES: Final = (*SCORED_QUANTITIES, *COMPONENTS)
_FAILED: Final = [str(outcome) for outcome in Outcome if not outcome.has_values]


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
    for name, allowed in (("outcome", list(Outcome)), ("assumption", list(Assumption))):
        unknown = set(joined[name].drop_nulls()) - set(allowed)
        if unknown:
            raise InputError(
                f"{source}: {name} {quoted(min(unknown))} is unknown, allowed is one of "
                f"{', '.join(allowed)}"
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


def true_frames(truth: Truth, thresholds: Thresholds = THRESHOLDS) -> pl.DataFrame:
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
        .join(right_refusals(truth, thresholds), on="frame_id")
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
