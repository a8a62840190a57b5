"""Strata: the conditions by which frames are divided, and the classes of each.

Classes with fixed limits compare methods over all datasets alike; they are columns of the scores,
see `conditions.STRATA`. Reports, comparisons and tables of factors divide the frames that they have
by their values: a class for each of a few values, or three classes of a number. These differ on
purpose. Those of a report have equally many frames. Those of a comparison have equally many
different values, so that they do not depend on how many frames of a value are paired. Those of a
factor have equally many frames, except that equal values are never divided.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from polars import selectors

from vbaa_bench.dataset.readers import Truth
from vbaa_bench.scoring.conditions import FACTOR_PREFIX
from vbaa_bench.scoring.scene_values import first_light, scene_value

# Name of the stratum that contains all frames.
ALL: Final = "all"
NO_CONTACT: Final = "no contact"
# Limits of the classes. Chosen: between the values of the paper's experiments, so that small
# deviations from these change no class; each class is about twice as wide as the one before.
_DEFLECTION_PCT: Final = (1.0, 3.0, 7.0, 14.0, 28.0)
_DISTANCE_PCT_L: Final = (10.0, 30.0, 55.0, 80.0, 95.0)
_AVAILABILITY_PCT: Final = (25.0, 45.0, 65.0, 85.0, 99.0)
_PSI_DEG: Final = (5.0, 15.0, 35.0, 65.0)
_NOISE_PCT: Final = (0.5, 1.0, 2.0, 4.0)

# Classes into which many numbers are divided. Chosen: with more, each has too few frames.
_GROUPS: Final = 3


class Condition(NamedTuple):
    """A condition that divides frames: its column, and its title and unit in labels."""

    column: str
    title: str
    unit: str = ""


# Conditions of a report; those of factors exist in collections only.
_REPORTED: Final = (
    Condition("deflection_pct", "deflection", "% of L"),
    Condition("true_x_c_mm", "contact distance", "mm"),
    Condition("true_psi_deg", "inclination psi", "deg"),
    Condition("availability_asked", "availability ratio"),
    Condition("hidden_by", "hidden by"),
    Condition("k_s_over_k_beam", "stiffness over the beam's"),
    Condition("snr", "signal-to-noise ratio"),
    Condition(f"{FACTOR_PREFIX}light", "light"),
    Condition(f"{FACTOR_PREFIX}sensor.read_noise_e", "read noise", "electrons"),
    Condition(f"{FACTOR_PREFIX}beam_width_px", "beam width", "px"),
)
# Chosen: more classes of one condition do not fit a menu; each stratum takes 30 kB of the page.
_MOST_REPORTED_VALUES: Final = 6
_MOST_REPORTED: Final = 30

# Conditions of a comparison. Chosen: those that distinguish the paper's experiments.
_COMPARED: Final = (
    Condition("push", "push"),
    Condition("contact_distance_at_rest_mm", "contact at", "mm"),
    Condition("normal_deg", "normal", "deg"),
    Condition("k_s_n_m", "k_s", "N/m"),
    Condition("availability_asked", "AR"),
    Condition("hidden_by", "hidden by"),
    Condition("hidden_place", "hidden at"),
)
# Chosen: more values form groups, because every further stratum costs sensitivity in all others.
_MOST_COMPARED_VALUES: Final = 4


def fixed_classes(truth: Truth) -> pl.DataFrame:
    """Return the fixed classes of each frame: `frame_id` and the columns STRATA, all texts.

    Classes are of the tip's deflection and the contact distance in % of L, the availability
    ratio (eq. 32), |psi|, and the noise of a pixel in % of the beam's peak: shot and read noise of
    the scene's image sensor. `light` is the kind of the first light.
    """
    length = truth.manifest["true_rig"]["beam_length_mm"]
    touched = pl.col("x_c_mm").is_not_null()
    availability = (
        pl.col("availability_seen").cast(pl.Float64)
        if "availability_seen" in truth.frames.columns
        else pl.lit(None, pl.Float64)
    )
    distance = 100 / length * pl.col("x_c_mm").cast(pl.Float64)
    psi = pl.col("psi_deg").cast(pl.Float64).abs()
    return truth.frames.select(
        "frame_id",
        deflection_class=_class(pl.col("deflection_pct"), _DEFLECTION_PCT, "%"),
        contact_distance_class=_if(touched, _class(distance, _DISTANCE_PCT_L, "% of L")),
        availability_class=_class(100 * availability.fill_null(1.0), _AVAILABILITY_PCT, "%"),
        psi_class=_if(touched, _class(psi, _PSI_DEG, "deg")),
        light=_light(truth),
        noise_class=_class(_noise_pct(truth), _NOISE_PCT, "%"),
        scene=pl.lit(truth.manifest["scene"].get("title", "")),
    )


class Stratum(NamedTuple):
    """A class of frames: its condition, its label, and which rows of the scores it contains."""

    heading: str
    label: str
    contains: pl.Expr


def reported_strata(scores: pl.DataFrame, number: Callable[[float], str]) -> list[Stratum]:
    """List the strata of a report, all frames first; `number` formats a number of a label.

    A number with at most 6 different values (to three digits) has a class for each, any other three
    classes with equally many frames. Conditions in which the frames do not differ are left out.
    """
    strata = [Stratum("", "all frames", pl.lit(value=True))]
    for condition in _REPORTED:
        if condition.column in scores.columns:
            classes = list(_reported_classes(scores[condition.column], condition, number))
            if len(classes) > 1 and len(strata) + len(classes) <= _MOST_REPORTED:
                strata += classes
    return strata


def _reported_classes(
    values: pl.Series, condition: Condition, number: Callable[[float], str]
) -> Iterator[Stratum]:
    column, title, unit = condition
    values = values.drop_nulls()
    if not values.dtype.is_numeric():
        names = sorted(values.unique())
        if len(names) <= _MOST_REPORTED_VALUES:
            yield from (Stratum(title, str(name), pl.col(column) == name) for name in names)
        return
    rounded = values.cast(pl.Float64).round_sig_figs(3).unique().sort().to_list()
    if len(rounded) <= _MOST_REPORTED_VALUES:
        key = pl.col(column).cast(pl.Float64).round_sig_figs(3)
        for value in rounded:
            yield Stratum(title, f"{number(value)} {unit}".strip(), key == value)
        return
    ends = np.quantile(values.to_numpy(), np.arange(_GROUPS + 1) / _GROUPS)
    for place, (low, high) in enumerate(pairwise(ends.tolist())):
        within = pl.col(column) <= high
        if place:
            within &= pl.col(column) > low
        yield Stratum(title, f"{number(low)} to {number(high)} {unit}".strip(), within)


class Stratified(NamedTuple):
    """Frames with a column of labels for each condition that divides them; `columns` names these.

    The first column puts all frames into one stratum.
    """

    frames: pl.DataFrame
    columns: list[str]


def compared_strata(frames: pl.DataFrame) -> Stratified:
    """Label the strata of one scene's frames for a comparison.

    A condition that has the same value everywhere gives no stratum, nor does one of more than four
    texts. A frame without a value is in no stratum of this condition; objects without a stiffness
    are rigid.
    """
    labels = {f"stratum_{ALL}": pl.lit(ALL)}
    for condition in _COMPARED:
        strata = list(_compared_classes(frames[condition.column], condition))
        if len(strata) > 1:
            labels[f"stratum_{condition.column}"] = pl.coalesce(
                pl.when(stratum.contains).then(pl.lit(stratum.label)) for stratum in strata
            )
    return Stratified(frames.with_columns(**labels), list(labels))


def _compared_classes(column: pl.Series, condition: Condition) -> Iterator[Stratum]:
    name, title, unit = condition
    values = column.drop_nulls().unique().sort()
    rigid = name == "k_s_n_m" and column.null_count() > 0
    is_number = values.dtype.is_numeric()
    if len(values) + rigid <= _MOST_COMPARED_VALUES:
        ranges = [(f"{v:g}" if is_number else v, v, v) for v in values]
    elif is_number:
        starts = [group * len(values) // _GROUPS for group in range(_GROUPS + 1)]
        ends = [(values[first], values[last - 1]) for first, last in pairwise(starts)]
        ranges = [(f"{low:g} to {high:g}", low, high) for low, high in ends]
    else:
        return
    for text, low, high in ranges:
        label = f"{title} {text} {unit}".strip()
        yield Stratum(title, label, pl.col(name).is_between(pl.lit(low), pl.lit(high)))
    if rigid:
        yield Stratum(title, f"{title} rigid", pl.col(name).is_null())


class Group(NamedTuple):
    """Frames of one group of a factor, and the range or value of the factor in it."""

    name: str
    frames: pl.DataFrame


def factor_groups(scores: pl.DataFrame, factor: str) -> list[Group]:
    """Divide frames by a factor; empty if they do not differ in it.

    Numbers are divided into three groups of equal size, except that equal numbers stay together;
    other factors by their values. Frames without a value are in no group.
    """
    known = scores.drop_nulls(factor)
    values = known[factor]
    if values.n_unique() < 2:
        return []
    if values.dtype.is_numeric() and values.n_unique() > _GROUPS:
        # Equal values have equal ranks: they are in one group, however many they are.
        ranks = ((values.rank("average") - 1) * _GROUPS / known.height).floor()
        parts = [known.filter(ranks == n) for n in range(_GROUPS)]
        return [Group(_range(part[factor]), part) for part in parts if part.height]
    groups = sorted(known.group_by(factor), key=lambda group: str(group[0]))
    return [Group(str(value), part) for (value,), part in groups]


def _range(values: pl.Series) -> str:
    low, high = (
        np.format_float_positional(float(end), 3, fractional=False, trim="-")
        for end in (np.min(values.to_numpy()), np.max(values.to_numpy()))
    )
    return low if low == high else f"{low} to {high}"


def with_labels(scores: pl.DataFrame, by: str) -> pl.DataFrame:
    """Replace a condition or class by labels for a table with a row for each of them.

    Stiffness ratios are grouped by decade, because they differ in every frame.
    """
    # Conditions are computed from equilibria; those of one setting differ in the last digits.
    rounded = scores.with_columns((selectors.by_name(by) & selectors.float()).round_sig_figs(9))
    column = pl.col(by)
    if by == "k_s_over_k_beam":
        decade = column.log10().floor()
        label = pl.format("{} – {}", 10.0**decade, 10.0 ** (decade + 1))
    elif by == "k_s_n_m":
        label = column.cast(pl.String)
    else:
        return rounded
    rigid = pl.when(~pl.col("free")).then(pl.lit("rigid"))
    trimmed = label.str.replace_all(r"\.0\b", "")
    return rounded.with_columns(pl.when(column.is_null()).then(rigid).otherwise(trimmed).alias(by))


def class_order(value: Any) -> tuple[int, float, str]:
    """Make a sort key: numbers by size, texts such as "3 to 7 %" by their first number, None last.

    Other texts are between numbers and None.
    """
    if value is None:
        return (2, 0.0, "")
    words = str(value).rstrip("°").split()
    try:
        return (0, float(words[0]), str(value))
    except (IndexError, ValueError):
        return (1, 0.0, str(value))


def _class(value: pl.Expr, limits: Sequence[float], unit: str) -> pl.Expr:
    """Label the class of a value, such as "3 to 7 %"; the lower limit is included."""
    label = pl.lit(f"{limits[-1]:g} {unit} or more")
    for low, high in reversed(list(zip((0.0, *limits), limits, strict=False))):
        label = pl.when(value < high).then(pl.lit(f"{low:g} to {high:g} {unit}")).otherwise(label)
    return label


def _if(condition: pl.Expr, label: pl.Expr) -> pl.Expr:
    return pl.when(condition).then(label).otherwise(pl.lit(NO_CONTACT))


def _light(truth: Truth) -> pl.Expr:
    fixed = first_light(truth)
    if "drawn.lights.0.kind" in truth.frames.columns:
        return pl.col("drawn.lights.0.kind").fill_null(fixed)
    return pl.lit(fixed)


def _noise_pct(truth: Truth) -> pl.Expr:
    """Return the standard deviation of a pixel at the beam's peak, in % of the peak."""
    well, peak, read = (
        scene_value(truth, f"sensor.{key}", default).cast(pl.Float64)
        for key, default in (("full_well_e", None), ("beam_peak_pct", 100.0), ("read_noise_e", 0.0))
    )
    electrons = well * peak / 100
    return (100 * (electrons + read**2).sqrt() / electrons).fill_null(0.0)  # an ideal sensor
