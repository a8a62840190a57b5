"""Appearance of the beam at rest: polarity, width and shading, learned from the rest images."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import minimize

from solver.centreline.effective_profile import (
    EffectiveProfile,
    effective_profile,
    read_columns,
)
from solver.centreline.ground import Ground, learn_ground
from solver.centreline.ground_fit import fit_columns
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise, estimate_noise
from solver.centreline.profile import Profile, Section, profile, tilt_response
from solver.centreline.profile_fit import MARGIN, Fits, fit_profiles
from solver.centreline.rest_line import find_rest_line
from solver.centreline.section_on_ground import section_on_ground
from solver.centreline.smooth import smooth_curve
from solver.centreline.stations import Stations, stations
from solver.centreline.thresholds import LIMITS
from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.errors import InputError
from solver.instrument.transforms import turn_about_z

# Trial widths, times the rig's diameter: a round beam looks wider out of focus, and a flat strip is
# wider than it is thick. A round beam with its soft shadow also looks like a wide strip.
WIDTHS, FLAT_WIDTHS = (1, 2), (1, 2, 4, 8)
# Start values of the section's search: diameter over the rig's, spread, roundness, skew. A
# sharpened beam looks narrower than it is, a defocused one wider.
STARTS = ((1.0, 0.3, 1.0, 0.0), (1.0, 0.8, 0.5, 0.0))
# Pixels beside the beam that its image covers, before its section is known. Chosen: a sharp image.
FIRST_REACH_PX = 2.0
PROCESSED_STARTS = tuple((scale, *rest) for scale in (0.7, 1.4) for _, *rest in STARTS)


@dataclass(frozen=True)
class Appearance:
    """Appearance of the beam, learned from the rest images.

    `polarity` is 1 for a beam brighter than its background and -1 for a darker one; `amplitude`
    [gray px] is given along `length` [px] of the path; `misfit` is the typical chi^2 per degree of
    freedom of a profile fit, at least 1; `sigma_px` is the part of a centre's error that does not
    come from the sensor's noise; `ground` is the background's median gray value. `half` pixels on
    either side are fitted. `ground_at_rest` is None for a ground without structure. A profile that
    `is_sampled` is that of the images, not that of the section.
    """

    polarity: int
    noise: Noise
    section: Section
    profile: Profile
    amplitude: Floats
    length: Floats
    misfit: float
    sigma_px: float
    ground: float
    half: int
    full_scale: int
    ground_at_rest: Ground | None = None
    is_sampled: bool = False

    @cached_property
    def shading(self) -> float:
        """Weight of the beam's own shading in its fitted place.

        It is the beam's mean gray value over its contrast with the ground: 1 before a black ground,
        more before a gray one, and negative for a beam that is darker than its ground; times the
        response of a profile fit.
        """
        amplitude = float(np.median(self.amplitude))
        contrast = amplitude / (2 * self.section.radius)
        beside = self.noise.dark + self.noise.per_gray * self.ground
        on_beam = self.noise.per_gray * max(amplitude, 0.0)
        weights = np.array([beside, on_beam])
        response = tilt_response(self.profile, self.section, weights, self.half)
        return response * (contrast + self.ground) / contrast


def learn_appearance(images: Sequence[Grey], guide: Guide) -> tuple[Appearance, Guide]:
    """Learn the beam's appearance, and turn the guide to the beam's direction at rest.

    Raises InputError where no beam is found along the rig's x axis.
    """
    noise = estimate_noise(images)
    mean = np.mean([np.asarray(image, np.float64) for image in images], axis=0)
    full_scale = guide.full_scale or int(np.iinfo(images[0].dtype).max)
    line = find_rest_line(mean, guide, FLAT_WIDTHS if guide.flat else WIDTHS)
    if line is None:
        raise InputError("the rest images show no beam along the rig's x axis")
    guide = replace(guide, radius=line.width * guide.radius)
    on_beam = line.places[(line.places[:, 0] > 0) & (line.places[:, 0] < 0.98 * guide.length)]
    path, beam = guide.pixels(on_beam), _to_the_tip(line.places, guide)
    places = stations(path, mean.shape)
    if len(places) < LIMITS.min_stations:
        raise InputError(
            f"the rest images show {len(places)} columns of the beam, "
            f"needed are {LIMITS.min_stations}"
        )
    rest = _RestImages(images, places, noise, line.polarity, guide.radius_px, full_scale)
    reach = guide.radius_px + FIRST_REACH_PX
    ground = learn_ground(images, beam, reach, noise, int(reach + 0.5) + MARGIN)
    if ground is not None:
        look = rest.appearance_before(ground, beam)
    else:
        sampled, table = rest.sampled(), None
        if sampled is not None:
            path = _moved(path, places, places.sense * sampled.off_path)
            rest = replace(rest, places=stations(path, mean.shape))
            # A beam along a row of pixels samples its profile at one place between them only.
            table = sampled.table if np.ptp(rest.places.start) > 1 else None
        look = rest.appearance(table)
    x, y = guide.places(path).T
    slope = float(np.polyfit(x, y, 1)[0])
    antenna_from_beam = guide.antenna_from_beam @ turn_about_z(np.arctan(slope))
    if look.sigma_px > LIMITS.max_scatter_px:
        raise InputError(
            f"the columns of the beam at rest scatter by {look.sigma_px:.1f} px about a smooth "
            f"curve, allowed is {LIMITS.max_scatter_px:g}: the ground's structure hides the beam"
        )
    radius = look.section.radius * guide.pixel
    return look, replace(guide, antenna_from_beam=antenna_from_beam, radius=radius)


@dataclass(frozen=True)
class _RestImages:
    """Rest images, and the stations where the beam crosses their columns."""

    images: Sequence[Grey]
    places: Stations
    noise: Noise
    polarity: int
    radius: float
    full_scale: int

    def sampled(self) -> EffectiveProfile | None:
        """Sample the profile along the path, and the beam's distance (n,) from it.

        Return None if too few columns are within the image and below full scale.
        """
        half = _half(self._nominal)
        columns = read_columns(self.images, self.places, half, self.noise, self.full_scale)
        sampled = effective_profile(columns, half - MARGIN, self.polarity)
        if sampled is None:
            return None
        off_path = np.interp(self.places.length, columns.length, sampled.off_path)
        return EffectiveProfile(sampled.table, off_path)

    @property
    def _nominal(self) -> Section:
        """The rig's section, which extends FIRST_REACH_PX further in the image."""
        return Section(self.radius, FIRST_REACH_PX / 3, 0.0, 0.0)

    def appearance(self, sampled: Profile | None) -> Appearance:
        """Estimate the section that gives the smoothest centres and the smallest residuals.

        Where the section leaves more than noise, the `sampled` profile may take its place.
        """
        shape = self._described()
        if sampled is not None and (shape is None or shape.misfit > LIMITS.max_section_misfit):
            other = self._shape(self._nominal, sampled)
            if shape is None or other.course_sigma < shape.course_sigma:
                shape = other
        if shape is None:
            raise InputError("the rest images show no beam of the rig's diameter")
        fits, good = shape.fits, shape.good
        noise_variance = float(np.mean([f.sigma[good] ** 2 for f in fits])) / len(fits)
        amplitude = np.mean([f.amplitude for f in fits], axis=0)
        return Appearance(
            polarity=self.polarity,
            noise=self.noise,
            section=shape.section,
            profile=shape.table,
            # The median filter removes the noise of single columns.
            amplitude=median_filter(amplitude[good], 21, mode="nearest"),
            length=self.places.length[good],
            misfit=max(1.0, shape.misfit),
            sigma_px=float(np.sqrt(max(shape.scatter**2 - noise_variance, 0.0))),
            ground=float(np.median([np.median(f.background[good]) for f in fits])),
            half=_half(shape.section),
            full_scale=self.full_scale,
            is_sampled=sampled is not None and shape.table is sampled,
        )

    def _described(self) -> "_Shape | None":
        """Describe the profile by a section; return None where no section shows the beam."""
        p = self._best(STARTS, 1.0)
        misfit_unit = self._misfit(p)
        if misfit_unit > LIMITS.processed_misfit:
            # The noise of processed images is no reference: misfits are scaled by `misfit_unit`.
            p = self._best((*STARTS, *PROCESSED_STARTS), misfit_unit)
        section = self._section(p)
        if section is None:
            return None
        try:
            return self._shape(section, profile(section))
        except InputError:
            return None

    def _shape(self, section: Section, table: Profile) -> "_Shape":
        fits = self._fits(table, _half(section))
        centre, good = self._mean_centre(fits)
        self._check_count(good)
        residual = (centre - self._smooth(centre, good))[good]
        scatter = 1.4826 * float(np.median(np.abs(residual)))
        misfit = float(np.median([f.chi2[good] / f.dof[good] for f in fits]))
        return _Shape(section, table, fits, good, scatter, misfit)

    def appearance_before(self, ground: Ground, beam: Floats) -> Appearance:
        """Estimate the section before a ground with structure; `beam` (n, 2) [px] is its path."""
        mean = np.mean([np.asarray(image, np.float64) for image in self.images], axis=0)
        variance = self.noise.variance(mean) / len(self.images)
        half = int(self.radius + FIRST_REACH_PX + 0.5) + MARGIN
        look = section_on_ground(mean, variance, self.places, self.radius, half, ground)
        # With the beam's own width, less of the ground is unknown.
        section, off_path = look.section, self.places.sense * look.off_path
        places = replace(self.places, start=self.places.start + off_path)
        reach = section.radius + 2.5 * section.spread + 0.5
        ground = (
            learn_ground(
                self.images, _moved(beam, self.places, off_path), reach, self.noise, _half(section)
            )
            or ground
        )
        table = profile(section)
        fits = [
            fit_columns(
                image, places, table, self.noise, _half(section), self.full_scale,
                section.radius, ground, look.amplitude,
            )
            for image in self.images
        ]  # fmt: skip
        good = np.all([np.isfinite(f.sigma) for f in fits], axis=0)
        good &= look.amplitude * self.polarity > 0
        self._check_count(good)
        residual = np.mean([f.centre for f in fits], axis=0)[good] - places.start[good]
        # The error of the interpolated ground is the same in all images. Where it is like the beam,
        # a sigma may be of any size.
        variance_px = float(np.median([f.sigma[good] for f in fits])) ** 2
        scatter = (1.4826 * np.median(np.abs(residual))) ** 2
        return Appearance(
            polarity=self.polarity,
            noise=self.noise,
            section=section,
            profile=table,
            amplitude=look.amplitude[good],
            length=self.places.length[good],
            misfit=max(1.0, float(np.median([f.chi2[good] / f.dof[good] for f in fits]))),
            sigma_px=float(np.sqrt(max(scatter - variance_px, 0.0))),
            ground=ground.level,
            half=_half(section),
            full_scale=self.full_scale,
            ground_at_rest=ground,
        )

    def _check_count(self, good: Mask) -> None:
        if np.count_nonzero(good) < LIMITS.min_stations:
            raise InputError(
                f"the rest images show {np.count_nonzero(good)} columns of the beam, "
                f"needed are {LIMITS.min_stations}"
            )

    def _best(self, starts: Sequence[tuple[float, ...]], misfit_unit: float) -> Floats:
        """Find the parameters (4,) of minimum cost; misfits are in units of `misfit_unit`."""

        def cost(p: Floats) -> float:
            section = self._section(p)
            if section is None:
                return 1e12
            fits = self._fits(profile(section), _half(section))
            centre, good = self._mean_centre(fits)
            if np.count_nonzero(good) < LIMITS.min_stations:
                return 1e12
            residual = centre - self._smooth(centre, good)
            sigma = np.median([f.sigma[good] for f in fits], axis=0) / np.sqrt(len(fits))
            # The Cauchy loss limits the influence of an object at a few columns, and keeps a
            # gradient for a start that is far off in all of them.
            roughness = np.log1p((residual[good] / sigma) ** 2 / misfit_unit / 25).sum() * 25
            misfit = sum(
                np.log1p(f.chi2[good] / f.dof[good] / misfit_unit / 9).sum() * 36 for f in fits
            )
            return float(roughness + misfit)

        start = min((np.array(start) for start in starts), key=cost)
        simplex = start + np.vstack([np.zeros(4), np.diag([0.1, 0.2, 0.4, 0.1])])
        result = minimize(
            cost,
            start,
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": 90, "xatol": 5e-3, "fatol": 1.0},
        )
        return np.asarray(result.x)

    def _misfit(self, p: Floats) -> float:
        """Compute the median chi^2 per degree of freedom of a section's fits; at least 1."""
        section = self._section(p)
        fits = [] if section is None else self._fits(profile(section), _half(section))
        misfits = [f.chi2 / np.maximum(f.dof, 1) for f in fits if np.isfinite(f.sigma).any()]
        return max(1.0, float(np.median(misfits))) if misfits else 1.0

    def _section(self, p: Floats) -> Section | None:
        scale, spread, roundness, skew = (float(v) for v in p)
        possible = 0.4 < scale < 2.5 and 0 <= spread <= 4 and 0 <= roundness <= 4
        if not (possible and abs(skew) < 0.9):
            return None
        return Section(scale * self.radius, spread, roundness, skew)

    def _fits(self, table: Profile, half: int) -> list[Fits]:
        return [
            fit_profiles(image, self.places, table, self.noise, half, self.full_scale)
            for image in self.images
        ]

    def _mean_centre(self, fits: list[Fits]) -> tuple[Floats, Mask]:
        good = np.all([np.isfinite(f.sigma) & (f.amplitude * self.polarity > 0) for f in fits], 0)
        typical = np.median([np.median(f.amplitude[good]) for f in fits]) if good.any() else 0.0
        for f in fits:
            good &= np.abs(f.amplitude - typical) < 0.6 * abs(typical)
        # Offsets from the path along its normal form one curve for columns and rows.
        off_path = [self.places.sense * (f.centre - self.places.start) for f in fits]
        return np.mean(off_path, axis=0), good

    def _smooth(self, centre: Floats, good: Mask) -> Floats:
        """Fit a quartic along the beam: bow, sag and lens distortion have no finer detail."""
        sigma = np.where(good, 1e-6, np.inf)
        curve = smooth_curve(self.places.length, centre, sigma, degree=4)
        return centre if curve is None else curve


