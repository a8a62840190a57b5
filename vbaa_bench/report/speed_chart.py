"""Speed against error: the median error of x_c over the time per frame, with the limit."""

from collections.abc import Collection, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
import polars as pl
from markupsafe import Markup
from scipy.optimize import isotonic_regression
from scipy.special import ndtri

from solver.instrument.arrays import Floats
from vbaa_bench.report.chart import Axis, Margins, Plot, log_axis
from vbaa_bench.report.method_statistics import MethodStatistics
from vbaa_bench.report.numbers import short
from vbaa_bench.report.palette import Style
from vbaa_bench.scoring.information_sets import SETS
from vbaa_bench.scoring.statistics import MEDIAN

# Distance between the centres of labels, for letters 12 px high.
LABEL_GAP_PX: Final = 16
# The chart is drawn for wide and for narrow windows, so that its letters have the same size.
WIDE: Final = (700, 440)
NARROW: Final = (360, 340)
_LABELS_PX: Final = {WIDE: 222, NARROW: 124}
# Letters that fit beside the plot.
_MAX_LETTERS: Final = {WIDE: 34, NARROW: 18}
_SHORT: Final = {
    "planar": "psi known",
    "image": "psi unknown",
    "moment": "moment sensor",
    "force": "force sensor",
}
# The paper's best case for the contact distance, section VI-A, in % of L.
CLAIM_PCT: Final = 2.0
# Limits nearer to each other than the width of their line are drawn as one [px].
_SAME_LINE_PX: Final = 4
# Chosen: the median of 99 quantiles is exact to 1 %.
_QUANTILES: Final = np.linspace(0.005, 0.995, 100)


class Axes(NamedTuple):
    """Axes that the charts of all strata share."""

    x: Axis
    y: Axis


def limit_lines(rows: pl.DataFrame) -> dict[str, float]:
    """Compute for each information set the median |error| of a method that attains the limit.

    Errors of an efficient method are Gaussian with the sigma of each frame's limit; the median of
    their absolute values over all frames of the set is returned, in % of L.
    """
    unique = rows.drop_nulls("x_c_limit_pct_L").unique(["information", *_frame_keys(rows)])
    return {
        str(name): MEDIAN.of(
            np.outer(part["x_c_limit_pct_L"].to_numpy(), ndtri((1 + _QUANTILES) / 2))
        )
        for (name,), part in unique.sort("information").group_by("information", maintain_order=True)
    }


def _frame_keys(rows: pl.DataFrame) -> list[str]:
    return [name for name in ("rig", "frame_id") if name in rows.columns]


def axes(
    strata: Sequence[Mapping[str, MethodStatistics]], limits: Sequence[Mapping[str, float]]
) -> Axes:
    """Choose the axes that contain the methods and limits of all strata."""
    methods = [one for stratum in strata for one in stratum.values() if is_drawn(one)]
    times = [t for one in methods for t in (one.ms, *(one.ms_95 or ())) if t]
    errors = [e for one in methods for e in (one.median, *(one.median_95 or ())) if e]
    errors += [value for lines in limits for value in lines.values()]
    errors += [CLAIM_PCT]
    return Axes(
        log_axis("time per frame, image to estimate [ms]", np.array(times)),
        log_axis("median |error| of x_c [% of L]", np.array(errors)),
    )


def is_drawn(one: MethodStatistics) -> bool:
    """Test whether a method has a time and a median error, and so a place in the chart."""
    return bool(one.ms and one.median)


def omitted(methods: Collection[MethodStatistics]) -> str:
    """Name the methods that the chart leaves out, each with the reason, as a sentence."""
    reasons = [
        f"{one.method} ({_reason(one)})" for one in methods if not is_drawn(one) and one.frames
    ]
    return f"Not in the chart: {', '.join(reasons)}." if reasons else ""


def _reason(one: MethodStatistics) -> str:
    if one.median is None:
        return "no estimate of x_c"
    error = f"median error {short(one.median)} % of L"
    return f"{error}, no time was measured" if not one.ms else f"{error}, {short(one.ms)} ms"


