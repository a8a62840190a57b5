"""Picture of a reconstructed outline: the shape, and its error by the direction of the normal."""

from typing import Final

import cv2
import numpy as np

from results.outline.measure import Reconstruction
from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE, MICRO, MILLIMETRE
from vbaa_bench.report.chart import Axis, Margins, Plot, chart_png

# Scale of the ellipses in the picture: they are too small to be seen.
ENLARGED: Final = 5
_SIDE_PX: Final = 380
_MARGINS: Final = Margins(top=46)
_SIZE: Final = (
    _MARGINS.left + _SIDE_PX + _MARGINS.right,
    _MARGINS.top + _SIDE_PX + _MARGINS.bottom,
)
_TRUTH, _OUTLINE, _CONTACT = "#0a7a3c", "#1b1f23", "#b3261e"
# Radius of the 99.7 % ellipse in sigmas, chi of two degrees of freedom.
_RADIUS: Final = 3.44


def png(one: Reconstruction, title: str) -> bytes:
    """Draw a reconstruction as PNG."""
    shape, error = _shape(one), _error(one)
    shape.text(_SIZE[0] / 2, 16, title, class_="name label ink")
    pictures = [
        cv2.imdecode(np.frombuffer(chart_png(plot.svg(), {}, 1.4), np.uint8), cv2.IMREAD_COLOR)
        for plot in (shape, error)
    ]
    return bytes(cv2.imencode(".png", np.hstack([np.asarray(one) for one in pictures]))[1])


def _shape(one: Reconstruction) -> Plot:
    outline, contacts = one.outline, one.contacts
    points = np.vstack([outline.points, outline.points[: int(outline.closed)]]) / MILLIMETRE
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, 0.56 * float((high - low).max())
    x, y = (
        Axis(f"{name} on the table [mm]", float(at - half), float(at + half))
        for name, at in zip("xy", middle, strict=True)
    )
    plot = Plot(x, y, _SIZE, "Outline with the contacts", _MARGINS)
    subtitle = f"contacts with force and 99.7 % ellipse, {ENLARGED} times enlarged"
    plot.text(_SIZE[0] / 2, 34, subtitle, class_="name")
    for segment in one.truth.segments / MILLIMETRE:
        plot.line(*segment.T, stroke=_TRUTH, stroke_width=5, opacity=0.45)
    tips = contacts.points / MILLIMETRE
    directions = np.column_stack([np.cos(contacts.normals), np.sin(contacts.normals)])
    for tip, tail in zip(tips, tips + 0.08 * half * directions, strict=True):
        plot.line(*np.stack([tip, tail], axis=1), stroke=_CONTACT, stroke_width=0.8, opacity=0.6)
    plot.line(*points.T, stroke=_OUTLINE, stroke_width=1.2)
    for ellipse in _ellipses(contacts.points, contacts.total_covariances()):
        plot.line(*ellipse, stroke=_CONTACT, stroke_width=0.8)
    return plot


def _ellipses(points: Floats, covariances: Floats) -> Floats:
    """Compute points (n, 2, 33) [mm] of the enlarged ellipses."""
    angle = np.linspace(0, 2 * np.pi, 33)
    circle = ENLARGED * _RADIUS * np.stack([np.cos(angle), np.sin(angle)])
    return np.asarray((points[..., None] + np.linalg.cholesky(covariances) @ circle) / MILLIMETRE)


def _error(one: Reconstruction) -> Plot:
    outline, contacts = one.outline, one.contacts
    normals = outline.normals % (2 * np.pi)
    order = np.argsort(normals)
    directions = np.column_stack([np.cos(normals), np.sin(normals)])
    offsets = (outline.points * directions).sum(axis=1) - one.truth.support(directions)
    offsets, sigmas = offsets[order] / MICRO, 3 * outline.sigmas[order] / MICRO
    outward = np.column_stack([np.cos(contacts.normals), np.sin(contacts.normals)])
    errors = (one.errors * outward).sum(axis=1) / MICRO
    largest = 1.05 * max(float(np.abs(values).max()) for values in (offsets, sigmas, errors))
    plot = Plot(
        Axis("direction of the outward normal [deg]", 0, 360),
        Axis("extent, outline less mesh [um]", -largest, largest),
        _SIZE,
        "Error of the outline by the direction of its normal",
        _MARGINS,
    )
    subtitle = "error of the outline in three sigmas; errors of the contacts along the normal"
    plot.text(_SIZE[0] / 2, 34, subtitle, class_="name")
    x = normals[order] / DEGREE
    plot.band(x, -sigmas, sigmas, class_="band ink")
    plot.line(x, offsets, stroke=_OUTLINE, stroke_width=1.2)
    places = plot.place(contacts.normals % (2 * np.pi) / DEGREE, errors)
    for u, v in zip(*places, strict=True):
        plot.add("circle", cx=f"{u:.1f}", cy=f"{v:.1f}", r=2, fill=_CONTACT)
    return plot
