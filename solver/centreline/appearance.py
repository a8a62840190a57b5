"""Appearance of the beam at rest: polarity, width and shading, learned from the rest images."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import minimize

from solver.centreline.finding import find
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise, noise_of
from solver.centreline.profile import Profile, Section, profile
from solver.centreline.profile_fit import MARGIN, Fits, fit_profiles
from solver.centreline.smooth import smooth_curve
from solver.centreline.stations import Stations, stations
from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.errors import InputError
from solver.instrument.transforms import turn_about_z

# Largest angle [rad] of a mounted beam off the rig's x axis.
ASKEW = 0.12
# Trial widths, times the rig's diameter: a flat strip looks wider than it is thick.
WIDTHS = (1, 2, 4, 8)
LEAST_STATIONS = 20
# Start values of the section's search: diameter over the rig's, spread, roundness, skew. A
# sharpened beam looks narrower than it is, a defocused one wider.
STARTS = ((1.0, 0.3, 1.0, 0.0), (1.0, 0.8, 0.5, 0.0))
PROCESSED_STARTS = tuple((times, *rest) for times in (0.7, 1.4) for _, *rest in STARTS)
# Images are processed above this chi^2 per degree of freedom; chosen: a section that describes an
# unprocessed beam leaves about 1.
PROCESSED = 2.0


@dataclass(frozen=True)
class Appearance:
    """Appearance of the beam, learned from the rest images.

    `polarity` is 1 for a beam brighter than its background and -1 for a darker one; `amplitude`
    [gray px] is given along `length` [px] of the path; `misfit` is the typical chi^2 per degree of
    freedom of a profile fit, at least 1; `sigma_px` is the part of a centre's error that does not
    come from the sensor's noise; `ground` is the background's median gray value. `half` pixels on
    either side are fitted.
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


def learn(images: Sequence[Grey], guide: Guide) -> tuple[Appearance, Guide]:
    """Learn the beam's appearance, and turn the guide to the beam's direction at rest.

    Raises InputError where no beam is found along the rig's x axis.
    """
    noise = noise_of(images)
    image = images[0]
    full_scale = guide.full_scale or int(np.iinfo(image.dtype).max)
    seen = []
    for times, polarity in product(WIDTHS, (1, -1)):
        wider = replace(guide, radius=times * guide.radius)
        path = find(image, wider, polarity, noise, ASKEW, bends=False)
        if path is not None:
            seen.append((path.contrast * path.support**2, path, polarity, wider))
    if not seen:
        raise InputError("the rest images show no beam where the rig says that it is")
    _, path, polarity, guide = max(seen, key=lambda one: one[0])
    on_beam = path.places[(path.places[:, 0] > 0) & (path.places[:, 0] < 0.98 * guide.length)]
    places = stations(guide.pixels(on_beam), image.shape)
    if len(places) < LEAST_STATIONS:
        raise InputError(
            f"the rest images show {len(places)} columns of the beam, needed are {LEAST_STATIONS}"
        )
    slope = float(np.polyfit(on_beam[:, 0], on_beam[:, 1], 1)[0])
    turned = guide.antenna_from_beam @ turn_about_z(np.arctan(slope))
    look = _Rested(images, places, noise, polarity, guide.radius_px, full_scale).appearance()
    seen_radius = look.section.radius * guide.pixel
    return look, replace(guide, antenna_from_beam=turned, radius=seen_radius)


