"""Views of the report: everything that is computed anew for each stratum of the frames."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl
from markupsafe import Markup

from vbaa_bench.report import headline, speed_chart
from vbaa_bench.report.coverage import Calibration, calibrations, coverage_charts
from vbaa_bench.report.heat_map import Bins, HeatMap, heat_maps
from vbaa_bench.report.method_statistics import MethodStatistics, method_statistics
from vbaa_bench.report.outcomes import OutcomeTable, messages, outcomes
from vbaa_bench.report.palette import Style
from vbaa_bench.scoring.statistics import REPORT_TABLE, SUMMARY
from vbaa_bench.scoring.strata import Stratum


@dataclass(frozen=True)
class View:
    """Contents of the report for one stratum; `number` is 0 for all frames."""

    number: int
    heading: str
    label: str
    frames: int
    methods: Sequence[MethodStatistics]
    summary: Markup
    wide: Markup
    narrow: Markup
    omitted: str
    heat_maps: Sequence[HeatMap]
    calibrations: Sequence[Calibration]
    coverage: Sequence[tuple[str, Markup]]
    outcomes: OutcomeTable
    messages: Sequence[Mapping[str, Any]]

    @property
    def title(self) -> str:
        """Heading and label, such as "deflection 5 % of L"."""
        return f"{self.heading} {self.label}".strip()

    @property
    def contacts(self) -> bool:
        """Whether any frame has a contact."""
        return any(one.contacts for one in self.methods)

    @property
    def free(self) -> int:
        """Largest number of frames without contact of a method."""
        return max((one.free for one in self.methods), default=0)

    @property
    def refusals(self) -> bool:
        """Whether any frame is rightly refused."""
        return any(one.right_refusals for one in self.methods)

    @property
    def unequal(self) -> bool:
        """Whether methods have different numbers of frames."""
        return len({one.frames for one in self.methods}) > 1

    @property
    def stated(self) -> Sequence[str]:
        """Methods that state an uncertainty."""
        return list(dict.fromkeys(one.method for one in self.calibrations))

    @property
    def columns(self) -> dict[str, str]:
        """Headings of the table of scores, by figure: of those that any method has."""
        return {
            name: one.heading.report
            for name, one in REPORT_TABLE.items()
            if any(method.figures[name] is not None for method in self.methods)
        }


def by_error(scores: pl.DataFrame) -> list[str]:
    """List the methods, the smallest median error of x_c first, those without an error last."""
    error = SUMMARY["x_c_median_abs_pct_L"].expression
    table = scores.group_by("method", maintain_order=True).agg(error=error)
    return table.sort("error", nulls_last=True, maintain_order=True)["method"].to_list()


def views(
    scores: pl.DataFrame,
    methods: Sequence[str],
    strata: Sequence[Stratum],
    bins: Bins,
    styles: Mapping[str, Style],
    classes: Mapping[str, str],
) -> list[View]:
    """Make the view of every stratum from scores with groups, limits and bins."""
    # One stratum at a time: together they take several times the memory of all frames.
    numbers, limits = [], []
    for stratum in strata:
        part = scores.filter(stratum.contains)
        numbers.append(method_statistics(part))
        limits.append(speed_chart.limit_lines(part))
    scales = speed_chart.axes(numbers, limits)
    made = []
    for number, stratum in enumerate(strata):
        part = scores.filter(stratum.contains)
        rows = [numbers[number][name] for name in methods if name in numbers[number]]
        wide, narrow = (
            speed_chart.speed_chart(rows, limits[number], styles, classes, scales, size)
            for size in (speed_chart.WIDE, speed_chart.NARROW)
        )
        stated = calibrations(part, methods)
        made.append(
            View(
                number=number,
                heading=stratum.heading,
                label=stratum.label,
                frames=max((one.frames for one in rows), default=0),
                methods=rows,
                summary=headline.summary(rows),
                wide=wide,
                narrow=narrow,
                omitted=speed_chart.omitted(rows),
                heat_maps=heat_maps(part, bins, methods),
                calibrations=stated,
                coverage=coverage_charts(stated, styles, classes),
                outcomes=outcomes(part, methods),
                messages=messages(part),
            )
        )
    return made
