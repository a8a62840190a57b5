"""Labels of frames for training: numbers of the truth, and two that are computed from it."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl

from solver.instrument.errors import InputError, quoted, suggestion

HAS_CONTACT: Final = pl.col("x_c_mm").is_not_null()
# A rigid object has compliance 0; without contact the compliance is null. A column without any
# value has no type.
TRUE_COMPLIANCE: Final = pl.when(HAS_CONTACT).then(
    (1e3 / pl.col("k_s_n_m").cast(pl.Float64)).fill_null(0.0)
)
_COMPUTED: Final = {"contact": HAS_CONTACT, "compliance_mm_per_n": TRUE_COMPLIANCE}
# The quantities that the methods of the paper estimate.
USUAL_LABELS: Final = (
    "contact",
    "x_c_mm",
    "y_c_mm",
    "s_c_mm",
    "theta_c_deg",
    "psi_deg",
    "force_n",
    "f_n",
    "compliance_mm_per_n",
)


def label_columns(schema: Mapping[str, pl.DataType]) -> list[str]:
    """List the columns of the truth that can be labels: numbers, lists of them, and computed ones.

    `schema` maps the columns of a truth.parquet to their types. The step of a push is no label.
    """
    numbers = [name for name, dtype in schema.items() if _is_number(dtype)]
    return [*(name for name in numbers if name != "step"), *_COMPUTED]


def select_labels(truth: pl.LazyFrame, labels: Sequence[str]) -> pl.LazyFrame:
    """Select frame_id and labels from a table of the truth, as 32-bit numbers.

    Labels that the table does not have are left out.
    """
    schema = truth.collect_schema()
    existing = [name for name in labels if name in label_columns(schema)]
    return truth.select("frame_id", *(_expression(name, schema) for name in existing))


def check_labels(labels: Sequence[str], existing: Collection[str], root: Path) -> None:
    """Raise InputError, which suggests another label, unless all `labels` are `existing` ones."""
    for name in labels:
        if name not in existing:
            raise InputError(
                f"{root}: the label {quoted(name)} is no column of numbers of the truth; "
                f"{suggestion(name, sorted(existing))}"
            )


def to_array(column: pl.Series, root: Path) -> np.ndarray:
    """Convert a column of numbers to an array (n,), of lists (n, m); null becomes NaN.

    Booleans without null stay booleans, other numbers become 32-bit floats. Raises InputError if
    the lists have different lengths.
    """
    if column.dtype == pl.Boolean and not column.null_count():
        return column.to_numpy()
    if not isinstance(column.dtype, pl.List):
        return column.cast(pl.Float32).to_numpy()
    widths = column.list.len().drop_nulls().unique().to_list() or [0]
    if len(widths) > 1:
        raise InputError(
            f"{root}: the label {column.name} has lists of {min(widths)} to {max(widths)} numbers, "
            "allowed are lists of one length"
        )
    array = np.full((len(column), widths[0]), np.nan, np.float32)
    numbers = column.drop_nulls().explode(empty_as_null=False).cast(pl.Float32).to_numpy()
    array[column.is_not_null().to_numpy()] = numbers.reshape(-1, widths[0])
    return array


def _is_number(dtype: pl.DataType) -> bool:
    inner = dtype.inner if isinstance(dtype, pl.List) else dtype
    return inner.is_numeric() or inner in (pl.Boolean, pl.Null)


def _expression(name: str, schema: Mapping[str, pl.DataType]) -> pl.Expr:
    if name in _COMPUTED:
        return _COMPUTED[name].alias(name)
    if isinstance(schema[name], pl.List):
        return pl.col(name).cast(pl.List(pl.Float32))
    return pl.col(name) if schema[name] == pl.Boolean else pl.col(name).cast(pl.Float32)