@dataclass(frozen=True)
class _Rested:
    """Rest images, and the stations where the beam crosses their columns."""

    images: Sequence[Grey]
    places: Stations
    noise: Noise
    polarity: int
    radius: float
    full_scale: int

    def appearance(self) -> Appearance:
        """Estimate the section that gives the smoothest centres and the smallest residuals."""
        p = self._best(STARTS, 1.0)
        usual = self._misfit(p)
        if usual > PROCESSED:
            # The noise between processed images is no reference: misfits are scaled by `usual`.
            p = self._best((*STARTS, *PROCESSED_STARTS), usual)
        section = self._section(p)
        if section is None:
            raise InputError("the rest images show no beam of the rig's diameter")
        fits = self._fits(section)
        centre, kept = self._mean_centre(fits)
        if np.count_nonzero(kept) < LEAST_STATIONS:
            raise InputError(
                f"the rest images show {np.count_nonzero(kept)} columns of the beam, "
                f"needed are {LEAST_STATIONS}"
            )
        off = (centre - self._smooth(centre, kept))[kept]
        by_noise = np.mean([f.sigma[kept] ** 2 for f in fits]) / len(fits)
        scatter = (1.4826 * np.median(np.abs(off))) ** 2
        amplitude = np.mean([f.amplitude for f in fits], axis=0)
        return Appearance(
            polarity=self.polarity,
            noise=self.noise,
            section=section,
            profile=profile(section),
            # The median filter removes the noise of single columns.
            amplitude=median_filter(amplitude[kept], 21, mode="nearest"),
            length=self.places.length[kept],
            misfit=max(1.0, float(np.median([f.chi2[kept] / f.dof[kept] for f in fits]))),
            sigma_px=float(np.sqrt(max(scatter - by_noise, 0.0))),
            ground=float(np.median([np.median(f.background[kept]) for f in fits])),
            half=self._half(section),
            full_scale=self.full_scale,
        )

    def _best(self, starts: Sequence[tuple[float, ...]], usual: float) -> Floats:
        """Find the parameters (4,) of least cost; misfits are in units of `usual`."""

        def cost(p: Floats) -> float:
            section = self._section(p)
            if section is None:
                return 1e12
            fits = self._fits(section)
            centre, kept = self._mean_centre(fits)
            if np.count_nonzero(kept) < LEAST_STATIONS:
                return 1e12
            off = centre - self._smooth(centre, kept)
            sigma = np.median([f.sigma[kept] for f in fits], axis=0) / np.sqrt(len(fits))
            # The Cauchy loss limits the influence of an object at a few columns, and keeps a
            # gradient for a start that is far off in all of them.
            rough = np.log1p((off[kept] / sigma) ** 2 / usual / 25).sum() * 25
            left = sum(np.log1p(f.chi2[kept] / f.dof[kept] / usual / 9).sum() * 36 for f in fits)
            return float(rough + left)

        start = min((np.array(start) for start in starts), key=cost)
        simplex = start + np.vstack([np.zeros(4), np.diag([0.1, 0.2, 0.4, 0.1])])
        found = minimize(
            cost,
            start,
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": 90, "xatol": 5e-3, "fatol": 1.0},
        )
        return np.asarray(found.x)

    def _misfit(self, p: Floats) -> float:
        """Compute the median chi^2 per degree of freedom of a section's fits; at least 1."""
        section = self._section(p)
        fits = [] if section is None else self._fits(section)
        left = [f.chi2 / f.dof for f in fits if np.isfinite(f.sigma).any()]
        return max(1.0, float(np.median(left))) if left else 1.0

    def _section(self, p: Floats) -> Section | None:
        times, spread, roundness, skew = (float(v) for v in p)
        possible = 0.4 < times < 2.5 and 0 <= spread <= 4 and 0 <= roundness <= 4
        if not (possible and abs(skew) < 0.9):
            return None
        return Section(times * self.radius, spread, roundness, skew)

    def _half(self, section: Section) -> int:
        return int(np.ceil(section.radius + 2.5 * section.spread + 0.5)) + 1 + MARGIN

    def _fits(self, section: Section) -> list[Fits]:
        table, half = profile(section), self._half(section)
        return [
            fit_profiles(image, self.places, table, self.noise, half, self.full_scale)
            for image in self.images
        ]

    def _mean_centre(self, fits: list[Fits]) -> tuple[Floats, Mask]:
        kept = np.all([np.isfinite(f.sigma) & (f.amplitude * self.polarity > 0) for f in fits], 0)
        typical = np.median([np.median(f.amplitude[kept]) for f in fits]) if kept.any() else 0.0
        for f in fits:
            kept &= np.abs(f.amplitude - typical) < 0.6 * abs(typical)
        # Offsets from the path along its normal form one curve for columns and rows.
        off_path = [self.places.sense * (f.centre - self.places.start) for f in fits]
        return np.mean(off_path, axis=0), kept

    def _smooth(self, centre: Floats, kept: Mask) -> Floats:
        """Fit a quartic along the beam: bow, sag and lens distortion have no finer detail."""
        unknown = np.where(kept, 1e-6, np.inf)
        curve = smooth_curve(self.places.length, centre, unknown, degree=4)
        return centre if curve is None else curve
