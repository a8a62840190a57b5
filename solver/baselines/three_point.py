"""Paper's 3D-VBAA (section V-B): three points, and the plane on which their contacts agree.

For every inclination psi of the deformation plane the points are un-projected by (7) and (8), and
each of the pairs (1, 2) and (1, 3) gives a contact distance by linear theory. A psi where they
agree, g_3D(psi) = 0, is a candidate. psi is determined by perspective alone, to second order, and
therefore badly.

Corrections to the paper. (25) and (26) use (15), which holds only if all three points are on the
curved part; here each pair's contact is that of the monotone ratio y2 / y1, which covers all three
cases of section V-A. And (26) has poles, where a pair's contact tends to infinity and returns from
the other side; here g is the difference of w = x_c / (x_c + L), which is 1 from there on and 0
where the contact would be behind the clamp. So g is a continuous function of psi wherever all
points are on the same side of the beam's rest, and no sign change of it is a pole.

The rule, fixed before any scoring:
- The visible beam is divided into 24 stretches of equally many columns; a parabola through each
  gives one point in its middle. This is the averaging that the paper requires, where it is still
  linear.
- All triples of these whose neighbours are at least L / 12 apart vote. The votes are averaged in
  g, not in its roots, which scatter over the whole half circle. The weight of a triple is its
  signal dg/dpsi over the variance of its noise, on the nearest linear beam at psi = 0.
- All roots of the mean g in (-90, 90) deg are found: sign changes between neighbours on a grid of
  one degree, each refined by Brent's method. Of several roots the one nearest to psi = 0 is taken.
- x_c and f are the mean of pairs (`two_point`) on that plane.

Limitations. With a camera above the middle of the beam there is one root. With a camera above the
clamp, half of the noisy frames have two to four roots, and the wrong one is taken only if it is
nearer to the calibration plane: a plane inclined by more than about 50 deg may be missed. At 10 %
deflection and 0.05 px of noise the error of psi is some 25 deg (root mean square), a third of it
the bias of linear theory. The covariance is that of noise and clamp and does not include this bias.
psi's sigma extends to the farthest plane on which the mean g is zero within its noise, other roots
included; if that is more than a right angle away, the outcome is NOT_IDENTIFIABLE.
"""

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

from solver.baselines.linear_estimate import (
    BASE,
    LinearContact,
    estimate_from_linear_fit,
    stated_errors,
)
from solver.baselines.triples import (
    STRETCHES,
    Nodes,
    Votes,
    by_sources,
    stretch_nodes,
    weighted_sum,
)
from solver.baselines.two_point import MeanOfPairs, mean_of_pairs
from solver.fitting.first_contact import nearest_linear_bend, no_contact
from solver.instrument.arrays import Floats
from solver.instrument.estimate import Estimate, Outcome
from solver.instrument.measurement import UNKNOWN_VIEWPOINT, Measurement
from solver.planes.plane_d import on_deformation_plane, opening, unproject

MIN_POINTS = 3 * STRETCHES
GRID = np.radians(np.arange(-89.0, 89.5, 1.0))
# Smaller values of g are rounding errors, where both contacts are at infinity. Chosen.
ROUNDING = 1e-12
COARSE_STEP = 4  # every fourth plane of the grid is tested for the sigma of psi


def three_point(measurement: Measurement) -> Estimate:
    """Estimate inclination psi, contact distance x_c, force f, derived values, with covariance."""
    if not measurement.viewpoint_known:
        return Estimate(Outcome.NOT_IDENTIFIABLE, UNKNOWN_VIEWPOINT)
    # A repeated column adds no information.
    count = len(np.unique(measurement.points[measurement.points[:, 0] > 0, 0]))
    if count < MIN_POINTS:
        return Estimate(
            Outcome.NOT_IDENTIFIABLE, f"{count} visible points, needed are {MIN_POINTS}"
        )
    bend = nearest_linear_bend(measurement)
    refusal = no_contact(bend)
    if refusal is not None:
        return refusal
    viewpoint = measurement.view.viewpoint
    length = measurement.rig.beam.length
    nodes = stretch_nodes(measurement)
    votes = Votes.at(nodes, viewpoint, 0.0, bend.x_c, bend.amplitude, length)
    if not votes.weights.any():
        return Estimate(
            Outcome.NOT_IDENTIFIABLE,
            "no three points far enough apart distinguish planes by their inclination",
        )

    def disagreement(psi: float) -> float:
        on_d, _, _ = unproject(nodes.points, viewpoint, psi)
        return float(weighted_sum(on_d[:, 0], on_d[:, 1], votes.weights, length))

    scan = np.array([disagreement(psi) for psi in GRID])
    roots = _roots(disagreement, scan, viewpoint)
    if not roots:
        return Estimate(Outcome.INVALID, "the contacts of three points agree on no plane")
    psi = min(roots, key=abs)
    planar = on_deformation_plane(measurement, psi)
    if planar is None:
        return Estimate(Outcome.EDGE_ON, f"{math.degrees(psi):.1f} deg is seen edge-on")
    mean = mean_of_pairs(planar)
    if isinstance(mean, Estimate):
        return mean
    covariance = _covariance(measurement, planar, mean, nodes, votes.weights, psi, scan)
    if covariance is None:
        return Estimate(Outcome.NOT_IDENTIFIABLE, "the image does not determine the beam's plane")
    other_roots = "".join(f", {math.degrees(root):.0f}" for root in roots if root != psi)
    message = f"mean of {mean.pairs} pairs" + (
        f"; other inclinations{other_roots} deg" * bool(other_roots)
    )
    contact = LinearContact(mean.x_c, mean.load, covariance, psi)
    return estimate_from_linear_fit(contact, planar, message)


