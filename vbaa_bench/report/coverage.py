"""Claimed against actual coverage of the stated uncertainties."""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import polars as pl
from markupsafe import Markup
from scipy.special import ndtr, ndtri

from vbaa_bench.report.chart import Axis, Plot
from vbaa_bench.report.numbers import short
from vbaa_bench.report.palette import Style
from vbaa_bench.scoring.scored_quantities import COVERAGE, SCORED_QUANTITIES
from vbaa_bench.scoring.statistics import coverage, error_statistics

_LABELS: Final = {"x_c": "contact distance", "force": "force", "psi": "psi", "compliance": "1/k_s"}
QUANTITIES: Final = [one for one in SCORED_QUANTITIES if one.name in _LABELS]
_FRACTIONS: Final = np.array([0.02, *np.arange(0.1, 0.95, 0.1), 0.99])
# Half the widths of the intervals in stated sigmas, and the fractions of Gaussian errors in them.
_SIGMAS: Final = np.sort([*ndtri((1 + _FRACTIONS) / 2), *COVERAGE.values()])
_CLAIMED: Final = 2 * ndtr(_SIGMAS) - 1
_MARKED: Final = tuple(2 * ndtr(sigmas) - 1 for sigmas in COVERAGE.values())


class Calibration(NamedTuple):
    """Actual coverage of one quantity by one method at `_CLAIMED`, and the mean squared error."""

    method: str
    quantity: str
    actual: Sequence[float]
    nees: float
    frames: int

    def at(self, claimed: float) -> float:
        """Return the actual coverage [%] at a claimed fraction."""
        return 100 * self.actual[int(np.argmin(np.abs(_CLAIMED - claimed)))]


def calibrations(rows: pl.DataFrame, methods: Sequence[str]) -> list[Calibration]:
    """Compute the calibration of every quantity and method with stated sigmas."""
    found = []
    for quantity in QUANTITIES:
        shares = [coverage(quantity, s).expression.alias(f"{s}") for s in _SIGMAS]
        nees = error_statistics(quantity)["nees"].expression
        table = (
            rows.drop_nulls(quantity.in_sigmas)
            .group_by("method")
            .agg(nees.alias("nees"), pl.len().alias("frames"), *shares)
        )
        records = {record["method"]: record for record in table.to_dicts()}
        found += [
            Calibration(
                name,
                _LABELS[quantity.name],
                [records[name][f"{sigmas}"] for sigmas in _SIGMAS],
                records[name]["nees"],
                records[name]["frames"],
            )
            for name in methods
            if name in records
        ]
    return found


def coverage_charts(
    found: Sequence[Calibration], styles: Mapping[str, Style], classes: Mapping[str, str]
) -> list[tuple[str, Markup]]:
    """Draw one chart per quantity, all with the same axes; return headings and charts."""
    return [
        (label, _chart(label, [one for one in found if one.quantity == label], styles, classes))
        for label in dict.fromkeys(one.quantity for one in found)
    ]


def _chart(
    label: str,
    found: Sequence[Calibration],
    styles: Mapping[str, Style],
    classes: Mapping[str, str],
) -> Markup:
    x, y = (Axis(name, 0, 100) for name in ("claimed coverage [%]", "actual coverage [%]"))
    sentences = "; ".join(f"{one.method} {short(one.at(0.95), 3)} % at 95 %" for one in found)
    plot = Plot(x, y, (300, 270), f"Actual against claimed coverage of {label}. {sentences}")
    plot.line(np.array([0.0, 100]), np.array([0.0, 100]), class_="limit")
    claimed = 100 * _CLAIMED
    for one in found:
        style = classes[one.method]
        plot.line(claimed, 100 * np.array(one.actual), class_=f"curve {style}")
        for at in _MARKED:
            tip = f"{one.method}: {short(one.at(at), 3)} % where {100 * at:.0f} % are claimed"
            shape = styles[one.method].shape
            plot.marker(100 * at, one.at(at), shape, 4, class_=style, data_t=tip)
    return plot.svg()
