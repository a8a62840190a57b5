"""The beam in an image: found, measured column by column, and judged.

find -> stations -> profile fit -> what does not look like the beam is flagged -> tip. What the
beam looks like was learned from the images of it at rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter

from solver.centreline import Centreline, Flag, down_columns
from solver.centreline.appearance import Appearance, learn
from solver.centreline.finding import Path, find
from solver.centreline.guide import Guide
from solver.centreline.profile_fit import Fits, fit_profiles
from solver.centreline.smooth import FEWEST, smooth_curve
from solver.centreline.stations import Stations, stations
from solver.centreline.tip import find_tip
from solver.instrument.arrays import Floats, Grey

# Times the amplitude at rest within which a column's amplitude may lie.
DIMMEST, BRIGHTEST = 0.4, 2.2
# chi^2 per degree of freedom, over what is typical at rest, that a column may leave: of seven
# degrees of freedom one in 300 leaves more.
WORST_MISFIT = 3.0
NEIGHBOURHOOD = 61
# Where two columns running are foreign, so many on either side are not trusted either: a shadow's
# or a leaf's edge begins in them.
SPOILT = 3
# A centre may lie this many of its sigmas, and this far [px], off the smooth curve of all.
FARTHEST_SIGMAS, FARTHEST_PX = 6.0, 0.15
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
        flags = self._flags(places, fits)
        sigma = np.hypot(fits.sigma * np.sqrt(np.maximum(self._misfit(fits), 1.0)), look.sigma_px)
        smooth = smooth_curve(places.length, fits.centre, np.where(flags == 0, sigma, np.inf))
        if smooth is None:
            return down_columns(np.empty((0, 2)), np.empty(0))
        off = np.abs(fits.centre - smooth)
        flags[(flags == 0) & (off > FARTHEST_PX) & (off > FARTHEST_SIGMAS * sigma)] = Flag.FOREIGN
        tip = find_tip(image, places, flags, fits, look)
        if tip is not None:
            beyond = places.length > tip.length - 1.5
            flags[beyond & (flags == 0)] = Flag.FOREIGN
        running = (flags[:-1] == Flag.FOREIGN) & (flags[1:] == Flag.FOREIGN)
        spoilt = np.convolve(np.append(running, False), np.ones(2 * SPOILT + 1), "same") > 0
        flags[spoilt & (flags == 0)] = Flag.FOREIGN
        good = flags == 0
        end = self.guide.length / self.guide.pixel if tip is None else tip.length
        on_path = places.length <= end
        rejected = ~good & on_path
        return Centreline(
            points=places.pixels(fits.centre)[good],
            directions=places.directions[good],
            sigma=sigma[good],
            rejected=places.pixels(smooth)[rejected],
            flags=flags[rejected],
            tip=None if tip is None else tip.pixel,
            tip_covariance=None if tip is None else tip.covariance,
        )

    def _misfit(self, fits: Fits) -> Floats:
        return np.asarray(fits.chi2 / np.maximum(fits.dof, 1) / self.appearance.misfit)

    def _flags(self, places: Stations, fits: Fits) -> npt.NDArray[np.uint8]:
        look = self.appearance
        expected = np.interp(places.length, look.length, look.amplitude)
        share = fits.amplitude / expected
        flags = np.zeros(len(places), np.uint8)
        # A beam that comes nearer to the camera looks wider than at rest, all along: what is
        # foreign differs from the columns about it.
        misfit = self._misfit(fits)
        usual = median_filter(np.minimum(misfit, WORST_MISFIT), NEIGHBOURHOOD, mode="nearest")
        flags[misfit > WORST_MISFIT * np.maximum(usual, 1.0)] = Flag.FOREIGN
        flags[share > BRIGHTEST] = Flag.FOREIGN
        flags[share < DIMMEST] = Flag.HIDDEN
        flags[~np.isfinite(fits.sigma)] = Flag.HIDDEN
        flags[(fits.saturated > 0) & (flags > 0)] = Flag.SATURATED
        return flags


def learn_beam(images: Sequence[Grey], guide: Guide) -> Beam:
    """Learn the beam from images (height, width) of it at rest. Raises InputError."""
    appearance, turned = learn(images, guide)
    return Beam(appearance, turned)