def _roots(disagreement: Callable[[float], float], scan: Floats, viewpoint: Floats) -> list[float]:
    """Find all psi in (-90, 90) deg where the mean g changes its sign, on either side of edge-on.

    `scan` is g on the grid.
    """
    roots = []
    scan = np.where(np.abs(scan) < ROUNDING, 0.0, scan)
    side = np.array([opening(viewpoint, psi) > 0 for psi in GRID])
    same_side = (side[1:] == side[:-1]) & np.isfinite(scan[1:]) & np.isfinite(scan[:-1])
    for i in np.flatnonzero(same_side):
        left, right = scan[i], scan[i + 1]
        if left == 0 and right != 0:
            roots.append(float(GRID[i]))
        elif left * right < 0:
            roots.append(float(brentq(disagreement, GRID[i], GRID[i + 1], xtol=1e-12)))
    return roots


def _covariance(
    measurement: Measurement,
    planar: Measurement,
    mean: MeanOfPairs,
    nodes: Nodes,
    weights: Floats,
    psi: float,
    scan: Floats,
) -> Floats | None:
    """Compute the covariance (8, 8) of x_c, load and psi at the root; None if psi is undetermined.

    Errors of points and clamp change psi by the implicit function g(psi) = 0, and with it x_c and
    load. As g is far from linear and may have other roots, psi's sigma is at least its distance
    from the farthest plane on the grid (`scan`) where g is within its own sigma of zero.
    """
    bend = nearest_linear_bend(planar)  # not the mean of pairs, whose bias would enter the noise
    viewpoint, length = measurement.view.viewpoint, measurement.rig.beam.length
    at_root, height = by_sources(nodes, viewpoint, psi, bend.x_c, bend.amplitude, length, weights)
    by_psi = at_root[-1]
    if abs(by_psi) < 1e-12:
        return None
    count = len(measurement.points)
    by_error = np.zeros((3, count))
    by_base = np.zeros((3, 3))
    by_error[2] = -at_root[:count] / by_psi
    by_base[2] = -at_root[count:-1] / by_psi
    visible = np.flatnonzero(np.isfinite(unproject(measurement.points, viewpoint, psi)[0][:, 0]))
    along, across = planar.total_sigma_vectors[mean.rows].T
    by_error[:2, visible[mean.rows]] = mean.by_point * (across - mean.slope * along)
    by_base[:2] = mean.by_base
    _, _, points_by_psi = unproject(measurement.points[visible], viewpoint, psi)
    by_plane = mean.moved(points_by_psi[mean.rows])
    base = planar.base_covariance

    def variance(by_source: Floats) -> float:
        noise, clamp = by_source[:count], by_source[count:-1]
        return float(noise @ noise * bend.variance_inflation + clamp @ base @ clamp)

    sigma = math.sqrt(variance(at_root)) / abs(by_psi)
    farthest = sigma
    for plane_psi, value in zip(GRID[::COARSE_STEP], scan[::COARSE_STEP], strict=True):
        if abs(plane_psi - psi) > farthest and math.isfinite(value):
            at_plane, _ = by_sources(
                nodes, viewpoint, plane_psi, bend.x_c, bend.amplitude, length, weights, height
            )
            if value**2 <= variance(at_plane):
                farthest = abs(plane_psi - psi)
    if sigma <= 0 or farthest > math.pi / 2:
        return None
    by_error[2] *= farthest / sigma
    by_base[2] *= farthest / sigma
    transfer = np.eye(3)
    transfer[:2, 2] = by_plane
    by_error, by_base = transfer @ by_error, transfer @ by_base
    covariance = stated_errors(planar)
    covariance[:3, :3] = (
        by_error @ by_error.T * bend.variance_inflation + by_base @ base @ by_base.T
    )
    covariance[:3, BASE] = -by_base @ base
    covariance[BASE, :3] = covariance[:3, BASE].T
    return covariance
