"""The beam in an image: found, measured column by column, and judged.

find -> stations -> profile fit -> what does not look like the beam is flagged -> tip. What the
beam looks like was learned from the images of it at rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from solver.centreline import Centreline, Flag, down_columns
from solver.centreline.appearance import Appearance, learn
from solver.centreline.finding import Path, find
from solver.centreline.guide import Guide
from solver.centreline.profile_fit import Fits, fit_profiles
from solver.centreline.smooth import FEWEST, running_median, smooth_curve
from solver.centreline.stations import Stations, stations
from solver.centreline.tip import find_tip
from solver.instrument.arrays import Floats, Grey, Mask

# Times the amplitude at rest within which a column's amplitude may lie.
DIMMEST, BRIGHTEST = 0.4, 2.2
# chi^2 per degree of freedom, over what is typical at rest, that a column may leave: of seven
# degrees of freedom one in 300 leaves more.
WORST_MISFIT = 3.0
NEIGHBOURHOOD = 61
# An amplitude of fewer of its sigmas is none.
LEAST_SIGNIFICANCE = 5.0
# A brightness off its smooth course by this share, over the median of so many columns, is odd.
ODD, ABOUT = 0.012, 21
# Where two columns running are foreign, so many on either side are not trusted either: a shadow's
# or a leaf's edge begins in them.
SPOILT = 3
# A centre may lie this many of its sigmas, and this far [px], off the smooth curve of all.
FARTHEST_SIGMAS, FARTHEST_PX = 6.0, 0.15
# A tip must lie so far along the beam, over its length.
SHORTEST, LONGEST = 0.75, 1.3
# The beam turned about its clamp by another camera's mount [rad].
ANY_TILT = 0.6


@dataclass(frozen=True)
class Beam:
    """Measures the beam in images: a profile fit at every column that crosses it."""

    appearance: Appearance
    guide: Guide

    def __call__(self, image: Grey) -> Centreline:
        """The centreline in an image (height, width); empty where there is no beam."""
        look, guide = self.appearance, self.guide
        tilt = ANY_TILT if guide.free_tilt else 0.0
        path = find(image, guide, look.polarity, look.noise, tilt, bends=True)
        if path is None:
            return down_columns(np.empty((0, 2)), np.empty(0))
        return self.measure(image, path)

    def measure(self, image: Grey, path: Path) -> Centreline:
        """The centreline along a path."""
        look = self.appearance
        places = stations(self.guide.pixels(path.places), image.shape)
        if len(places) < FEWEST:
            return down_columns(np.empty((0, 2)), np.empty(0))
        fits = fit_profiles(image, places, look.profile, look.noise, look.half, look.full_scale)
        share = self._share(places, fits)
        flags = self._flags(places, fits, share)
        whole = self.guide.length / self.guide.pixel
        tip = find_tip(image, places, flags, fits, look)
        # Bent towards the camera or away from it, a beam looks longer or shorter, but not so much.
        if tip is not None and not SHORTEST < tip.length / whole < LONGEST:
            tip = None
        end = whole if tip is None else tip.length
        # The last columns of a beam are not whole ones.
        on_beam = places.length < end - (0 if tip is None else 1.5)
        flags[~on_beam & (flags == 0)] = Flag.FOREIGN
        flags[self._oddly_lit(places, share, flags, on_beam) & (flags == 0)] = Flag.FOREIGN
        sigma = np.hypot(fits.sigma * np.sqrt(np.maximum(self._misfit(fits), 1.0)), look.sigma_px)
        # Off the path, along its normal: a beam that is read by columns first and then by rows
        # is one curve so.
        off_path = places.sense * (fits.centre - places.start)
        smooth = smooth_curve(places.length, off_path, np.where(flags == 0, sigma, np.inf))
        if smooth is None:
            return down_columns(np.empty((0, 2)), np.empty(0))
        off = np.abs(off_path - smooth)
        flags[(flags == 0) & (off > FARTHEST_PX) & (off > FARTHEST_SIGMAS * sigma)] = Flag.FOREIGN
        running = (flags[:-1] == Flag.FOREIGN) & (flags[1:] == Flag.FOREIGN)
        spoilt = np.convolve(np.append(running, False), np.ones(2 * SPOILT + 1), "same") > 0
        flags[spoilt & (flags == 0)] = Flag.FOREIGN
        good = flags == 0
        course = places.pixels(places.start + places.sense * smooth)
        in_image = ((course > -0.5) & (course < np.array(image.shape)[::-1] - 0.5)).all(axis=1)
        rejected = ~good & on_beam & in_image
        return Centreline(
            points=places.pixels(fits.centre)[good],
            directions=places.directions[good],
            sigma=sigma[good],
            rejected=course[rejected],
            flags=flags[rejected],
            tip=None if tip is None else tip.pixel,
            tip_covariance=None if tip is None else tip.covariance,
        )

    def _misfit(self, fits: Fits) -> Floats:
        return np.asarray(fits.chi2 / np.maximum(fits.dof, 1) / self.appearance.misfit)

    def _share(self, places: Stations, fits: Fits) -> Floats:
        """Brightness over that at rest (n,)."""
        look = self.appearance
        return fits.amplitude / np.interp(places.length, look.length, look.amplitude)

    def _flags(self, places: Stations, fits: Fits, share: Floats) -> npt.NDArray[np.uint8]:
        """What does not look like the beam, each column by itself and its neighbours (n,)."""
        flags = np.zeros(len(places), np.uint8)
        # A beam that comes nearer to the camera looks wider than at rest, all along: what is
        # foreign differs from the columns about it.
        misfit = self._misfit(fits)
        usual = running_median(np.minimum(misfit, 30.0), NEIGHBOURHOOD)
        # On a rough ground every column leaves more, and is known that much less.
        plausible = (share > DIMMEST) & (share < BRIGHTEST)
        rough = float(np.median(misfit[plausible])) if plausible.any() else 1.0
        usual = np.maximum(usual, max(rough, 1.0))
        flags[misfit > WORST_MISFIT * usual] = Flag.FOREIGN
        flags[share > BRIGHTEST] = Flag.FOREIGN
        flags[share < DIMMEST] = Flag.HIDDEN
        # In a rough ground a beam must stand out all the more.
        doubt = fits.amplitude_sigma * np.sqrt(np.maximum(misfit, 1.0))
        flags[np.abs(fits.amplitude) < LEAST_SIGNIFICANCE * doubt] = Flag.HIDDEN
        flags[~np.isfinite(fits.sigma)] = Flag.HIDDEN
        flags[(fits.saturated > 0) & (flags > 0)] = Flag.SATURATED
        return flags

    def _oddly_lit(
        self, places: Stations, share: Floats, flags: npt.NDArray[np.uint8], on_beam: Mask
    ) -> Mask:
        """Where something keeps light from the beam, or adds to it: brighter or darker than about.

        What is close to the beam takes light from one of its flanks, and moves its centre.
        """
        odd = np.zeros(len(share), np.bool_)
        course = running_median(share[on_beam], ABOUT)
        known = flags[on_beam] == 0
        sigma = np.where(known, ODD / 3, np.inf)
        usual = smooth_curve(places.length[on_beam], course, sigma, degree=2, cut=2.5)
        if usual is not None:
            off = np.abs(course / usual - 1)
            # Under a spotted light every place is odd, and none.
            odd[on_beam] = off > max(ODD, 4.5 * float(np.median(off[known])))
        return odd


def learn_beam(images: Sequence[Grey], guide: Guide) -> Beam:
    """Learn the beam from images (height, width) of it at rest. Raises InputError."""
    appearance, turned = learn(images, guide)
    return Beam(appearance, turned)
