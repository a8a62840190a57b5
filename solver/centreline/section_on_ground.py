"""The beam's section before a structured ground, from the mean of the rest images.

In a single column the ground under the beam looks like a part of the beam, and a free centre
follows it. Here centre and amplitude are smooth along the beam, so that the ground averages out.
"""

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from solver.centreline.effective_profile import course_basis
from solver.centreline.ground import Ground
from solver.centreline.profile import MAX_OWN_SKEW, Section, interpolated, own_light
from solver.centreline.stations import Stations
from solver.instrument.arrays import Floats, Mask

# Values and sigmas that are expected of log(diameter over the rig's), spread [px], roundness and
# skew; chosen. They matter where the ground hides the section's details.
EXPECTED = np.array([0.0, 0.3, 1.0, 0.0])
SIGMAS = np.array([0.03, 0.5, 1.0, 0.3])
STARTS = (0.1, 0.5)
# Step of numerical derivatives. Chosen: all parameters are of the order of one.
DIFFERENCE = 1e-6


class GroundErrors(NamedTuple):
    """Variance of the points at rest by the ground, over that by the noise of their mean image.

    `smooth` is what is added to it in smooth courses, where neighbours on one grain err as one.
    """

    whole: float
    smooth: float


NO_GROUND_ERRORS: Final = GroundErrors(0.0, 0.0)


class BeamOnGround(NamedTuple):
    """The beam's section, and its amplitude [gray px] and distance from the path [px], each (n,).

    Distances are along the path's normal. `ground_errors` are those by the ground.
    """

    section: Section
    amplitude: Floats
    off_path: Floats
    ground_errors: GroundErrors = NO_GROUND_ERRORS


class _Beam(NamedTuple):
    """Profile (n, m) [1/px] of the beam's light, share of a pixel that it hides, and its slope."""

    light: Floats
    cover: Floats
    steep: Floats


@dataclass(frozen=True)
class _Model:
    """Pixels of n columns across the beam, and what they show of beam and ground.

    `gray` (n, m), its `sigma`, the `unseen` ground and its `slope` [gray/px] along the path's
    normal are those at `distance` (n, m) [px] from the path; `climb` (n,) is that of the columns.
    """

    gray: Floats
    sigma: Floats
    unseen: Floats
    slope: Floats
    distance: Floats
    climb: Floats
    level: float

    def beam(self, section: Section, centre: Floats) -> _Beam:
        """Read the section's tables at all pixels."""
        table, off_axis = own_light(section), self.distance - centre[:, None]
        even, width = table.cover, 2 * section.radius
        assert even is not None
        return _Beam(
            light=interpolated(table.value[0], self.climb, off_axis),
            cover=width * interpolated(even.value[0], self.climb, off_axis),
            steep=width * interpolated(even.slope[0], self.climb, off_axis),
        )

    def deviation(self, section: Section, centre: Floats, amplitude: Floats) -> Floats:
        """Compute the deviation (n, m) from the model; the amplitude is in units of the level."""
        beam = self.beam(section, centre)
        # Of a pixel that the beam hides in part, one side is seen: see `profile_fit`.
        model = (self.unseen - self.slope * beam.steep * beam.cover / 2) * (1 - beam.cover)
        model += self.level * amplitude[:, None] * beam.light
        return np.asarray((self.gray - model) / self.sigma)

    def by_centre(self, section: Section, centre: Floats, amplitude: Floats) -> Floats:
        """Differentiate the deviation (n, m) by the centre of each column."""
        here = self.deviation(section, centre, amplitude)
        return (self.deviation(section, centre + DIFFERENCE, amplitude) - here) / DIFFERENCE


