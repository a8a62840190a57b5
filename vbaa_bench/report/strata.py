"""Strata of the frames: classes of one condition, for which the report repeats its statistics."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from vbaa_bench.report.numbers import short
from vbaa_bench.scoring.factors import PREFIX

# Chosen: more classes of one condition do not fit a menu; each stratum takes 30 kB of the page.
_MAX_VALUES: Final = 6
_MAX_STRATA: Final = 30
# Conditions: heading, column, unit. Those of `factor.` exist in collections only.
_CONDITIONS: Final = (
    ("deflection", "deflection_pct", "% of L"),
    ("contact distance", "true_x_c_mm", "mm"),
    ("inclination psi", "true_psi_deg", "deg"),
    ("availability ratio", "availability_asked", ""),
    ("hidden by", "hidden_by", ""),
    ("stiffness over the beam's", "k_s_over_k_beam", ""),
    ("signal-to-noise ratio", "snr", ""),
    ("light", f"{PREFIX}light", ""),
    ("read noise", f"{PREFIX}sensor.read_noise_e", "electrons"),
    ("beam width", f"{PREFIX}beam_width_px", "px"),
)


class Stratum(NamedTuple):
    """A class of frames: its condition, its label, and which rows of the scores it contains."""

    heading: str
    label: str
    contains: pl.Expr


def strata(scores: pl.DataFrame) -> list[Stratum]:
    """List the strata of the scores, all frames first.

    A number with at most 6 different values (to three digits) has a class for each, any other three
    classes with equally many frames. Conditions in which the frames do not differ are left out.
    """
    chosen = [Stratum("", "all frames", pl.lit(value=True))]
    for heading, column, unit in _CONDITIONS:
        if column in scores.columns:
            classes = list(_classes(scores[column], column, unit))
            if len(classes) > 1 and len(chosen) + len(classes) <= _MAX_STRATA:
                chosen += [Stratum(heading, label, contains) for label, contains in classes]
    return chosen


def _classes(values: pl.Series, column: str, unit: str) -> Iterator[tuple[str, pl.Expr]]:
    values = values.drop_nulls()
    if not values.dtype.is_numeric():
        names = sorted(values.unique())
        if len(names) <= _MAX_VALUES:
            yield from ((str(name), pl.col(column) == name) for name in names)
        return
    rounded = values.cast(pl.Float64).round_sig_figs(3).unique().sort().to_list()
    if len(rounded) <= _MAX_VALUES:
        key = pl.col(column).cast(pl.Float64).round_sig_figs(3)
        yield from ((f"{short(value, 3)} {unit}".strip(), key == value) for value in rounded)
        return
    ends = np.quantile(values.to_numpy(), [0, 1 / 3, 2 / 3, 1])
    yield from _between(column, unit, ends.tolist())


def _between(column: str, unit: str, ends: Sequence[float]) -> Iterator[tuple[str, pl.Expr]]:
    for number, (low, high) in enumerate(pairwise(ends)):
        within = pl.col(column) <= high
        if number:
            within &= pl.col(column) > low
        label = f"{short(low, 3)} to {short(high, 3)} {unit}".strip()
        yield label, within
