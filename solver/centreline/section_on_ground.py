"""The beam's section before a structured ground, from the mean of the rest images.

In a single column the ground under the beam looks like a part of the beam, and a free centre
follows it. Here centre and amplitude are smooth along the beam, so that the ground averages out.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from solver.centreline.ground import Ground
from solver.centreline.profile import Section, interpolated, profile
from solver.centreline.stations import Stations
from solver.instrument.arrays import Floats, Mask

# Degree of the smooth course of centre and amplitude: bow and distortion have no finer detail.
DEGREE = 4
# Values and sigmas that are expected of log(diameter over the rig's), spread [px], roundness and
# skew; chosen. They matter where the ground hides the section's details.
EXPECTED = np.array([0.0, 0.3, 1.0, 0.0])
SIGMAS = np.array([0.03, 0.5, 1.0, 0.3])
STARTS = (0.1, 0.5)
# Step of numerical derivatives. Chosen: all parameters are of the order of one.
DIFFERENCE = 1e-6


class _Columns(NamedTuple):
    """Pixels of n columns across the beam, each (n, m), and the columns' own values, each (n, 1).

    `gray` is the mean of the rest images, `ground` that without the beam, with the `sigma` of
    their difference; `row` is a pixel's position from the path.
    """

    gray: Floats
    ground: Floats
    sigma: Floats
    row: Floats
    climb: Floats
    sense: Floats


class BeamOnGround(NamedTuple):
    """The beam's section, and its amplitude [gray px] and distance from the path [px], each (n,).

    Distances are along the path's normal.
    """

    section: Section
    amplitude: Floats
    off_path: Floats


def section_on_ground(
    mean: Floats, noise_variance: Floats, places: Stations, radius: float, half: int, ground: Ground
) -> BeamOnGround:
    """Fit the section to the mean (height, width) of the rest images, along n stations.

    `noise_variance` (height, width) is that of a pixel of the mean; `radius` [px] is the rig's.
    """
    columns, used = _columns(mean, noise_variance, places, half, ground)
    length = places.length[used]
    basis = np.polynomial.chebyshev.chebvander(_unit(length, length), DEGREE)
    terms = DEGREE + 1

    def section(p: Floats) -> Section:
        scale, spread, roundness, skew = p[:4]
        return Section(
            radius * float(np.exp(np.clip(scale, -1, 1))),
            float(np.clip(abs(spread), 0, 4)),
            float(np.clip(abs(roundness), 0, 4)),
            float(np.clip(skew, -0.9, 0.9)),
        )

    def deviation(section: Section, centre: Floats, amplitude: Floats) -> Floats:
        """Compute the deviation (n, m) from the model; the amplitude is in units of the level."""
        offset = columns.sense * columns.row - centre[:, None]
        shape = interpolated(profile(section).value[0], columns.climb, offset)
        cover = np.clip(2 * section.radius * shape, 0, 1)
        model = columns.ground + cover * (ground.level - columns.ground)
        model += ground.level * amplitude[:, None] * shape
        return np.asarray((columns.gray - model) / columns.sigma)

    def course(p: Floats) -> tuple[Floats, Floats]:
        return basis @ p[4 : 4 + terms], basis @ p[4 + terms :]

    def residuals(p: Floats) -> Floats:
        prior = (p[:4] - EXPECTED) / SIGMAS
        return np.concatenate([deviation(section(p), *course(p)).ravel(), prior])

    def jacobian(p: Floats) -> Floats:
        """Differentiate by the section's parameters, and by centre and amplitude of each column."""
        centre, amplitude = course(p)
        here = deviation(section(p), centre, amplitude)
        by_section = [
            (deviation(section(p + step), centre, amplitude) - here) / DIFFERENCE
            for step in DIFFERENCE * np.eye(len(p))[:4]
        ]
        by_centre = (deviation(section(p), centre + DIFFERENCE, amplitude) - here) / DIFFERENCE
        by_amplitude = (deviation(section(p), centre, amplitude + DIFFERENCE) - here) / DIFFERENCE
        result = np.zeros((here.size + 4, len(p)))
        result[:-4, :4] = np.stack(by_section, axis=-1).reshape(-1, 4)
        result[:-4, 4 : 4 + terms] = (by_centre[..., None] * basis[:, None]).reshape(-1, terms)
        result[:-4, 4 + terms :] = (by_amplitude[..., None] * basis[:, None]).reshape(-1, terms)
        result[-4:, :4] = np.diag(1 / SIGMAS)
        return result

    total = ((columns.gray - columns.ground).sum(axis=1)) / ground.level
    fits = []
    for spread in STARTS:
        start = np.zeros(4 + 2 * terms)
        start[:4] = 0.0, spread, 1.0, 0.0
        start[4 + terms] = np.median(total)
        fits.append(
            least_squares(
                residuals,
                start,
                jacobian,
                tr_solver="lsmr",
                loss="soft_l1",
                f_scale=3.0,
                max_nfev=25,
            )
        )
    p = min(fits, key=lambda fit: float(fit.cost)).x
    everywhere = np.polynomial.chebyshev.chebvander(_unit(places.length, length), DEGREE)
    return BeamOnGround(
        section(p), ground.level * (everywhere @ p[4 + terms :]), everywhere @ p[4 : 4 + terms]
    )


def _unit(length: Floats, used: Floats) -> Floats:
    """Map lengths to -1 to 1 at the ends of those used, and beyond these to the ends."""
    return np.asarray(np.clip(2 * (length - used[0]) / max(float(np.ptp(used)), 1.0) - 1, -1, 1))


def _columns(
    mean: Floats, noise_variance: Floats, places: Stations, half: int, ground: Ground
) -> tuple[_Columns, Mask]:
    """Read the pixels of the columns that are in the image as a whole, and tell which these are."""
    offsets = np.arange(-half, half + 1)
    line = np.rint(places.start).astype(np.int64)[:, None] + offsets
    along = np.broadcast_to(places.along[:, None], line.shape)
    upright = places.upright[:, None]
    v, u = np.where(upright, line, along), np.where(upright, along, line)
    used = ((v >= 0) & (v < mean.shape[0]) & (u >= 0) & (u < mean.shape[1])).all(axis=1)
    v, u = v[used], u[used]
    columns = _Columns(
        gray=mean[v, u],
        ground=ground.gray[v, u].astype(np.float64),
        sigma=np.sqrt(noise_variance[v, u] + ground.variance[v, u]),
        row=line[used] - places.start[used][:, None],
        climb=np.minimum(np.abs(places.climb[used]), 1.0)[:, None],
        sense=places.sense[used][:, None],
    )
    return columns, used
