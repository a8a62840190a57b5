"""The beam's section before a structured ground, from the mean of the rest images.

In a single column the ground under the beam looks like a part of the beam, and a free centre
follows it. Here centre and amplitude are smooth along the beam, so that the ground averages out.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from solver.centreline.effective_profile import course_basis
from solver.centreline.ground import Ground
from solver.centreline.profile import Section, interpolated, profile
from solver.centreline.stations import Stations
from solver.instrument.arrays import Floats

# Values and sigmas that are expected of log(diameter over the rig's), spread [px], roundness and
# skew; chosen. They matter where the ground hides the section's details.
EXPECTED = np.array([0.0, 0.3, 1.0, 0.0])
SIGMAS = np.array([0.03, 0.5, 1.0, 0.3])
STARTS = (0.1, 0.5)
# Step of numerical derivatives. Chosen: all parameters are of the order of one.
DIFFERENCE = 1e-6


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
    columns = places.take(places.within(half, mean.shape))
    pixels, distance = columns.pixels(half), columns.offset(half)
    gray, climb = mean[pixels], np.abs(columns.climb)
    unseen = ground.gray[pixels].astype(np.float64)
    sigma = np.sqrt(noise_variance[pixels] + ground.variance[pixels])
    basis = course_basis(columns.length, columns.length)
    terms = basis.shape[1]

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
        shape = interpolated(profile(section).value[0], climb, distance - centre[:, None])
        cover = np.clip(2 * section.radius * shape, 0, 1)
        model = unseen + cover * (ground.level - unseen)
        model += ground.level * amplitude[:, None] * shape
        return np.asarray((gray - model) / sigma)

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

    total = (gray - unseen).sum(axis=1) / ground.level
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
    everywhere = course_basis(places.length, columns.length)
    return BeamOnGround(
        section(p), ground.level * (everywhere @ p[4 + terms :]), everywhere @ p[4 : 4 + terms]
    )
