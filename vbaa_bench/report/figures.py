"""Charts as PNG, and figures of the README: speed against error, a frame with its estimates."""

from collections.abc import Mapping, Sequence
from typing import Final

import cv2
import numpy as np
import vl_convert as vlc
from markupsafe import Markup

from vbaa_bench.report import gallery, palette
from vbaa_bench.scoring.overlay import Overlay

# The parts of style.css that a chart needs, in the light scheme.
_STYLE: Final = """
text { font: 11px sans-serif; fill: #555d66 }
text.name { text-anchor: middle; fill: #1b1f23 }
text.label { font-size: 12.5px; fill: currentColor }
.grid { fill: none; stroke: #d8dde2; stroke-width: 0.7 }
.leader { stroke: currentColor; opacity: 0.45 }
.limit { stroke: #1b1f23; stroke-width: 1.4; stroke-dasharray: 6 4 } .ink { color: #1b1f23 }
.bar, .curve { stroke: currentColor; stroke-width: 1.8 } .band { opacity: 0.18 }
"""
_SCALE: Final = 2


def speed_png(chart: Markup, methods: Sequence[str]) -> bytes:
    """Convert the chart of speed against error of a page to PNG; `methods` in the page's order."""
    styles = palette.styles(methods)
    return chart_png(chart, {f"m{n}": styles[name].light for n, name in enumerate(methods)})


def chart_png(chart: Markup, colours: Mapping[str, str], scale: float = _SCALE) -> bytes:
    """Convert a chart to PNG, `scale` pixels per px; `colours` are those of its CSS classes."""
    rules = "".join(f".{name} {{ color: {colour} }}" for name, colour in colours.items())
    head, _, body = chart.partition(">")
    # The converter knows no background of an svg: without paper, dark letters are on nothing.
    paper = f'<rect width="100%" height="100%" fill="{palette.LIGHT_PAGE}"/>'
    style = f"<style>{_STYLE}{rules}</style>"
    svg = f'{head} xmlns="http://www.w3.org/2000/svg">{style}{paper}{body}'
    return bytes(vlc.svg_to_png(svg, scale=scale))


def overlay_png(frame: Overlay, colours: Mapping[str, tuple[int, int, int]]) -> bytes:
    """Draw a frame and its enlarged contact side by side, as PNG."""
    parts = (gallery.strip(frame, colours), gallery.close_up(frame, colours, scale=6))
    height = max(map(len, parts))
    canvases = []
    for part in parts:
        padded = np.full((height, part.shape[1], 3), 255, np.uint8)
        padded[: len(part)] = part
        canvases.append(padded)
    gap = np.full((height, 8, 3), 255, np.uint8)
    _, picture = cv2.imencode(".png", np.hstack([canvases[0], gap, canvases[1]]))
    return bytes(picture)
