"""Image of a known curve, at the stations at which a centreline was measured."""

from dataclasses import replace
from typing import Any, Final

import numpy as np
from scipy.interpolate import CubicSpline

from solver.centreline import Centreline
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera

# Newton steps along the curve from the nearest chord. Derived: chords of half a pixel start within
# 1e-3 px of the crossing, and each step squares the relative error.
_STEPS: Final = 3


def true_line(
    line: Centreline, camera: Camera, curve: Floats, tip_lift: float | None
) -> Centreline:
    """Move the points of a measured centreline onto the image of the true one.

    `curve` (m, 3) [m] runs from the clamp to the tip, in the frame in which `camera` is fixed. Each
    point moves along its own direction; points whose direction does not meet the curve are left
    out. A measured tip is replaced by the image of the rim of the beam's end that is nearest to the
    camera, `tip_lift` [m] from its axis; it stays if that is None. All sigmas stay.
    """
    pixels = camera.project(curve)
    points = crossings(pixels, line.points, line.directions)
    meets = np.isfinite(points[:, 0])
    tip = line.tip
    if tip is not None and tip_lift is not None:
        tip = camera.project((curve[-1] + tip_lift * _upwards(curve[-1] - curve[-2]))[None])[0]
    return replace(
        line,
        points=points[meets],
        directions=line.directions[meets],
        sigma=line.sigma[meets],
        tip=tip,
    )


def _upwards(tangent: Floats) -> Floats:
    """Return the unit vector across a `tangent` (3,) that is nearest to z, towards the camera."""
    along = tangent / np.linalg.norm(tangent)
    across = np.array([0.0, 0.0, 1.0]) - along[2] * along
    return np.asarray(across / np.linalg.norm(across))


def crossings(curve: Floats, points: Floats, directions: Floats) -> Floats:
    """Find where lines through `points` (n, 2) along `directions` (n, 2) cross a curve (m, 2).

    Return the crossing (n, 2) that is nearest to each point, NaN where there is none. The curve is
    interpolated by a cubic spline.
    """
    if not len(points):
        return points
    normals = np.column_stack([-directions[:, 1], directions[:, 0]])
    side = curve @ normals.T - (points * normals).sum(axis=1)  # (m, n)
    crosses = (side[:-1] <= 0) != (side[1:] <= 0)
    along = curve @ directions.T - (points * directions).sum(axis=1)
    distance = np.where(crosses, np.abs(along[:-1]), np.inf)
    first = distance.argmin(axis=0)
    columns = np.arange(len(points))
    start, end = side[first, columns], side[first + 1, columns]
    chords = np.hypot(*np.diff(curve, axis=0).T)
    arc = np.append(0.0, np.cumsum(chords))
    with np.errstate(divide="ignore", invalid="ignore"):
        parameter = arc[first] + chords[first] * start / (start - end)
    parameter[~crosses.any(axis=0)] = np.nan
    # By its chords' length: rows are spaced differently before and beyond the contact.
    spline: Any = CubicSpline(arc, curve)
    for _ in range(_STEPS):
        off = ((spline(parameter) - points) * normals).sum(axis=1)
        parameter = parameter - off / (spline(parameter, 1) * normals).sum(axis=1)
    return np.asarray(spline(parameter))


def noisy(line: Centreline, random: np.random.Generator) -> Centreline:
    """Add white noise with the stated sigmas to the points, and their common error."""
    own = line.sigma * random.standard_normal(len(line.sigma))
    shift = own + line.common_sigma * random.standard_normal()
    return replace(line, points=line.points + shift[:, None] * line.directions)