@dataclass(frozen=True)
class _Shape:
    """A profile, its section, and its fits to the rest images.

    `good` (n,) marks the columns that look like the beam, `scatter` [px] is that of their mean
    centres about a smooth course, and `misfit` their median chi^2 per degree of freedom.
    """

    section: Section
    table: Profile
    fits: list[Fits]
    good: Mask
    scatter: float
    misfit: float

    @property
    def course_sigma(self) -> float:
        """Standard error [px] of the course's mean."""
        return self.scatter / math.sqrt(np.count_nonzero(self.good))


def _to_the_tip(places: Floats, guide: Guide) -> Floats:
    """Compute the pixels (n, 2) of a path from the clamp to the tip."""
    x = np.linspace(0.0, guide.length, 50)
    return guide.pixels(np.column_stack([x, np.interp(x, *places.T)]))


def _moved(beam: Floats, places: Stations, off_path: Floats) -> Floats:
    """Move a path (m, 2) [px] with its stations, by `off_path` (n,) across their columns."""
    upright = 2 * np.count_nonzero(places.upright) >= len(places)
    used = places.upright == upright
    order = np.argsort(places.along[used])
    axis = 0 if upright else 1
    moved = np.array(beam)
    moved[:, 1 - axis] += np.interp(beam[:, axis], places.along[used][order], off_path[used][order])
    return moved


def _half(section: Section) -> int:
    return int(np.ceil(section.radius + 2.5 * section.spread + 0.5)) + 1 + MARGIN
