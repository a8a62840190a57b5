"""The worst frames of every method: which they are, and their pictures with truth and estimate."""

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from markupsafe import Markup

from solver.instrument.arrays import Floats
from solver.instrument.centreline import Flag
from vbaa_bench.report.chart import element
from vbaa_bench.report.frame_picture import (
    Box,
    box_around,
    frame_picture,
    polyline,
    within_image,
)
from vbaa_bench.report.numbers import short, signed
from vbaa_bench.scoring.overlay import Overlay, force_text
from vbaa_bench.scoring.strata import Stratum

# Chosen: 60 pictures of 8 kB for ten methods.
_MAX_ERRORS: Final = 6
_MAX_WRONG: Final = 2
_MARGIN_PX: Final = 14
_HALF_PX: Final = 24

Row = dict[str, Any]


class WorstFrame(NamedTuple):
    """A frame for the viewer: its method, caption, the numbers of its strata, and two pictures.

    `flags` are the names of the flags of points that are drawn.
    """

    method: str
    caption: str
    strata: str
    strip: Markup
    close_up: Markup
    flags: frozenset[str]


def worst_frames(
    scores: pl.DataFrame,
    methods: Sequence[str],
    strata: Sequence[Stratum],
    overlay_of: Callable[[Row], Overlay],
) -> list[WorstFrame]:
    """Draw the worst frames of every method.

    They are the largest errors of x_c (of force, if x_c is not estimated) of six different pushes,
    and one frame of each of two wrong outcomes. `scores` has the column `group`; `overlay_of`
    makes the overlay of a row of it.
    """
    members = [one.contains.fill_null(value=False).alias(f"in_{n}") for n, one in enumerate(strata)]
    return [
        _drawn(row, overlay_of(row))
        for name in methods
        for row in _rows(scores.filter(pl.col("method") == name).with_columns(members))
    ]


def _rows(scores: pl.DataFrame) -> list[Row]:
    error = "x_c_error_pct_L" if scores["x_c_error_pct_L"].count() else "force_error_pct"
    order = [pl.col(error).abs(), pl.col("frame_id")]
    largest = (
        scores.drop_nulls(error)
        .sort(order, descending=[True, False])
        .unique("group", keep="first", maintain_order=True)
        .head(_MAX_ERRORS)
    )
    wrong = (
        scores.filter(pl.col("failed") & ~pl.col("rightly_refused"))
        .sort("frame_id")
        .unique("outcome", keep="first", maintain_order=True)
        .head(_MAX_WRONG)
    )
    return [*wrong.to_dicts(), *largest.to_dicts()]


def _drawn(row: Row, overlay: Overlay) -> WorstFrame:
    caption = _caption(row)
    numbers = [name.removeprefix("in_") for name, value in row.items() if _is_member(name, value)]
    position = overlay.estimates.get(row["method"])
    return WorstFrame(
        row["method"],
        caption,
        " ".join(numbers),
        _strip(overlay, position, f"Whole beam. {caption}"),
        _close_up(overlay, position, f"Enlarged contact. {caption}"),
        frozenset(_flag_names(overlay)),
    )


def _flag_names(overlay: Overlay) -> list[str]:
    """Return the name of the flag of each point that the solver rejected."""
    flags = () if overlay.measured is None else overlay.measured.flags
    return [Flag(int(flag)).name.lower() for flag in flags]


def _is_member(name: str, value: object) -> bool:
    return name.startswith("in_") and value is True


def _caption(row: Row) -> str:
    parts = [f"{row['method']}:"]
    if row["failed"]:
        truth = "no contact" if row["free"] else "a contact"
        parts.append(f"{row['outcome']}, where the truth is {truth}.")
    elif row["x_c_error_pct_L"] is not None:
        parts.append(
            f"error of x_c {signed(row['x_c_error_pct_L'])} % of L "
            f"({signed(row['x_c_error_mm'])} mm"
        )
        sigmas = row["x_c_error_in_sigmas"]
        parts[-1] += ")" if sigmas is None else f", {short(abs(sigmas))} stated sigmas)"
    if row["force_error_pct"] is not None:
        parts[-1] += f", of force {signed(row['force_error_pct'])} %"
    parts[-1] += "" if parts[-1].endswith(".") else "."
    if not row["free"]:
        parts.append(
            f"True x_c {short(row['true_x_c_mm'], 4)} mm, deflection "
            f"{short(row['deflection_pct'])} %, force {force_text(row['true_force_n'])}."
        )
    rig = f"Rig {row['rig']}, frame" if row.get("rig") is not None else "Frame"
    return " ".join([*parts, f"{rig} {row['frame_id']}."])


def _strip(overlay: Overlay, position: Floats | None, text: str) -> Markup:
    """Draw the part of the image that contains the beam; the truth is a line on both its sides."""
    box = within_image(box_around(overlay.centreline, _MARGIN_PX), overlay.image.shape)
    marks = [polyline(overlay.centreline + np.array([0.0, offset]), "truth") for offset in (-3, 3)]
    radius = max(box.right - box.left, box.bottom - box.top) / 90
    return _picture(overlay, box, marks, position, radius, text)


def _close_up(overlay: Overlay, position: Floats | None, text: str) -> Markup:
    """Draw the surroundings of the contact (of the tip, without contact) with measured points."""
    middle = overlay.centreline[-1] if overlay.contact is None else overlay.contact
    half = min(_HALF_PX, (min(overlay.image.shape) - 1) // 2)
    corner = np.rint(middle).astype(int) - half
    limits = np.array(overlay.image.shape[::-1]) - 2 * half - 1
    left, top = (int(edge) for edge in np.clip(corner, 0, limits))
    marks = [polyline(overlay.centreline, "truth")]
    if overlay.measured is not None:
        marks += [_dot(point, "points", 0.16) for point in _near(overlay.measured.points, middle)]
    side = 2 * half + 1
    box = Box(left, top, left + side, top + side)
    return _picture(overlay, box, marks, position, 1.6, text)


def _near(points: Floats, middle: Floats) -> Floats:
    near: Floats = points[np.abs(points - middle).max(axis=1) < 2 * _HALF_PX]
    return near


def _picture(
    overlay: Overlay,
    box: Box,
    marks: list[str],
    position: Floats | None,
    radius: float,
    text: str,
) -> Markup:
    """Draw a part of the image, and over it the marks in the image's own pixels."""
    if overlay.measured is not None:
        rejected = zip(overlay.measured.rejected, _flag_names(overlay), strict=True)
        marks += [_dot(point, name, radius / 5) for point, name in rejected]
        if overlay.measured.tip is not None:
            marks.append(_dot(overlay.measured.tip, "tip", radius / 3))
    if overlay.contact is not None:
        u, v = overlay.contact
        arms = f"M{u - radius:.2f} {v - radius:.2f}l{2 * radius:.2f} {2 * radius:.2f}"
        arms += f"m0-{2 * radius:.2f}l-{2 * radius:.2f} {2 * radius:.2f}"
        marks.append(element("path", d=arms, class_="truth"))
    if position is not None:
        marks += [
            element(
                "circle",
                cx=f"{position[0]:.2f}",
                cy=f"{position[1]:.2f}",
                r=f"{radius:.2f}",
                class_=name,
            )
            for name in ("halo", "estimate")
        ]
    return frame_picture(overlay, box, marks, text)


def _dot(point: Floats, name: str, radius: float) -> str:
    u, v = point
    return element("circle", cx=f"{u:.2f}", cy=f"{v:.2f}", r=f"{radius:.2f}", class_=f"dot {name}")