def speed_chart(
    methods: Collection[MethodStatistics],
    limits: Mapping[str, float],
    styles: Mapping[str, Style],
    classes: Mapping[str, str],
    scales: Axes,
    size: tuple[int, int] = WIDE,
) -> Markup:
    """Draw the chart; labels are in a column beside the plot, joined to their markers by a line.

    `classes` are the CSS classes of the methods, which define their colours.
    """
    drawn = [one for one in methods if is_drawn(one)]
    margins = Margins(right=_LABELS_PX[size])
    sentences = "; ".join(_sentence(one) for one in drawn)
    plot = Plot(*scales, size, f"Median error of x_c against time per frame. {sentences}", margins)
    lines = [*_limit_lines(limits, plot), _PAPER]
    for line in lines:
        plot.across(line.value, class_=line.class_, data_t=line.tip)
    anchors = [plot.place(one.ms or 0.0, one.median or 0.0) for one in drawn]
    anchors += [plot.place(scales.x.high, line.value) for line in lines]
    label_v = spread(np.array([float(v) for _, v in anchors]), LABEL_GAP_PX)
    # All labels stay inside of the chart.
    label_v -= max(label_v.max(initial=0.0) - (size[1] - 12), 0)
    left = size[0] - _LABELS_PX[size]
    for one, (u, v), at in zip(drawn, anchors, label_v, strict=False):
        style = classes[one.method]
        plot.add("path", d=f"M{u:.0f} {v:.1f}L{left} {at:.1f}", class_=f"leader {style}")
        _bars(plot, one, style)
        plot.marker(
            one.ms or 0.0,
            one.median or 0.0,
            styles[one.method].shape,
            5,
            class_=style,
            data_t=_sentence(one),
            tabindex=0,
            role="img",
            aria_label=_sentence(one),
        )
        numbers = f" {short(one.median)} %, {short(one.ms)} ms" if size == WIDE else ""
        label = _fitting(one.method, _MAX_LETTERS[size] - len(numbers))
        plot.text(left + 4, float(at) + 4, label + numbers, class_=f"{style} label")
    for line, at in zip(lines, label_v[len(drawn) :], strict=True):
        numbers = f" {line.number}" if size == WIDE and line.number else ""
        text = _fitting(line.label, _MAX_LETTERS[size] - len(numbers))
        plot.text(left + 4, float(at) + 4, text + numbers, class_="ink label")
    return plot.svg()


class _Line(NamedTuple):
    """A line across the chart: its error [% of L], CSS class, tooltip, label and number."""

    value: float
    class_: str
    tip: str
    label: str
    number: str = ""


_PAPER: Final = _Line(CLAIM_PCT, "claim", "the paper's best case: 2 % of L", "paper, 2 %")


def _limit_lines(limits: Mapping[str, float], plot: Plot) -> list[_Line]:
    """Make a line of each limit; limits that would be drawn over each other have one line."""
    together: list[list[str]] = []
    for name in sorted(limits, key=lambda name: limits[name]):
        here, first = (
            float(plot.place(plot.x.high, limits[one])[1])
            for one in (name, together[-1][0] if together else name)
        )
        if together and first - here < _SAME_LINE_PX:
            together[-1].append(name)
        else:
            together.append([name])
    lines = []
    for names in together:
        words = ", ".join(_SHORT.get(name, name) for name in names)
        tip = "; ".join(f"limit, {SETS[name]}: {limits[name]:.2g} %" for name in names)
        label = "limit" if len(together) == 1 < len(names) else f"limit, {words}"
        numbers = dict.fromkeys(short(limits[name]) for name in (names[0], names[-1]))
        number = f"{'–'.join(numbers)} %"
        lines.append(_Line(limits[names[0]], "limit", tip, label, number))
    return lines


def _fitting(text: str, letters: int) -> str:
    return text if len(text) <= letters else f"{text[: letters - 1]}…"


def _bars(plot: Plot, one: MethodStatistics, style: str) -> None:
    time, error = one.ms or 0.0, one.median or 0.0
    for xs, ys in (
        ((one.ms_95 or (time, time)), (error, error)),
        ((time, time), (one.median_95 or (error, error))),
    ):
        plot.line(np.array(xs), np.array(ys), class_=f"bar {style}")


def _sentence(one: MethodStatistics) -> str:
    low, high = one.median_95 or (one.median, one.median)
    return (
        f"{one.method}: {short(one.median)} % of L ({short(low)} to {short(high)}), "
        f"{short(one.ms)} ms"
    )


def spread(wanted: Floats, gap: float) -> Floats:
    """Place labels beside a plot, as near to their points as possible without overlap.

    Return places (n,) at least `gap` apart, in the order of `wanted` (n,), with the least sum of
    squared distances from it: after subtracting i * gap from the i-th place, places must not
    decrease, which is isotonic regression.
    """
    order = np.argsort(wanted, kind="stable")
    steps = gap * np.arange(len(order))
    places = np.empty(len(order))
    places[order] = isotonic_regression(np.asarray(wanted, float)[order] - steps).x + steps
    return places
