"""Charts with hand-drawn axes, as SVG that is small enough to repeat, and as PNG.

Axes are linear, logarithmic, or signed with a logarithmic scale to both sides. Colours are classes,
which the page's style defines; a PNG gets those of the light scheme.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final, Literal, NamedTuple

import numpy as np
import vl_convert as vlc
from markupsafe import Markup

from solver.instrument.arrays import Floats
from vbaa_bench.report import palette
from vbaa_bench.report.numbers import short

# Round steps of a linear axis, times powers of ten.
_STEPS: Final = (1.0, 2.0, 5.0)
# Half sizes are chosen for equal areas.
_SHAPES: Final = {
    "circle": "M-1 0a1 1 0 1 0 2 0a1 1 0 1 0-2 0z",
    "square": "M-.9-.9h1.8v1.8h-1.8z",
    "diamond": "M0-1.25 1.25 0 0 1.25-1.25 0z",
    "triangle": "M0-1.3 1.2.85h-2.4z",
}

# The parts of style.css that a PNG needs, in the light scheme.
_STYLE: Final = """
text { font: 11px sans-serif; fill: #555d66 }
text.name { text-anchor: middle; fill: #1b1f23 }
text.label { font-size: 12.5px; fill: currentColor }
.grid { fill: none; stroke: #d8dde2; stroke-width: 0.7 }
.leader { stroke: currentColor; opacity: 0.45 }
.limit { stroke: #1b1f23; stroke-width: 1.4; stroke-dasharray: 6 4 }
.claim { stroke: #555d66; stroke-width: 1.4; stroke-dasharray: 1.5 3 } .ink { color: #1b1f23 }
.bar, .curve { stroke: currentColor; stroke-width: 1.8 } .band { opacity: 0.18 }
"""
_SCALE: Final = 2


@dataclass(frozen=True)
class Axis:
    """Axis from `low` to `high`.

    A "signed" axis is symmetric, asinh(value / unit): linear far below `unit`, logarithmic above.
    """

    label: str
    low: float
    high: float
    kind: Literal["linear", "log", "signed"] = "linear"
    unit: float = 1.0

    def share(self, values: Floats | float) -> Floats:
        """Compute the places of values along the axis, 0 at `low` and 1 at `high`; clipped."""
        low, high, places = (
            self._scaled(np.asarray(each)) for each in (self.low, self.high, values)
        )
        return np.asarray(np.clip((places - low) / (high - low), 0, 1), np.float64)

    def _scaled(self, values: Floats) -> Floats:
        if self.kind == "log":
            return np.log(np.maximum(values, 1e-300))
        return np.arcsinh(values / self.unit) if self.kind == "signed" else values

    def ticks(self) -> list[float]:
        """Choose round values: three to seven, those of a logarithmic axis in decades."""
        if self.kind == "linear":
            return _linear_ticks(self.low, self.high)
        if self.kind == "log":
            return _log_ticks(self.low, self.high)
        powers = [10.0**n for n in range(-9, 10) if 10.0**n <= self.high]
        # Labels of a chart with 150 px are then at least 15 px apart.
        apart = [power for power in powers if self.share(power) > 0.6]
        powers = apart[:: -(-len(apart) // 3)] if apart else [self.high]
        return [*(-power for power in reversed(powers)), 0.0, *powers]


def _linear_ticks(low: float, high: float) -> list[float]:
    rough = (high - low) / 5
    power = 10.0 ** np.floor(np.log10(rough))
    step = next((power * s for s in _STEPS if power * s >= rough), 10 * power)
    first, last = np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9)
    return [float(round(n * step, 12)) + 0.0 for n in np.arange(first, last + 1)]


def _log_ticks(low: float, high: float) -> list[float]:
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    coarse = [10.0**n for n in decades if low <= 10.0**n * 1.0001 and 10.0**n <= high * 1.0001]
    if len(coarse) >= 3:
        return coarse[:: -(-len(coarse) // 7)]
    fine = [s * 10.0**n for n in decades for s in _STEPS if low <= s * 10.0**n <= high]
    return fine or [low, high]


def log_axis(label: str, values: Floats, margin: float = 1.6) -> Axis:
    """Make a logarithmic axis of positive values, with a margin of this factor to both sides."""
    positive = values[(values > 0) & np.isfinite(values)]
    if not len(positive):
        return Axis(label, 0.1, 10.0, "log")
    return Axis(label, float(positive.min()) / margin, float(positive.max()) * margin, "log")


def signed_axis(label: str, values: Floats, small: float) -> Axis:
    """Make a symmetric axis of signed values, logarithmic above the decade of `small`."""
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if len(finite) and finite.max() > 0 else 1.0
    unit = 10.0 ** np.floor(np.log10(small if 0 < small < largest else largest / 10))
    return Axis(label, -1.15 * largest, 1.15 * largest, "signed", float(unit))


class Margins(NamedTuple):
    """Space around the plotting area [px]."""

    left: int = 46
    top: int = 8
    right: int = 14
    bottom: int = 36


class Plot:
    """A chart of `size` px with two axes, to which marks are added.

    `description` is the text for a screen reader.
    """

    def __init__(
        self,
        x: Axis,
        y: Axis,
        size: tuple[int, int],
        description: str,
        margins: Margins = Margins(),  # noqa: B008  (a named tuple cannot change)
    ) -> None:
        self.x, self.y, self.size = x, y, size
        self._description, self._margins = description, margins
        self._parts: list[str] = []

    def place(self, x: Floats | float, y: Floats | float) -> tuple[Floats, Floats]:
        """Convert values to pixels of the chart."""
        left, top, right, bottom = self._margins
        width, height = self.size
        return (
            left + self.x.share(x) * (width - left - right),
            top + (1 - self.y.share(y)) * (height - top - bottom),
        )

    def add(self, tag: str, content: str = "", /, **attributes: object) -> None:
        """Add an element; `_` at the end of a name is left out, other `_` are hyphens."""
        self._parts.append(element(tag, content, **attributes))

    def text(self, x: float, y: float, content: str, **attributes: object) -> None:
        """Add text at pixels of the chart."""
        self.add("text", escape(content), x=_n(x), y=_n(y), **attributes)

    def marker(self, x: float, y: float, shape: str, radius: float, **attributes: object) -> None:
        """Add a filled marker of one of the shapes of `palette`."""
        u, v = self.place(x, y)
        at = f"translate({_n(u)} {_n(v)})scale({_n(radius)})"
        self.add("path", "", d=_SHAPES[shape], transform=at, fill="currentColor", **attributes)

    def line(self, x: Floats, y: Floats, **attributes: object) -> None:
        """Add a line through points (n,); values beyond an axis are clipped to its end."""
        self.add("path", "", d=_path(*self.place(x, y)), fill="none", **attributes)

    def band(self, x: Floats, low: Floats, high: Floats, **attributes: object) -> None:
        """Add the area between two lines."""
        (u, v_low), (_, v_high) = self.place(x, low), self.place(x, high)
        outline = _path(np.concatenate([u, u[::-1]]), np.concatenate([v_low, v_high[::-1]]))
        self.add("path", "", d=f"{outline}z", fill="currentColor", **attributes)

    def across(self, y: float, **attributes: object) -> None:
        """Add a horizontal line over the whole width."""
        self.line(np.array([self.x.low, self.x.high]), np.array([y, y]), **attributes)

    def svg(self) -> Markup:
        """Return the chart."""
        width, height = self.size
        return Markup(
            f'<svg viewBox="0 0 {width} {height}" role="group" '
            f'aria-label="{escape(self._description)}">{self._frame()}{"".join(self._parts)}</svg>'
        )

    def _frame(self) -> str:
        left, top, right, bottom = self._margins
        width, height = self.size
        grid, labels = [], []
        for value in self.x.ticks():
            u = float(self.place(value, self.y.low)[0])
            grid.append(f"M{_n(u)} {top}V{height - bottom}")
            labels.append(_label(u, height - bottom + 14, value, "middle"))
        for value in self.y.ticks():
            v = float(self.place(self.x.low, value)[1])
            grid.append(f"M{left} {_n(v)}H{width - right}")
            labels.append(_label(left - 5, v + 4, value, "end"))
        middle = (left + width - right) / 2, (top + height - bottom) / 2
        titles = [
            element("text", escape(self.x.label), x=_n(middle[0]), y=height - 4, class_="name"),
            element(
                "text",
                escape(self.y.label),
                class_="name",
                transform=f"translate(11 {_n(middle[1])})rotate(-90)",
            ),
        ]
        ticks = f'<g aria-hidden="true">{"".join([*labels, *titles])}</g>'
        return element("path", d="".join(grid), class_="grid") + ticks


def element(tag: str, content: str = "", /, **attributes: object) -> str:
    """Write an element of SVG; attributes that are None are left out."""
    words = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(str(value))}"'
        for name, value in attributes.items()
        if value is not None
    )
    return f"<{tag}{words}>{content}</{tag}>" if content else f"<{tag}{words}/>"


def chart_png(chart: Markup, colours: Mapping[str, str], scale: float = _SCALE) -> bytes:
    """Convert a chart to PNG, `scale` pixels per px; `colours` are those of its CSS classes."""
    rules = "".join(f".{name} {{ color: {colour} }}" for name, colour in colours.items())
    head, _, body = chart.partition(">")
    # The converter knows no background of an svg: without paper, dark letters are on nothing.
    paper = f'<rect width="100%" height="100%" fill="{palette.LIGHT_PAGE}"/>'
    style = f"<style>{_STYLE}{rules}</style>"
    svg = f'{head} xmlns="http://www.w3.org/2000/svg">{style}{paper}{body}'
    return bytes(vlc.svg_to_png(svg, scale=scale))


def key(shape: str) -> Markup:
    """Draw a marker for a legend, in the colour of the text around it."""
    return Markup(
        '<svg class="key" viewBox="-1.5 -1.5 3 3" aria-hidden="true">'
        f'<path d="{_SHAPES[shape]}" fill="currentColor"/></svg>'
    )


def _label(u: float, v: float, value: float, anchor: str) -> str:
    return element("text", short(value, 3), x=_n(u), y=_n(v), text_anchor=anchor)


def _path(u: Floats, v: Floats) -> str:
    points: Sequence[str] = [f"{_n(x)} {_n(y)}" for x, y in zip(u, v, strict=True)]
    return "M" + "L".join(points)


def _n(value: Floats | float) -> str:
    """Format pixels with one decimal."""
    return f"{float(value):.1f}".removesuffix(".0")
