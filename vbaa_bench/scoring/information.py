"""Information limits of scored frames, and the share of the information that a method uses."""

from typing import Any, Final

import polars as pl

from solver.instrument.errors import InputError
from vbaa_bench.dataset.derived import LIMITS, read_limits
from vbaa_bench.dataset.document import LARGEST
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.tables import checked
from vbaa_bench.scoring.information_sets import SETS
from vbaa_bench.scoring.score_columns import LIMIT_SCHEMA
from vbaa_bench.scoring.scored_quantities import LIMITED, ScoredQuantity

# Root mean square of the errors of a method that attains the limit of the simple model, where a
# frame breaks its assumptions: from its bias and its standard deviation in the table of limits.
SIMPLE: Final = {
    "x_c_simple_rms_mm": ("x_c_simple_bias_mm", "x_c_simple_sigma_mm"),
    "force_simple_rms_n": ("force_simple_bias_n", "force_simple_sigma_n"),
}
_KEYS: Final = ("frame_id", "information")
# A share above 100 % is called impossible only with this many answered frames. Chosen: bootstrap
# intervals of fewer are too narrow; with 20 Gaussian errors by a tenth.
_MIN_FRAMES: Final = 20


def scored_limits(layout: Layout) -> pl.DataFrame | None:
    """Read the information limits of a dataset; None if they were never computed.

    Raises InputError for a table that is damaged, or was not written by `limits`.
    """
    limits, source = read_limits(layout), str(layout.derived / LIMITS)
    if limits is None:
        return None
    table = checked(limits, LIMIT_SCHEMA, source)
    if table.select(_KEYS).is_duplicated().any():
        raise InputError(f"{source}: a frame has two rows of one information set, allowed is one")
    return table


def with_limits(scores: pl.DataFrame, limits: pl.DataFrame | None) -> pl.DataFrame:
    """Add the information limits of each frame, and SIMPLE; null where there are none.

    `limits` has one row per `frame_id` and `information`, see `dataset.derived`. A limit that is
    not a positive number, or is absurdly small or large, counts as null.
    """
    columns = [quantity.limit for quantity in LIMITED]
    if limits is None:
        return scores.with_columns(pl.lit(None, pl.Float64).alias(n) for n in (*columns, *SIMPLE))
    positive = limits.select(
        "frame_id",
        "information",
        *(
            pl.when(pl.col(name).is_between(1 / LARGEST, LARGEST)).then(pl.col(name))
            for name in columns
        ),
        *(
            (pl.col(bias) ** 2 + pl.col(sigma) ** 2).sqrt().clip(upper_bound=LARGEST).alias(name)
            for name, (bias, sigma) in SIMPLE.items()
        ),
    )
    return scores.join(positive, on=_KEYS, how="left", validate="m:1")


def efficiency(
    information: str, quantity: ScoredQuantity, row: dict[str, Any]
) -> dict[str, Any] | None:
    """Compute the share of the information on a quantity that is used, from its row of strata.csv.

    It is (RMS of error / limit)^-2 of the answered frames, as `efficiency_pct`, with the 95 %
    interval `efficiency_pct_95` and a `sentence`. None without limits. An unbiased method cannot
    use more than all information (Cramer and Rao); where the whole interval is above 100 %, the
    result is `impossible`: there is no share, and the sentence names the likely reasons instead.
    """
    rmse = row["rmse_over_limit"]
    if not rmse:
        return None
    low, high = row["rmse_over_limit_low"], row["rmse_over_limit_high"]
    percent, ends = 100 / rmse**2, None if not low else [100 / high**2, 100 / low**2]
    about, data = quantity.words, SETS[information]
    impossible = bool(ends and ends[0] > 100 and row["answered"] >= _MIN_FRAMES)
    if impossible:
        sentence = (
            f"has errors of {rmse:.2g} times the limit for {about} from {data}, which is "
            "impossible for an unbiased method: either the true rig is nearer to the nominal one "
            "than its tolerances and its statements about beam and objects permit, or the method "
            f'uses data or priors that the information set "{information}" lacks, or its bias '
            f"({row['bias_over_limit']:.2g} of the limit) or its choice of answered frames "
            f"({row['answered']} of {row['frames']}) reduces its errors, or the limit is wrong"
        )
    else:
        span = f" ({ends[0]:.3g} to {ends[1]:.3g} %)" if ends else ""
        sentence = f"uses {percent:.3g} %{span} of the information in {data} about {about}"
    return {
        "efficiency_pct": None if impossible else percent,
        "efficiency_pct_95": None if impossible else ends,
        "impossible": impossible,
        "sentence": sentence,
    }
