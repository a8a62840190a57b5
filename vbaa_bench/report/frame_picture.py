"""Part of a frame's image as SVG, with marks over it in the image's own pixels."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import cv2
import numpy as np
from markupsafe import Markup, escape

from solver.instrument.arrays import Floats
from vbaa_bench.report.chart import element
from vbaa_bench.report.gallery import display, webp_uri
from vbaa_bench.scoring.overlay import Overlay

# Wider parts are reduced. Chosen: twice the width of a column of text.
_MAX_WIDTH_PX: Final = 1024


class Box(NamedTuple):
    """Part of an image in whole pixels; right and bottom are beyond it."""

    left: int
    top: int
    right: int
    bottom: int


def box_around(points: Floats, margin: float) -> Box:
    """Return the box that contains points (n, 2), with a margin [px]; it may leave the image."""
    left, top = np.floor(points.min(axis=0) - margin)
    right, bottom = np.ceil(points.max(axis=0) + margin) + 1
    return Box(int(left), int(top), int(right), int(bottom))


def within_image(box: Box, shape: tuple[int, ...]) -> Box:
    """Return the part of a box that an image of `shape` (height, width) has."""
    height, width = shape[:2]
    return Box(
        int(np.clip(box.left, 0, width - 1)),
        int(np.clip(box.top, 0, height - 1)),
        int(np.clip(box.right, 1, width)),
        int(np.clip(box.bottom, 1, height)),
    )


def frame_picture(overlay: Overlay, box: Box, marks: Sequence[str], text: str) -> Markup:
    """Draw a part of the image, and over it SVG elements; `text` is for a screen reader.

    The drawing may be larger than the image.
    """
    left, top, right, bottom = within_image(box, overlay.image.shape)
    part = display(overlay.image[top:bottom, left:right])
    if right - left > _MAX_WIDTH_PX:
        size = (_MAX_WIDTH_PX, round((bottom - top) * _MAX_WIDTH_PX / (right - left)))
        part = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    # The centre of a pixel has integer coordinates.
    frame = {"x": left - 0.5, "y": top - 0.5, "width": right - left, "height": bottom - top}
    image = element("image", "", href=webp_uri(part), preserveAspectRatio="none", **frame)
    view = f"{box.left - 0.5} {box.top - 0.5} {box.right - box.left} {box.bottom - box.top}"
    return Markup(
        f'<svg viewBox="{view}" role="img" aria-label="{escape(text)}">{image}'
        f'<g class="overlay">{"".join(marks)}</g></svg>'
    )


def polyline(points: Floats, name: str) -> str:
    """Draw a line through points (n, 2), thinned to at most 120, of a CSS class."""
    path = "L".join(f"{u:.2f} {v:.2f}" for u, v in points[:: max(len(points) // 60, 1)])
    return element("path", d=f"M{path}", class_=name)
