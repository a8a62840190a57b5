"""Strata: sets of frames with similar true parameters, in which changes are also looked for."""

from typing import Final, NamedTuple

import polars as pl

# Chosen: the columns that distinguish the paper's experiments, and their names in tables.
_PARAMETERS: Final = {
    "push": "push",
    "contact_distance_at_rest_mm": "contact at",
    "normal_deg": "normal",
    "k_s_n_m": "k_s",
    "availability_asked": "AR",
    "hidden_by": "hidden by",
    "hidden_place": "hidden at",
}
_UNITS: Final = {
    "contact_distance_at_rest_mm": " mm",
    "normal_deg": " deg",
    "k_s_n_m": " N/m",
}
# Chosen: a stratum per value up to this number; more values form three groups of equal size,
# because every further stratum costs sensitivity in all others.
_MOST_VALUES: Final = 4
_GROUPS: Final = 3

ALL: Final = "all"


class Stratified(NamedTuple):
    """Frames with a column of labels for each parameter that divides them; `columns` names these.

    The first column puts all frames into one stratum.
    """

    frames: pl.DataFrame
    columns: list[str]


def stratify(frames: pl.DataFrame) -> Stratified:
    """Label the strata of one scene's frames by their true parameters.

    A parameter that has the same value everywhere gives no stratum, nor does one of more than four
    texts. A frame without a value is in no stratum of this parameter; objects without a stiffness
    are rigid.
    """
    labels = {f"stratum_{ALL}": pl.lit(ALL)}
    for name, title in _PARAMETERS.items():
        values = frames[name].unique().sort()
        rigid = name == "k_s_n_m" and 0 < values.null_count() < len(values)
        values = values.drop_nulls()
        label: pl.Expr | None = None
        unit = _UNITS.get(name, "")
        if len(values) + rigid in range(2, _MOST_VALUES + 1):
            label = pl.format(f"{title} {{}}{unit}", _text(name, values))
        elif len(values) > _MOST_VALUES and values.dtype.is_numeric():
            label = _grouped(name, values, title, unit)
        if label is not None:
            other = pl.lit(f"{title} rigid" if rigid else None, pl.String)
            labels[f"stratum_{name}"] = (
                pl.when(pl.col(name).is_not_null()).then(label).otherwise(other)
            )
    return Stratified(frames.with_columns(**labels), list(labels))


def _text(name: str, values: pl.Series) -> pl.Expr:
    if not values.dtype.is_numeric():
        return pl.col(name)
    return pl.col(name).replace_strict(
        values, [f"{value:g}" for value in values], default=None, return_dtype=pl.String
    )


def _grouped(name: str, values: pl.Series, title: str, unit: str) -> pl.Expr:
    """Label three groups with equally many distinct values each by their limits."""
    label = pl.lit(None, pl.String)
    for group in range(_GROUPS):
        first = group * len(values) // _GROUPS
        last = (group + 1) * len(values) // _GROUPS - 1
        low, high = values[first], values[last]
        text = f"{title} {low:g} to {high:g}{unit}"
        label = pl.when(pl.col(name).is_between(low, high)).then(pl.lit(text)).otherwise(label)
    return label
