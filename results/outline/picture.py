"""Picture of a reconstructed outline: the shape, and its error by the direction of the normal."""

from typing import Final

import altair as alt
import numpy as np
import polars as pl
import vl_convert as vlc

from results.outline.measure import Reconstruction
from solver.instrument.arrays import Floats
from solver.instrument.units import DEGREE, MILLIMETRE

# Scale of the ellipses in the picture: they are too small to be seen.
ENLARGED: Final = 5
_SIDE_PX: Final = 380
_TRUTH, _OUTLINE, _CONTACT = "#0a7a3c", "#1b1f23", "#b3261e"
# Radius of the 99.7 % ellipse in sigmas, chi of two degrees of freedom.
_RADIUS: Final = 3.44


def png(one: Reconstruction, title: str) -> bytes:
    """Draw a reconstruction as PNG."""
    charts = alt.hconcat(_shape(one), _error(one), title=title)
    return bytes(vlc.vegalite_to_png(charts.to_json(), scale=1.4))


def _shape(one: Reconstruction) -> alt.LayerChart | alt.FacetChart:
    outline, contacts = one.outline, one.contacts
    points = np.vstack([outline.points, outline.points[: int(outline.closed)]]) / MILLIMETRE
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, 0.56 * float((high - low).max())
    x, y = (
        getattr(alt, axis)(f"{name}:Q", title=f"{name} on the table [mm]").scale(
            domain=[float(middle[i] - half), float(middle[i] + half)], nice=False
        )
        for i, (axis, name) in enumerate((("X", "x"), ("Y", "y")))
    )
    x2, y2 = "x2:Q", "y2:Q"
    segments = one.truth.segments.reshape(-1, 4) / MILLIMETRE
    mesh = pl.DataFrame(segments, schema=["x", "y", "x2", "y2"], orient="row")
    tip = contacts.points / MILLIMETRE
    directions = np.column_stack([np.cos(contacts.normals), np.sin(contacts.normals)])
    tails = tip + 0.08 * half * directions
    arrows = pl.DataFrame(np.hstack([tip, tails]), schema=["x", "y", "x2", "y2"], orient="row")
    layers = [
        alt.Chart(mesh).mark_rule(color=_TRUTH, strokeWidth=5, opacity=0.45),
        alt.Chart(arrows).mark_rule(color=_CONTACT, strokeWidth=0.8, opacity=0.6),
    ]
    lines = [layer.encode(x=x, y=y, x2=x2, y2=y2) for layer in layers]
    line = pl.DataFrame(points, schema=["x", "y"], orient="row").with_row_index("order")
    lines.append(
        alt.Chart(line).mark_line(color=_OUTLINE, strokeWidth=1.2).encode(x=x, y=y, order="order:Q")
    )
    lines.append(
        alt.Chart(_ellipses(contacts.points, contacts.total_covariances()))
        .mark_line(color=_CONTACT, strokeWidth=0.8)
        .encode(x=x, y=y, order="order:Q", detail="contact:N")
    )
    subtitle = f"contacts with force and 99.7 % ellipse, {ENLARGED} times enlarged"
    return alt.layer(*lines).properties(width=_SIDE_PX, height=_SIDE_PX, title=subtitle)


def _ellipses(points: Floats, covariances: Floats) -> pl.DataFrame:
    angle = np.linspace(0, 2 * np.pi, 33)
    circle = ENLARGED * _RADIUS * np.stack([np.cos(angle), np.sin(angle)])
    lines = points[:, None] + (np.linalg.cholesky(covariances) @ circle).transpose(0, 2, 1)
    flat = lines.reshape(-1, 2) / MILLIMETRE
    return pl.DataFrame(
        {
            "x": flat[:, 0],
            "y": flat[:, 1],
            "contact": np.repeat(np.arange(len(points)), len(angle)),
            "order": np.tile(np.arange(len(angle)), len(points)),
        }
    )


def _error(one: Reconstruction) -> alt.LayerChart | alt.FacetChart:
    outline, contacts = one.outline, one.contacts
    normal = outline.normals % (2 * np.pi)
    directions = np.column_stack([np.cos(normal), np.sin(normal)])
    offset = (outline.points * directions).sum(axis=1) - one.truth.support(directions)
    micrometre = 1e-6
    table = pl.DataFrame(
        {
            "normal": normal / DEGREE,
            "offset": offset / micrometre,
            "low": -3 * outline.sigmas / micrometre,
            "high": 3 * outline.sigmas / micrometre,
        }
    ).sort("normal")
    outward = np.column_stack([np.cos(contacts.normals), np.sin(contacts.normals)])
    marks = pl.DataFrame(
        {
            "normal": contacts.normals % (2 * np.pi) / DEGREE,
            "offset": (one.errors * outward).sum(axis=1) / micrometre,
        }
    )
    x = alt.X("normal:Q", title="direction of the outward normal [deg]").scale(domain=[0, 360])
    title = "extent, outline less mesh [um]"
    base = alt.Chart(table)
    chart = alt.layer(
        base.mark_area(color=_OUTLINE, opacity=0.15).encode(
            x=x, y=alt.Y("low:Q", title=title), y2="high:Q"
        ),
        base.mark_line(color=_OUTLINE, strokeWidth=1.2).encode(x=x, y=alt.Y("offset:Q")),
        alt.Chart(marks).mark_circle(color=_CONTACT, size=14).encode(x=x, y="offset:Q"),
    )
    subtitle = "error of the outline in three sigmas; errors of the contacts along the normal"
    return chart.properties(width=_SIDE_PX, height=_SIDE_PX, title=subtitle)
