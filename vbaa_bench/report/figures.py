"""Figures of the README: speed against error, and a frame with truth and estimates."""

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
svg { background: #ffffff } text { font: 11px sans-serif; fill: #555d66 }
text.name { text-anchor: middle; fill: #1b1f23 }
text.label { font-size: 12.5px; fill: currentColor }
.grid { fill: none; stroke: #d8dde2; stroke-width: 0.7 }
.leader { stroke: currentColor; opacity: 0.45 }
.limit { stroke: #1b1f23; stroke-width: 1.4; stroke-dasharray: 6 4 } .ink { color: #1b1f23 }
.bar { stroke: currentColor; stroke-width: 1.8 }
"""
_SCALE: Final = 2


def speed_png(chart: Markup, methods: Sequence[str]) -> bytes:
    """Convert the chart of speed against error of a page to PNG; `methods` in the page's order."""
    styles = palette.styles(methods)
    colours = "".join(
        f".m{number} {{ color: {styles[name].light} }}" for number, name in enumerate(methods)
    )
    head, _, body = chart.partition(">")
    svg = f'{head} xmlns="http://www.w3.org/2000/svg"><style>{_STYLE}{colours}</style>{body}'
    return bytes(vlc.svg_to_png(svg, scale=_SCALE))


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
