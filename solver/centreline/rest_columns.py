"""Columns of the rest images across the beam, and how well a profile explains them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from solver.centreline.noise import Noise
from solver.centreline.profile import Profile, Section, profile
from solver.centreline.profile_fit import MARGIN, Fits, KnownGround, fit_profiles
from solver.centreline.smooth import smooth_curve
from solver.centreline.stations import Stations
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.errors import InputError
from solver.instrument.medians import SIGMA_OVER_MAD


@dataclass(frozen=True)
class RestColumns:
    """Rest images, and the stations where the beam crosses their columns.

    `polarity` is 1 for a beam brighter than its background and -1 for a darker one; `radius` [px]
    is the rig's. Another line is farther than `clear` pixels from the beam.
    """

    images: Sequence[Grey]
    places: Stations
    noise: Noise
    polarity: int
    radius: float
    full_scale: int
    clear: float = math.inf

    @property
    def in_part(self) -> bool:
        """Whether the images show the profile at some places between the pixels only."""
        return bool(np.ptp(self.places.start) <= 1)

    def half_width(self, section: Section) -> int:
        """Return the pixels on either side that show the section, a margin, and no other line."""
        return int(min(half_width(section), self.clear))

    def table(self, section: Section) -> Profile:
        """Tabulate a section's profiles along the beam at rest."""
        return profile(section, float(self.places.length[-1]))

    def fits(self, table: Profile, half: int, known: KnownGround | None = None) -> list[Fits]:
        """Fit a profile to every image, on `half` pixels on either side of the beam."""
        return [
            fit_profiles(image, self.places, table, self.noise, half, self.full_scale, known)
            for image in self.images
        ]

    def mean_centre(self, fits: list[Fits]) -> tuple[Floats, Mask]:
        """Average the centres (n,) [px] along the path's normal, and mark columns like the beam."""
        good = np.all([np.isfinite(f.sigma) & (f.amplitude * self.polarity > 0) for f in fits], 0)
        typical = np.median([np.median(f.amplitude[good]) for f in fits]) if good.any() else 0.0
        for f in fits:
            good &= np.abs(f.amplitude - typical) < 0.6 * abs(typical)
        # Offsets from the path along its normal form one curve for columns and rows.
        off_path = [self.places.sense * (f.centre - self.places.start) for f in fits]
        return np.mean(off_path, axis=0), good

    def smooth(self, centre: Floats, good: Mask) -> Floats:
        """Fit a quartic along the beam: bow, sag and lens distortion have no finer detail."""
        sigma = np.where(good, 1e-6, np.inf)
        curve = smooth_curve(self.places.length, centre, sigma, degree=4)
        return centre if curve is None else curve

    def shape(self, section: Section, table: Profile) -> "Shape":
        """Fit a section's profile, and measure what it leaves. Raises InputError."""
        fits = self.fits(table, self.half_width(section))
        centre, good = self.mean_centre(fits)
        check_count(good)
        residual = (centre - self.smooth(centre, good))[good]
        scatter = SIGMA_OVER_MAD * float(np.median(np.abs(residual)))
        misfit = float(np.median([f.chi2[good] / f.dof[good] for f in fits]))
        return Shape(section, table, fits, centre, good, scatter, misfit)


@dataclass(frozen=True)
class Shape:
    """A profile, its section, and its fits to the rest images.

    `centre` (n,) [px] are the mean centres along the path's normal, `good` (n,) marks the columns
    that look like the beam, `scatter` [px] is that of their centres about a smooth course, and
    `misfit` their median chi^2 per degree of freedom.
    """

    section: Section
    table: Profile
    fits: list[Fits]
    centre: Floats
    good: Mask
    scatter: float
    misfit: float

    @property
    def course_sigma(self) -> float:
        """Standard error [px] of the course's mean."""
        return self.scatter / math.sqrt(np.count_nonzero(self.good))


def half_width(section: Section) -> int:
    """Return the pixels on either side of the axis that show the beam and a margin."""
    widest = section.radius * (1 + abs(section.taper) / 2)
    return int(np.ceil(widest + 2.5 * section.spread + 0.5)) + 1 + MARGIN


def check_count(good: Mask) -> None:
    """Raise InputError for fewer columns of the beam than `min_stations`."""
    if np.count_nonzero(good) < THRESHOLDS.min_stations:
        raise InputError(
            f"the rest images show {np.count_nonzero(good)} columns of the beam, "
            f"needed are {THRESHOLDS.min_stations}"
        )
