"""Picture of the ladder: the error of every frame on each rung, and its root mean square."""

from typing import Final

import numpy as np

from results.ladder.measure import DEFLECTIONS, Ladder
from results.ladder.rungs import LIMIT
from vbaa_bench.report.chart import Axis, Margins, Plot, chart_png

_SIZE: Final = (760, 500)
_MARGINS: Final = Margins(left=150, top=58, right=66, bottom=40)
_COLOURS: Final = {"low": "#0b57d0", "middle": "#9a5b00", "high": "#b3261e", "ink": "#1b1f23"}
_SHAPES: Final = ("circle", "square", "triangle")
_SYMBOLS: Final = "\u25cf\u25a0\u25b2"
# What the paper states [% of L].
_PAPER: Final = 2.0
# Smallest error that is drawn [% of L]; smaller ones are at the edge.
_LEAST: Final = 5e-4


class _Names(Axis):
    """Axis whose places have names instead of numbers."""

    def ticks(self) -> list[float]:
        return []


def png(ladder: Ladder) -> bytes:
    """Draw the ladder as PNG, its first rung at the top."""
    count = len(ladder.rungs)
    x = Axis("error of the contact distance x_c [% of L]", _LEAST, 20.0, "log")
    y = _Names("", -count + 0.4, 0.6)
    plot = Plot(x, y, _SIZE, "Error of the contact distance on every rung of the ladder", _MARGINS)
    _draw_legend(plot)
    plot.line(np.full(2, _PAPER), np.array([y.low, y.high]), class_="limit")
    u, v = plot.place(_PAPER, y.high)
    plot.text(float(u), float(v) - 5, f"the paper states {_PAPER:g} %", class_="name")
    rows = list(ladder.rows())
    for name, colour, shape in zip(DEFLECTIONS, _COLOURS, _SHAPES, strict=False):
        chosen = ladder.pushes == name
        for number, errors in enumerate(ladder.rungs):
            if errors.rung == LIMIT:
                continue
            sizes = np.abs(errors.x_c[chosen])
            spread = np.linspace(-0.3, 0.3, len(sizes))
            for size, beside in zip(sizes, spread, strict=True):
                plot.marker(size, beside - number, "circle", 1.2, class_=colour, opacity=0.35)
        key = f"x_c_rmse_pct_L_at_{name.partition(' ')[0]}_pct"
        means = np.array([row[key] for row in rows])
        plot.line(means, -np.arange(count, dtype=np.float64), class_=f"curve {colour}", opacity=0.8)
        for number, mean in enumerate(means):
            plot.marker(mean, -number, shape, 5, class_=colour)
    for number, row in enumerate(rows):
        _, v = plot.place(x.low, -float(number))
        name = row["rung"]
        plot.text(_MARGINS.left - 8, float(v) + 4, name, class_="label ink", text_anchor="end")
        right = _SIZE[0] - _MARGINS.right + 8
        plot.text(right, float(v) + 4, f"{row['x_c_rmse_pct_L']:.2g} %", class_="label ink")
    return chart_png(plot.svg(), _COLOURS)


def _draw_legend(plot: Plot) -> None:
    """Write above the chart what its marks are."""
    top, right = 18.0, _SIZE[0] - _MARGINS.right
    plot.text(_MARGINS.left, top, "RMSE at a deflection of", class_="label ink")
    for number, (name, colour) in enumerate(zip(DEFLECTIONS, _COLOURS, strict=False)):
        mark = f"{_SYMBOLS[number]} {name}"
        plot.text(_MARGINS.left + 150 + 70 * number, top, mark, class_=f"label {colour}")
    plot.text(right, top, "dots: single frames", class_="label ink", text_anchor="end")
    plot.text(right + 8, top, "RMSE", class_="label ink")