def section_on_ground(
    mean: Floats,
    noise_variance: Floats,
    images: int,
    places: Stations,
    radius: float,
    half: int,
    ground: Ground,
    found: BeamOnGround | None = None,
) -> BeamOnGround:
    """Fit the section to the mean (height, width) of some rest images, along n stations.

    `noise_variance` (height, width) is that of a pixel of the mean; `radius` [px] is the rig's. The
    search begins at the beam `found` before another ground, if there is one: along the stations,
    with its section and its amplitude.
    """
    used = places.within(half, mean.shape)
    columns = places.take(used)
    pixels = columns.pixels(half)
    gray, unseen = mean[pixels], ground.gray[pixels].astype(np.float64)
    model = _Model(
        gray=gray,
        sigma=np.sqrt(noise_variance[pixels] + ground.variance[pixels]),
        unseen=unseen,
        slope=columns.sense[:, None] * np.gradient(unseen, axis=1),
        distance=columns.offset(half),
        climb=np.abs(columns.climb),
        level=ground.level,
    )
    basis = course_basis(columns.length, columns.length)
    terms = basis.shape[1]

    def section(p: Floats) -> Section:
        scale, spread, roundness, skew = p[:4]
        return Section(
            radius * float(np.exp(np.clip(scale, -1, 1))),
            float(np.clip(abs(spread), 0, 4)),
            float(np.clip(abs(roundness), 0, 4)),
            float(np.clip(skew, -MAX_OWN_SKEW, MAX_OWN_SKEW)),
        )

    def course(p: Floats) -> tuple[Floats, Floats]:
        return basis @ p[4 : 4 + terms], basis @ p[4 + terms :]

    # Columns on one grain of the ground count as one, and so do their pixels, for the width: it is
    # known best, and a shadow on the ground looks like the flanks of a wider beam.
    prior_sigmas = SIGMAS / math.sqrt(ground.grain.along)
    prior_sigmas[0] /= math.sqrt(ground.grain.across)

    def residuals(p: Floats) -> Floats:
        prior = (p[:4] - EXPECTED) / prior_sigmas
        return np.concatenate([model.deviation(section(p), *course(p)).ravel(), prior])

    def jacobian(p: Floats) -> Floats:
        """Differentiate by the section's parameters, and by centre and amplitude of each column."""
        centre, amplitude = course(p)
        here = model.deviation(section(p), centre, amplitude)
        by_section = [
            (model.deviation(section(p + step), centre, amplitude) - here) / DIFFERENCE
            for step in DIFFERENCE * np.eye(len(p))[:4]
        ]
        by_centre = model.by_centre(section(p), centre, amplitude)
        ahead = model.deviation(section(p), centre, amplitude + DIFFERENCE)
        by_amplitude = (ahead - here) / DIFFERENCE
        result = np.zeros((here.size + 4, len(p)))
        result[:-4, :4] = np.stack(by_section, axis=-1).reshape(-1, 4)
        result[:-4, 4 : 4 + terms] = (by_centre[..., None] * basis[:, None]).reshape(-1, terms)
        result[:-4, 4 + terms :] = (by_amplitude[..., None] * basis[:, None]).reshape(-1, terms)
        result[-4:, :4] = np.diag(1 / prior_sigmas)
        return result

    fits = [
        least_squares(
            residuals,
            start,
            jacobian,
            tr_solver="lsmr",
            loss="soft_l1",
            f_scale=3.0,
            max_nfev=25,
        )
        for start in _starts(model, found, basis, used, radius)
    ]
    p = min(fits, key=lambda fit: float(fit.cost)).x
    everywhere = course_basis(places.length, columns.length)
    amplitude, off_path = everywhere @ p[4 + terms :], everywhere @ p[4 : 4 + terms]
    # The contrast with the ground's level.
    amplitude = ground.level * (amplitude - 2 * section(p).radius)
    cover = model.beam(section(p), course(p)[0]).cover
    seen = (1 - cover) ** 2
    of_mean, of_fine = noise_variance[pixels], seen * cover**2 * ground.fine
    of_ground = seen * ground.variance[pixels] + of_fine
    # A centre is the pixels' sum with these weights, by the noise of one image.
    weight = model.by_centre(section(p), *course(p)) * model.sigma / (of_ground + images * of_mean)
    # A beam that lies within one pixel of a column has no centre there.
    shown = (weight != 0).any(axis=1)
    if not shown.any():
        return BeamOnGround(section(p), amplitude, off_path)
    by_noise, by_ground, by_fine = (
        (weight[shown] ** 2 * part[shown]).sum(axis=1) for part in (of_mean, of_ground, of_fine)
    )
    whole, fine = float(np.median(by_ground / by_noise)), float(np.median(by_fine / by_noise))
    of_grain = fine if ground.bare_images else whole
    errors = GroundErrors(whole, of_grain * (ground.grain.smooth - 1))
    return BeamOnGround(section(p), amplitude, off_path, errors)


def _starts(
    model: _Model, found: BeamOnGround | None, basis: Floats, used: Mask, radius: float
) -> list[Floats]:
    """Return the parameters at which searches begin: those of a beam that was found, or some.

    `basis` (m, k) is that of the courses along the `used` ones of n stations.
    """
    terms = basis.shape[1]
    if found is None:
        contrast = np.median((model.gray - model.unseen).sum(axis=1)) / model.level
        light = np.append(contrast + 2 * radius, np.zeros(terms - 1))
        return [np.concatenate([[0.0, s, 1.0, 0.0], np.zeros(terms), light]) for s in STARTS]
    known = found.section
    scale = math.log(known.radius / radius)
    amplitude = found.amplitude[used] / model.level + 2 * known.radius
    light = np.linalg.lstsq(basis, amplitude)[0]
    shape = [scale, known.spread, known.roundness, known.skew]
    return [np.concatenate([shape, np.zeros(terms), light])]
