"""Extraction of the beam from an image: detection, profile fit column by column, outlier flags.

find -> stations -> profile fit -> flags of columns that do not look like the beam -> tip. The
beam's appearance is learned from the images of it at rest.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from solver.centreline import Centreline, down_columns
from solver.centreline.appearance import Appearance, learn_appearance
from solver.centreline.finding import Path, find_path
from solver.centreline.flags import fit_and_flag_outliers, flag_columns
from solver.centreline.guide import Guide
from solver.centreline.profile_fit import fit_profiles
from solver.centreline.stations import stations
from solver.centreline.thresholds import LIMITS
from solver.centreline.tip import find_tip
from solver.instrument.arrays import Floats, Grey
from solver.instrument.compiled import njit


@dataclass(frozen=True)
class BeamExtractor:
    """Beam extractor by a profile fit at every column that crosses the beam."""

    appearance: Appearance
    guide: Guide

    def __call__(self, image: Grey) -> Centreline:
        """Extract the centreline of an image (height, width); empty where there is no beam."""
        appearance, guide = self.appearance, self.guide
        max_tilt = LIMITS.max_tilt if guide.free_tilt else 0.0
        path = find_path(image, guide, appearance.polarity, appearance.noise, max_tilt, bends=True)
        if path is None:
            return down_columns(np.empty((0, 2)), np.empty(0))
        return self.measure(image, path)

    def measure(self, image: Grey, path: Path) -> Centreline:
        """Measure the centreline along a path."""
        appearance = self.appearance
        places = stations(self.guide.pixels(path.places), image.shape)
        if len(places) < LIMITS.min_curve_points:
            return down_columns(np.empty((0, 2)), np.empty(0))
        fits = fit_profiles(
            image,
            places,
            appearance.profile,
            appearance.noise,
            appearance.half,
            appearance.full_scale,
        )
        brightness = fits.amplitude / np.interp(
            places.length, appearance.length, appearance.amplitude
        )
        misfit = fits.chi2 / np.maximum(fits.dof, 1) / appearance.misfit
        flags = flag_columns(
            brightness, misfit, fits.sigma, fits.amplitude, fits.amplitude_sigma, fits.saturated
        )
        length_px = self.guide.length / self.guide.pixel
        tip = find_tip(image, places, flags, fits, appearance)
        # A beam bent towards or away from the camera looks longer or shorter within these limits.
        if tip is not None and not LIMITS.min_length < tip.length / length_px < LIMITS.max_length:
            tip = None
        # The beam covers its last columns only in part.
        on_beam = places.length < (length_px if tip is None else tip.length - 1.5)
        sigma = np.hypot(fits.sigma * np.sqrt(np.maximum(misfit, 1.0)), appearance.sigma_px)
        # Offsets from the path along its normal: a beam that is read by columns first and then
        # by rows remains one curve.
        off_path = places.sense * (fits.centre - places.start)
        smooth = fit_and_flag_outliers(places.length, off_path, sigma, brightness, on_beam, flags)
        if not len(smooth):
            return down_columns(np.empty((0, 2)), np.empty(0))
        good = flags == 0
        noise = fits.sigma * np.sqrt(np.maximum(misfit, 1.0))
        common_sigma, typical_brightness, background = _summary(
            fits.centre[good], sigma[good], noise[good], brightness[good], fits.background[good]
        )
        smooth_px = places.start + places.sense * smooth
        height, width = image.shape
        limit = np.where(places.upright, height - 0.5, width - 0.5)
        in_image = (smooth_px > -0.5) & (smooth_px < limit)
        rejected = ~good & on_beam & in_image
        return Centreline(
            points=places.pixels(fits.centre)[good],
            directions=places.directions[good],
            sigma=sigma[good],
            rejected=places.pixels(smooth_px)[rejected],
            flags=flags[rejected],
            tip=None if tip is None else tip.pixel,
            tip_covariance=None if tip is None else tip.covariance,
            common_sigma=common_sigma,
            remark=self._remark(typical_brightness, background) if good.any() else "",
        )

    def _remark(self, beam: float, background: float) -> str:
        """Describe the change of brightness of beam and background since rest; "" if small."""
        appearance = self.appearance
        ratio = max(background, 1.0) / max(appearance.ground, 1.0)
        is_step = (
            abs(background - appearance.ground) > LIMITS.min_light_step * appearance.full_scale
        )
        if (
            not (is_step and not 1 / LIMITS.max_light_ratio < ratio < LIMITS.max_light_ratio)
            and 1 / LIMITS.max_light_ratio < beam < LIMITS.max_light_ratio
        ):
            return ""
        return (
            f"this image differs from the rest images: background {ratio:.2g} times and beam "
            f"{beam:.2g} times as bright; has exposure, gain, gamma or light changed?"
        )


@njit
def _summary(
    centre: Floats, sigma: Floats, noise: Floats, brightness: Floats, background: Floats
) -> tuple[float, float, float]:
    """Compute the sigma [px] of the points' mean error, and the median brightness and background.

    The error is the part that the sensor's noise does not explain. Such errors, mainly those of
    compression, follow the pixel grid: for a beam that crosses R pixel rows, only R + 1 of them
    are independent.
    """
    if len(centre) == 0:
        return 0.0, 0.0, 0.0
    excess = np.median(np.maximum(sigma**2 - noise**2, 0.0))
    rows = centre.max() - centre.min()
    return np.sqrt(excess / (1.0 + rows)), np.median(brightness), np.median(background)


def learn_beam(images: Sequence[Grey], guide: Guide) -> BeamExtractor:
    """Learn the beam from images (height, width) of it at rest. Raises InputError."""
    appearance, turned = learn_appearance(images, guide)
    return BeamExtractor(appearance, turned)
