"""Columns of the rest images across the beam, and how well a profile explains them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from solver.centreline.noise import Noise
from solver.centreline.profile import Profile, Section, own_light, profile
from solver.centreline.profile_fit import MARGIN, Fits, KnownGround, fit_profiles
from solver.centreline.smooth import REST_DEGREE, curve
from solver.centreline.stations import Stations, stations
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.errors import InputError
from solver.instrument.medians import SIGMA_OVER_MAD

# Number of columns about one that show the typical light there, and the largest change from it,
# over the larger one of the light and its contrast. Chosen: a lamp that bare steel reflects is seen
# in 50 columns.
LIGHT_COLUMNS, MAX_CHANGE = 61, 0.6


@dataclass(frozen=True)
class RestColumns:
    """Rest images, and the stations where the beam crosses their columns.

    `polarity` is 1 for a beam brighter than its background and -1 for a darker one; `radius` [px]
    is the rig's. Another line is farther than `clear` pixels from the beam. Sections are those of
    the beam's `own_light`, or of its contrast with the ground.
    """

    images: Sequence[Grey]
    places: Stations
    noise: Noise
    polarity: int
    radius: float
    full_scale: int
    clear: float = math.inf
    own_light: bool = False

    @property
    def in_part(self) -> bool:
        """Whether the images show the profile at some places between the pixels only."""
        return bool(np.ptp(self.places.start) <= 1)

    def along(self, path: Floats) -> "RestColumns":
        """Read the images along another path (m, 2) [px]."""
        return replace(self, places=stations(path, self.images[0].shape))

    def half_width(self, section: Section) -> int:
        """Return the pixels on either side that show the section, a margin, and no other line."""
        return int(min(np.ceil(section.reach) + 1 + MARGIN, self.clear))

    def table(self, section: Section) -> Profile:
        """Tabulate a section's profiles along the beam at rest."""
        tabulate = own_light if self.own_light else profile
        return tabulate(section, float(self.places.length[-1]))

    def fits(self, table: Profile, half: int, known: KnownGround | None = None) -> list[Fits]:
        """Fit a profile to every image, on `half` pixels on either side of the beam."""
        return [
            fit_profiles(image, self.places, table, self.noise, half, self.full_scale, known)
            for image in self.images
        ]

    def off_path(self, fits: list[Fits]) -> Floats:
        """Average the centres (n,) [px] of all images, as offsets along the path's normal.

        Offsets in columns and in rows form one curve.
        """
        each = [self.places.sense * (f.centre - self.places.start) for f in fits]
        return np.asarray(np.mean(each, axis=0))

    def like_the_beam(self, fits: list[Fits], section: Section) -> Mask:
        """Mark the columns (n,) that look like most columns of the beam.

        Its contrast has one sign and one typical amplitude. Its own light is like that of the
        columns about it, and the contrast may have either sign.
        """
        shown = [np.isfinite(f.sigma) for f in fits]
        if self.own_light:
            least = THRESHOLDS.amplitude_sigmas
            shown += [np.abs(f.amplitude) > least * f.amplitude_sigma for f in fits]
        else:
            shown += [f.amplitude * self.polarity > 0 for f in fits]
        good = np.all(shown, axis=0)
        if not good.any():
            return np.asarray(good)
        if self.own_light:
            width = 2 * section.radius
            lights = [(f.amplitude + width * f.background)[good] for f in fits]
            about = median_filter(np.median(lights, axis=0), LIGHT_COLUMNS, mode="nearest")
            typical = np.interp(self.places.length, self.places.length[good], about)
        else:
            width = 0.0
            typical = np.median([np.median(f.amplitude[good]) for f in fits])
        for f in fits:
            expected = typical - width * f.background
            changed = np.abs(f.amplitude - expected)
            good &= changed < MAX_CHANGE * np.maximum(np.abs(expected), typical)
        return np.asarray(good)

    def smooth(self, centre: Floats, good: Mask) -> Floats:
        """Fit the smooth course (n,) of good centres; return all centres with too few of them."""
        length, sigma = self.places.length, np.where(good, 1e-6, np.inf)
        course: Floats = curve(length, centre, sigma, length, REST_DEGREE, THRESHOLDS.tukey_cut)
        return course if len(course) else centre

    def shape(self, section: Section, table: Profile) -> "Shape":
        """Fit a section's profile, and measure what it leaves. Raises InputError."""
        return self.shape_of_fits(section, table, self.fits(table, self.half_width(section)))

    def shape_of_fits(self, section: Section, table: Profile, fits: list[Fits]) -> "Shape":
        """Measure what fits to every image leave of the beam's columns. Raises InputError."""
        centre, good = self.off_path(fits), self.like_the_beam(fits, section)
        return shape_of(section, table, fits, centre, good, self.smooth(centre, good))


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


def shape_of(
    section: Section, table: Profile, fits: list[Fits], centre: Floats, good: Mask, course: Floats
) -> Shape:
    """Measure what the fits of a profile leave of good columns about a course (n,) [px].

    Raises InputError for fewer columns than `min_stations`.
    """
    check_count(int(np.count_nonzero(good)))
    scatter = SIGMA_OVER_MAD * float(np.median(np.abs(centre - course)[good]))
    misfit = float(np.median([f.chi2[good] / f.dof[good] for f in fits]))
    return Shape(section, table, fits, centre, good, scatter, misfit)


def check_count(n_columns: int) -> None:
    """Raise InputError for fewer columns of the beam than `min_stations`."""
    if n_columns < THRESHOLDS.min_stations:
        raise InputError(
            f"the rest images show {n_columns} columns of the beam, "
            f"needed are {THRESHOLDS.min_stations}"
        )
