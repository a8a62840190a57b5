"""Fit the outline of an object to touched points, as the boundary of a convex region.

A beam bends away from the object that it touches, so that it touches only the convex hull of the
object. The boundary of a convex region is a function of its outward normal phi: the point v(phi)
moves along the tangent t = dn / dphi by the radius of curvature rho >= 0,

    v(phi) = v_0 + integral of rho t dphi.

Corners have rho = 0 over a range of normals, faces have all of it at one normal. A contact is a
measurement of v at its normal, and v is linear in the unknowns: v_0, rho in narrow cells of the
normal, and the error of Sigma_a that all contacts share. Outlines from measured support lines are
of Prince and Willsky (1990); Gardner, Kiderlen and Milanfar (2006) proved their convergence.

Between the normals of two neighbouring contacts rho is a guess, white noise whose integral has a
standard deviation as large as the distance of the two points. Then the outline between them has the
standard deviation of a uniform distribution in the triangle of their chord and their tangents,
which contains every convex outline: 0.072 l D for a chord l and a difference D of the normals.
The error of a normal is that of the motor angle: it moves a contact by rho along the outline, and
by the contact distance, which is much longer, across the beam. The former is neglected.
Where no normal within 90 degrees was touched the outline is open.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import nnls

from solver.instrument.arrays import Bools, Floats
from solver.instrument.errors import InputError
from solver.outline.contacts import SHARED, Contacts

# Width of the cells of the normal [rad]. Chosen: a tenth of the distance of 70 contacts.
CELL: Final = math.radians(0.5)
# Widest range of normals without a contact [rad] that is bridged. Chosen: beyond it two tangents
# bound the outline no better than the object's size.
WIDEST_GAP: Final = math.pi / 2
# Contacts farther than this from the outline, in sigmas, are rejected; of 10,000 contacts with
# normal errors in two dimensions, 0.04 are. At most this share may be rejected. Chosen.
OUTLIER: Final = 5.0
MAX_REJECTED: Final = 0.1
MIN_CONTACTS: Final = 6
# Sigma of the closing condition over the smallest error of a contact. Chosen: the outline closes to
# a hundredth of a sigma, and the equations keep six digits.
_CLOSED: Final = 1e-2


class Outline(NamedTuple):
    """Outline at outward normals (m,) [rad]: points (m, 2) [m], sigmas (m,) [m] along the normal.

    It runs counterclockwise and is `closed` if contacts are all around. `nearest_contact` (m,) [m]
    is the distance to the nearest touched point: wide dents may be hidden where it is large.
    `used` (n,) marks the contacts that were not rejected, `misfits` (n,) are their distances from
    the outline in sigmas. `correction` (3,) is the estimated error of Sigma_a, shift [m] and
    rotation [rad], with `correction_sigmas` (3,).
    """

    normals: Floats
    points: Floats
    sigmas: Floats
    nearest_contact: Floats
    closed: bool
    used: Bools
    misfits: Floats
    correction: Floats
    correction_sigmas: Floats


def fit_outline(contacts: Contacts) -> Outline:
    """Fit the boundary of a convex region to contacts by weighted least squares.

    Raises InputError if there are too few contacts, or if they fit no convex outline.
    """
    count = len(contacts.points)
    used = np.ones(count, dtype=bool)
    while True:
        if used.sum() < MIN_CONTACTS:
            raise InputError(f"{used.sum()} contacts, needed are {MIN_CONTACTS} for an outline")
        outline = _fitted(contacts, used)
        worst = float(outline.misfits[used].max())
        if worst <= OUTLIER:
            return outline
        # A bad contact pulls the outline away from its neighbours, which are less far from it.
        used &= outline.misfits <= max(OUTLIER, worst / 2)
        rejected = int((~used).sum())
        if rejected > MAX_REJECTED * count:
            raise InputError(
                f"{rejected} of {count} contacts are more than {OUTLIER:g} sigmas from a convex "
                "outline: the object moved, or a pose of the carriage is wrong"
            )


class _Grid(NamedTuple):
    """Normals at the ends of K cells, from `start` [rad] on, and whether the outline is closed."""

    start: float
    cells: int
    closed: bool

    @classmethod
    def of(cls, normals: Floats) -> "_Grid":
        """Choose the cells; they begin at the normal after the widest gap."""
        ordered = np.sort(normals % (2 * np.pi))
        gaps = np.diff(ordered, append=ordered[0] + 2 * np.pi)
        widest = int(np.argmax(gaps))
        closed = bool(gaps[widest] <= WIDEST_GAP)
        start = ordered[(widest + 1) % len(ordered)]
        span = 2 * np.pi if closed else 2 * np.pi - gaps[widest]
        return cls(float(start), max(math.ceil(span / CELL - 1e-9), 1), closed)

    @property
    def ends(self) -> Floats:
        """Normals (K + 1,) [rad] at the ends of the cells."""
        return np.asarray(self.start + CELL * np.arange(self.cells + 1), dtype=np.float64)

    def design(self, normals: Floats) -> Floats:
        """Compute the derivatives (m, 2, 2 + K) of v at normals (m,) by v_0 and rho."""
        ends = self.ends
        position = self.start + (normals - self.start + CELL) % (2 * np.pi) - CELL
        upper = np.clip(position[:, None], ends[:-1], ends[1:])
        by_radius = _directions(upper) - _directions(ends[:-1])
        by_start = np.broadcast_to(np.eye(2), (len(normals), 2, 2))
        parts = [by_start, by_radius.transpose(0, 2, 1)]
        return np.asarray(np.concatenate(parts, axis=2), dtype=np.float64)


def _directions(normals: Floats) -> Floats:
    """Return unit vectors (..., 2) at angles [rad]."""
    return np.asarray(np.stack([np.cos(normals), np.sin(normals)], axis=-1), dtype=np.float64)


def _fitted(contacts: Contacts, used: Bools) -> Outline:
    """Fit the outline to the used contacts."""
    grid = _Grid.of(contacts.normals[used])
    design = np.concatenate([grid.design(contacts.normals), contacts.shared], axis=2)
    priors = _priors(grid, contacts, used)
    whitening = np.linalg.inv(np.linalg.cholesky(contacts.covariances))
    rows, values = whitening @ design, (whitening @ contacts.points[..., None])[..., 0]
    equations = np.vstack([np.concatenate(rows[used]), priors])
    unknown = _solved(equations, np.append(values[used].ravel(), np.zeros(len(priors))))
    covariance = np.linalg.inv(equations.T @ equations)
    normals = grid.ends[: grid.cells] if grid.closed else grid.ends
    by_unknown = grid.design(normals)
    points = by_unknown @ unknown[:-SHARED]
    by_normal = np.einsum("ni,nij->nj", _directions(normals), by_unknown)
    variances = (by_normal @ covariance[:-SHARED, :-SHARED] * by_normal).sum(axis=1)
    distances = np.linalg.norm(points[:, None] - contacts.points[used], axis=2)
    return Outline(
        normals,
        points,
        np.sqrt(variances),
        distances.min(axis=1),
        grid.closed,
        used.copy(),
        np.linalg.norm(values - rows @ unknown, axis=1),
        unknown[-SHARED:],
        np.sqrt(np.diag(covariance)[-SHARED:]),
    )


def _priors(grid: _Grid, contacts: Contacts, used: Bools) -> Floats:
    """Compute the rows of the priors, whose values are 0: of rho, of the shared error, closing."""
    size = 2 + grid.cells + SHARED
    rho, shared = np.zeros((grid.cells, size)), np.zeros((SHARED, size))
    rho[:, 2:-SHARED] = np.diag(np.sqrt(CELL / _variances(grid, contacts, used)))
    shared[:, -SHARED:] = np.diag(1 / contacts.shared_sigmas)
    if not grid.closed:
        return np.vstack([rho, shared])
    smallest = math.sqrt(np.linalg.eigvalsh(contacts.covariances).min())
    closing = np.zeros((2, size))
    closing[:, 2:-SHARED] = np.diff(_directions(grid.ends), axis=0).T / (_CLOSED * smallest)
    return np.vstack([rho, shared, closing])


def _variances(grid: _Grid, contacts: Contacts, used: Bools) -> Floats:
    """Compute the variances (K,) of rho per radian, from the contacts on both sides of a cell."""
    position = (contacts.normals[used] - grid.start) % (2 * np.pi)
    order = np.argsort(position)
    points, stated = contacts.points[used][order], contacts.covariances[used][order]
    step = np.roll(points, -1, axis=0) - points
    errors = np.trace(stated + np.roll(stated, -1, axis=0), axis1=1, axis2=2)
    width = np.diff(position[order], append=position[order][0] + 2 * np.pi)
    variances = ((step**2).sum(axis=1) + errors) / np.maximum(width, CELL)
    middles = CELL * (np.arange(grid.cells) + 0.5)
    last = 0 if grid.closed else 1  # an open outline ends at its last contact
    before = np.searchsorted(position[order], middles, "right") - 1
    return np.asarray(variances[np.minimum(before, len(variances) - 1 - last)])


def _solved(equations: Floats, values: Floats) -> Floats:
    """Solve least squares with radii of curvature that are not negative.

    The unknowns are the first point, the radii, and the shared error.
    """
    free = np.r_[:2, equations.shape[1] - SHARED : equations.shape[1]]
    radii = slice(2, equations.shape[1] - SHARED)
    # Unknowns without a bound are eliminated.
    orthogonal, _ = np.linalg.qr(equations[:, free], mode="complete")
    rest = orthogonal[:, len(free) :].T
    unknown = np.zeros(equations.shape[1])
    unknown[radii], _ = nnls(rest @ equations[:, radii], rest @ values)
    remaining = values - equations[:, radii] @ unknown[radii]
    unknown[free] = np.linalg.lstsq(equations[:, free], remaining)[0]
    return unknown
