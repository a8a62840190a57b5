"""What is measured: the most bent frame, with L, x_c and f drawn on it."""

from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from markupsafe import Markup

from solver.instrument.arrays import Floats
from vbaa_bench.report.chart import element
from vbaa_bench.report.frame_picture import box_around, frame_picture, polyline
from vbaa_bench.scoring.overlay import Overlay

# Shares of the longer side of the beam's box. Chosen: letters of 15 px in half of a page.
_LETTER: Final = 0.032
_GAP: Final = 0.05
_ARROW: Final = 0.11
_TICK: Final = 0.012


def most_bent(scores: pl.DataFrame) -> dict[str, Any]:
    """Return a row of the frame with the largest deflection; of several, the farthest contact's."""
    order = (pl.col("deflection_pct").round(1), "true_x_c_mm", "frame_id")
    row: dict[str, Any] = scores.sort(*order).row(-1, named=True)
    return row


class _Axes(NamedTuple):
    """The beam's place in the image: clamp, unit vectors along it and towards the bend, its box."""

    clamp: Floats
    along: Floats
    aside: Floats
    size: float


def rig_picture(overlay: Overlay) -> Markup:
    """Draw a frame with the beam's course at rest, L, and where it touches x_c and the force f."""
    line = overlay.centreline
    axes = _axes(line, overlay.contact)
    at_rest = line[0] + np.array([[0.0], [1.0]]) * np.linalg.norm(line[-1] - line[0]) * axes.along
    marks = [polyline(line, "truth"), polyline(at_rest, "rest")]
    middle = line[len(line) // 3]
    marks.append(_text("L", middle + axes.aside * _GAP * axes.size, axes))
    drawn = [line, at_rest]
    if overlay.contact is not None:
        extent, contact_marks = _contact(overlay.contact, axes)
        drawn.append(extent)
        marks += contact_marks
    box = box_around(np.vstack(drawn), _GAP * axes.size)
    return frame_picture(overlay, box, marks, f"What is measured: {overlay.title}")


def _axes(line: Floats, contact: Floats | None) -> _Axes:
    """Find the direction of the clamp in the image, and the side to which the beam bends."""
    size = float(np.ptp(line, axis=0).max())
    along = line[max(len(line) // 50, 1)] - line[0]
    along = along / np.linalg.norm(along)
    aside = np.array([along[1], -along[0]])
    bent = (line[-1] if contact is None else contact) - line[0]
    return _Axes(line[0], along, aside if aside @ bent >= 0 else -aside, size)


def _contact(contact: Floats, axes: _Axes) -> tuple[Floats, list[str]]:
    """Draw the dimension x_c beside the beam at rest, and the force as an arrow at the contact."""
    foot = axes.clamp + ((contact - axes.clamp) @ axes.along) * axes.along
    shift = -_GAP * axes.size * axes.aside
    ends = np.array([axes.clamp, foot]) + shift
    tick = np.array([[-1.0], [1.0]]) * _TICK * axes.size * axes.aside
    head = contact + _ARROW * axes.size * axes.aside
    barb = _TICK * axes.size
    barbs = np.array(
        [
            head - barb * (2 * axes.aside + axes.along),
            head,
            head - barb * (2 * axes.aside - axes.along),
        ]
    )
    marks = [
        *(polyline(ends[[i, i]] + tick, "mark") for i in (0, 1)),
        polyline(ends, "mark"),
        polyline(np.array([ends[1], contact]), "rest"),
        polyline(np.array([contact, head]), "mark"),
        polyline(barbs, "mark"),
        _text("x_c", ends.mean(axis=0) + 0.8 * shift, axes),
        _text("f", head + _LETTER * axes.size * axes.along, axes),
    ]
    return np.vstack([ends + shift, head + _LETTER * axes.size * axes.aside]), marks


def _text(letters: str, at: Floats, axes: _Axes) -> str:
    size = _LETTER * axes.size
    style = f"font-size: {size:.1f}px; stroke-width: {size / 5:.1f}px"
    u, v = at + np.array([0.0, size / 3])
    return element("text", letters, x=f"{u:.1f}", y=f"{v:.1f}", class_="letters", style=style)
