"""Outlines from touched points: exact shapes, noise, a shared error, gaps and mistakes."""

from dataclasses import replace

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from solver.outline.contacts import Contacts
from solver.outline.fit import Outline, fit_outline
from tests.draws import generator

MM = 1e-3
# A triangle with rounded corners: a corner at each centre, with its radius.
CENTRES, RADII = np.array([[-9.0, -6.0], [10.0, -4.0], [0.0, 10.0]]) * MM, np.array([2, 3, 5]) * MM
HEXAGON = 7 * MM * np.array([[np.sin(a), np.cos(a)] for a in np.arange(6) * np.pi / 3])


def unit(normals: Floats) -> Floats:
    return np.column_stack([np.cos(normals), np.sin(normals)])


def touched(normals: Floats, centres: Floats, radii: Floats) -> Floats:
    """The points (n, 2) of the hull of circles with these outward normals."""
    corner = np.argmax(centres @ unit(normals).T + radii[:, None], axis=0)
    return np.asarray(centres[corner] + radii[corner, None] * unit(normals))


def extent(normals: Floats, centres: Floats, radii: Floats) -> Floats:
    return np.asarray((centres @ unit(normals).T + radii[:, None]).max(axis=0))


def contacts(
    normals: Floats,
    centres: Floats = CENTRES,
    radii: Floats = RADII,
    *,
    along: float = 0.05 * MM,
    across: float = 0.02 * MM,
    turn: float = 0.0,
    random: np.random.Generator | None = None,
) -> Contacts:
    """Contacts with errors along the outline and across it, at 80 to 200 mm from the clamp.

    The frame of the antenna is turned by `turn` about a point 120 mm from the clamp.
    """
    count = len(normals)
    outward = unit(normals)
    tangent = np.column_stack([-outward[:, 1], outward[:, 0]])
    axes = np.stack([tangent, outward], axis=2)
    covariances = axes @ np.diag([along**2, across**2]) @ axes.transpose(0, 2, 1)
    lever = np.linspace(-40 * MM, 80 * MM, count)[generator(__name__, 0).permutation(count)]
    shared = np.zeros((count, 2, 3))
    shared[:, :, :2], shared[:, :, 2] = np.eye(2), lever[:, None] * outward
    points = touched(normals, centres, radii) + turn * shared[:, :, 2]
    if random is not None:
        noise = random.standard_normal((count, 2, 1))
        points = points + (np.linalg.cholesky(covariances) @ noise)[..., 0]
    return Contacts(
        tuple(map(str, range(count))),
        points,
        normals,
        covariances,
        shared,
        np.array([0.01 * MM, 0.01 * MM, 2e-4]),
    )


def errors(outline: Outline, centres: Floats = CENTRES, radii: Floats = RADII) -> Floats:
    """How far the outline is outside of the shape along each normal."""
    reached = (outline.points * unit(outline.normals)).sum(axis=1)
    return np.asarray(reached - extent(outline.normals, centres, radii))


@pytest.mark.parametrize(("centres", "radii"), [(CENTRES, RADII), (HEXAGON, np.zeros(6))])
def test_an_outline_is_within_its_sigmas(
    centres: Floats, radii: Floats, random: np.random.Generator
) -> None:
    # With corners, the sigma between contacts is that of a guess, and is not exceeded.
    normals = random.uniform(0, 2 * np.pi, 72)
    outline = fit_outline(contacts(normals, centres, radii, random=random))
    in_sigmas = errors(outline, centres, radii) / outline.sigmas
    assert outline.closed
    # Nine in ten errors are below 0.96 +- 0.11 sigmas, of corners 1.1 +- 0.3 (24 seeds). Single
    # ones may be several sigmas where the curvature changes.
    assert np.count_nonzero(~outline.used) < 7
    assert 0.2 < np.quantile(np.abs(in_sigmas), 0.9) < (2.1 if radii.any() else 3.0)
    # From points with errors of 0.05 mm and gaps of 5 degrees: 0.015 +- 0.006 mm.
    assert np.abs(errors(outline, centres, radii)).mean() < 0.05 * MM


def test_a_closed_outline_is_convex_and_runs_counterclockwise(random: np.random.Generator) -> None:
    outline = fit_outline(contacts(np.linspace(0.3, 6.2, 40), random=random))
    steps = np.diff(np.vstack([outline.points, outline.points[:2]]), axis=0)
    turns = steps[:-1, 0] * steps[1:, 1] - steps[:-1, 1] * steps[1:, 0]
    assert turns.min() > -1e-14
    assert turns.sum() > 0


def test_a_turned_antenna_is_recognised_and_the_outline_corrected(
    random: np.random.Generator,
) -> None:
    turn = 4e-4  # two sigmas
    outline = fit_outline(contacts(random.uniform(0, 2 * np.pi, 96), turn=turn, random=random))
    assert outline.correction_sigmas[2] < 1e-4
    assert abs(outline.correction[2] - turn) < 7 * outline.correction_sigmas[2]
    # 1.4 +- 0.6 in 5 seeds: what remains of the turn is common to all points.
    assert np.quantile(np.abs(errors(outline) / outline.sigmas), 0.9) < 5


def test_where_nothing_was_touched_the_outline_is_open() -> None:
    normals = np.linspace(-0.5, 3.0, 30)
    outline = fit_outline(contacts(normals))
    assert not outline.closed
    assert outline.normals.min() == pytest.approx(normals[0] % (2 * np.pi))
    assert np.ptp(outline.normals) == pytest.approx(3.5, abs=0.01)
    assert np.abs(errors(outline) / outline.sigmas).max() < 3


def test_a_gap_widens_the_band() -> None:
    everywhere = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    gap = (everywhere > 2) & (everywhere < 3)
    wide, narrow = (fit_outline(contacts(n)) for n in (everywhere[~gap], everywhere))
    middle = [int(np.argmin(np.abs(np.exp(1j * o.normals) - np.exp(2.5j)))) for o in (wide, narrow)]
    assert wide.sigmas[middle[0]] > 5 * narrow.sigmas[middle[1]]
    assert np.abs(errors(wide) / wide.sigmas).max() < 3


def test_a_wrong_contact_is_rejected_and_many_are_refused() -> None:
    normals = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    right = contacts(normals)
    points = right.points.copy()
    points[7] += [0.0, 1 * MM]
    outline = fit_outline(replace(right, points=points))
    assert np.flatnonzero(~outline.used).tolist() == [7]
    assert np.abs(errors(outline) / outline.sigmas).max() < 3
    points[::3] *= 1.1
    with pytest.raises(InputError, match="sigmas from a convex outline"):
        fit_outline(replace(right, points=points))
    with pytest.raises(InputError, match="5 contacts, needed are 6"):
        fit_outline(contacts(normals[::8]))
