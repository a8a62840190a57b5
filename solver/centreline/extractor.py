"""Extraction of the beam from an image: detection, profile fit column by column, outlier flags.

find -> stations -> profile fit -> flags of columns that do not look like the beam -> tip. The
beam's appearance is learned from the images of it at rest.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from solver.centreline import Centreline, down_columns
from solver.centreline.appearance import Appearance, learn_appearance
from solver.centreline.finding import find_path
from solver.centreline.flags import Columns, fit_and_flag_outliers, flag_columns
from solver.centreline.following import follow
from solver.centreline.grid_fit import fit_grid_error
from solver.centreline.ground import Ground
from solver.centreline.guide import Guide
from solver.centreline.profile_fit import KnownGround
from solver.centreline.smooth import running_median
from solver.centreline.stations import Stations, stations
from solver.centreline.thresholds import THRESHOLDS
from solver.centreline.tip import TipEstimate, find_tip
from solver.instrument.arrays import Floats, Grey, Mask
from solver.instrument.compiled import njit
from solver.instrument.grid_error import GridError
from solver.instrument.medians import median

# A numpy scalar is compiled once, a literal anew.
_NONE: Any = np.int64(0)
# Width, in points, of the local median of brightness. Chosen.
_SHADE_WIDTH: Any = np.int64(5)


class Extractor(Protocol):
    """Measurement of the beam's centreline in an image, as learned from the beam at rest."""

    @property
    def shading(self) -> float:
        """Weight of the beam's own shading in its measured place."""
        ...

    @property
    def detector(self) -> "BeamExtractor | None":
        """Extractor that detects the beam and its tip by the beam's appearance, if there is one."""
        ...

    def __call__(self, image: Grey, /) -> Centreline:
        """Extract the centreline of an image (height, width); empty where there is no beam."""
        ...


class _Course(NamedTuple):
    """Columns at n stations, and the beam's course along them.

    `on_beam` (n,) are the stations before the tip, `smooth` [px] is the beam's course beside the
    path, of length 0 if too few columns show the beam. `grid_error` has been subtracted from the
    centres; None if there is none.
    """

    columns: Columns
    on_beam: Mask
    tip: TipEstimate | None
    smooth: Floats
    grid_error: GridError | None


@dataclass(frozen=True)
class BeamExtractor:
    """Beam extractor by a profile fit at every column that crosses the beam."""

    appearance: Appearance
    guide: Guide

    @property
    def shading(self) -> float:
        """Weight of the beam's own shading in its fitted place."""
        return self.appearance.fit_response * self.appearance.shading

    @property
    def detector(self) -> Self:
        """This extractor itself."""
        return self

    def __call__(self, image: Grey) -> Centreline:
        """Extract the centreline of an image (height, width); empty where there is no beam."""
        appearance, guide = self.appearance, self.guide
        max_tilt = THRESHOLDS.max_tilt if guide.free_tilt else 0.0
        ground = appearance.ground_at_rest
        ground = None if ground is None else ground.in_image(image, appearance.noise)
        flat = None if ground is None else ground.subtracted(image, appearance.full_scale)
        if flat is None:
            ground, flat = None, image
        path = find_path(flat, guide, appearance.polarity, appearance.noise, max_tilt)
        if path is None:
            return down_columns(np.empty((0, 2)), np.empty(0))
        line = self._measure(image, flat, ground, path)
        if line.tip is not None or self._extent(line) > THRESHOLDS.min_extent:
            return line
        # A beam that is bent far turns out of the shapes and the lines of the detection.
        path = follow(line.points, guide, lambda nodes: self._centres(image, ground, nodes))
        longer = line if path is None else self._measure(image, flat, ground, path)
        return longer if len(longer.points) > len(line.points) else line

    def _extent(self, line: Centreline) -> float:
        """Compute how far along the beam the last point is, over its length; 1 at the border."""
        if not len(line.points):
            return 1.0
        camera, last = self.guide.camera, line.points[-1]
        margin = 2 * self.appearance.half
        if (last < margin).any() or (last > [camera.width - margin, camera.height - margin]).any():
            return 1.0
        # A copy: for the read-only array, compiled functions would be compiled once more.
        places = self.guide.places(np.array(line.points))
        steps = np.hypot(*np.diff(places, axis=0, prepend=np.zeros((1, 2))).T)
        return float(steps.sum()) / self.guide.length

    def _centres(self, image: Grey, ground: Ground | None, nodes: Floats) -> Floats:
        """Measure the centres (n, 2) [px] of columns along nodes (m, 2) that look like the beam."""
        places = stations(nodes, image.shape)
        if not places.size:
            return np.empty((0, 2))
        columns = self._fit(image, places, ground)
        good = columns.flags == 0
        along, centre = places.along[good], columns.fits.centre[good]
        upright = places.upright[good, None]
        return np.where(upright, np.column_stack([along, centre]), np.column_stack([centre, along]))

    def _fit(self, image: Grey, places: Stations, ground: Ground | None) -> Columns:
        """Fit the columns at n stations, and flag those that do not look like the beam at rest."""
        look = self.appearance
        known = None if ground is None else KnownGround(ground, look.amplitudes(places.length))
        fits = look.fits(image, places, known)
        expected = look.expected(places.length, fits, known is not None)
        compared = flag_columns(fits, expected, look.misfit, look.sigma_px, look.in_part)
        return Columns(fits, *compared)

    def _measure(self, image: Grey, flat: Grey, ground: Ground | None, path: Floats) -> Centreline:
        """Measure the centreline along a path (m, 2) [m], before a known ground if there is one.

        `flat` is the image without the ground's structure.
        """
        places = stations(self.guide.pixels(path), image.shape)
        if places.size < THRESHOLDS.min_curve_points:
            return down_columns(np.empty((0, 2)), np.empty(0))
        course = self._course(image, flat, ground, places)
        if self.appearance.is_sampled and len(course.smooth):
            # Beside its middle, a profile of several lobes fits at wrong places, too.
            places = places.moved(course.smooth)
            course = self._course(image, flat, ground, places)
        columns, tip = course.columns, course.tip
        if not len(course.smooth):
            return down_columns(np.empty((0, 2)), np.empty(0))
        common_sigma, brightness, background = _summary(columns, places.upright)
        points, directions, sigma, rejected, reasons = _select(
            places, columns, course.smooth, course.on_beam, *image.shape
        )
        return Centreline(
            points=points,
            directions=directions,
            sigma=sigma,
            rejected=rejected,
            flags=reasons,
            tip=None if tip is None else tip.pixel,
            tip_covariance=None if tip is None else tip.covariance,
            common_sigma=math.hypot(common_sigma, self.appearance.second_line_sigma_px),
            remark=self._remark(brightness, background) if len(points) else "",
            grid_error=course.grid_error,
            lost_light=_lost_light(columns, self.appearance.misfit),
        )

    def _course(self, image: Grey, flat: Grey, ground: Ground | None, places: Stations) -> _Course:
        """Fit the columns at n stations, find the tip, and flag outliers from a smooth course."""
        columns = self._fit(image, places, ground)
        length_px = self.guide.length / self.guide.pixel
        tip = find_tip(flat, places, columns, self.appearance, self.guide)
        # A beam bent towards or away from the camera looks longer or shorter within these limits.
        if (
            tip is not None
            and not THRESHOLDS.min_length < tip.length / length_px < THRESHOLDS.max_length
        ):
            tip = None
        # The beam covers its last columns only in part.
        on_beam = places.length < (length_px if tip is None else tip.length - 1.5)
        grid_error = None
        if self.appearance.grid_period:
            columns, grid_error = self._without_grid_error(places, columns, on_beam)
        smooth = _flag_outliers(places, columns, on_beam)
        return _Course(columns, on_beam, tip, smooth, grid_error)

    def _without_grid_error(
        self, places: Stations, columns: Columns, on_beam: Mask
    ) -> tuple[Columns, GridError | None]:
        """Subtract the error that repeats with the pixel grid; only noise is left in the sigmas.

        The error is None where the centres cannot show it.
        """
        # Copies, whose sigmas are enlarged by this error.
        first = columns._replace(sigma=columns.sigma.copy(), flags=columns.flags.copy())
        smooth = _flag_outliers(places, first, on_beam)
        if not len(smooth):
            return columns, None
        centre, across = columns.fits.centre, places.start + places.sense * smooth
        used = on_beam & (columns.flags == 0)
        error = fit_grid_error(places, across, centre - across, used, self.appearance.grid_period)
        if error is None:
            return columns, None
        moved = places.upright == error.upright
        centre = centre - np.where(moved, error.at(places.along.astype(np.float64), across), 0.0)
        sigma = np.where(moved, columns.noise, columns.sigma)
        return columns._replace(fits=columns.fits._replace(centre=centre), sigma=sigma), error

    def _remark(self, beam: float, background: float) -> str:
        """Describe the change of brightness of beam and background since rest; "" if small."""
        appearance = self.appearance
        ratio = max(background, 1.0) / max(appearance.ground, 1.0)
        is_step = (
            abs(background - appearance.ground) > THRESHOLDS.min_light_step * appearance.full_scale
        )
        if (
            not (
                is_step and not 1 / THRESHOLDS.max_light_ratio < ratio < THRESHOLDS.max_light_ratio
            )
            and 1 / THRESHOLDS.max_light_ratio < beam < THRESHOLDS.max_light_ratio
        ):
            return ""
        return (
            f"this image differs from the rest images: background {ratio:.2g} times and beam "
            f"{beam:.2g} times as bright; has exposure, gain, gamma or light changed?"
        )


def _flag_outliers(places: Stations, columns: Columns, on_beam: Mask) -> Floats:
    """Flag outliers at n stations, and enlarge sigmas, in place; return the smooth course (n,).

    Its offsets are from the path along its normal: a beam that is read by columns first and then by
    rows remains one curve.
    """
    off_path = places.sense * (columns.fits.centre - places.start)
    smooth: Floats = fit_and_flag_outliers(
        places.length, off_path, columns.sigma, columns.brightness, on_beam, columns.flags
    )
    return smooth


def _lost_light(columns: Columns, misfit_at_rest: float) -> Floats:
    """Compute the share of its light that the beam lacks at each measured point (n,).

    It is relative to the typical one. Before a ground with structure, which also changes the
    contrast, it is not known, and 0.
    """
    good, fits = columns.flags == 0, columns.fits
    brightness: Floats = columns.brightness[good]
    misfit = fits.chi2[good] / np.maximum(fits.dof[good], 1)
    if not len(brightness) or median(misfit) > THRESHOLDS.max_misfit * misfit_at_rest:
        return np.zeros(len(brightness))
    medians = running_median(brightness, _SHADE_WIDTH)
    return np.asarray(np.maximum(1 - medians / median(medians), 0.0))


@njit
def _summary(columns: Columns, upright: Mask) -> tuple[float, float, float]:
    """Compute the sigma [px] of the points' mean error, and the median brightness and background.

    The error is the part that the sensor's noise does not explain. Such errors, mainly those of
    compression, follow the pixel grid: for a beam that crosses R pixel rows, or R columns where it
    is read by rows, not `upright` (n,), only R + 1 of them are independent.
    """
    good = columns.flags == 0
    if not good.any():
        return 0.0, 0.0, 0.0
    crossed = 1.0
    for side in (True, False):
        centre = columns.fits.centre[good & (upright == side)]
        if len(centre):
            crossed += centre.max() - centre.min()
    excess = median(np.maximum(columns.sigma[good] ** 2 - columns.noise[good] ** 2, 0.0))
    common_sigma = np.sqrt(excess / crossed)
    return common_sigma, median(columns.brightness[good]), median(columns.fits.background[good])


@njit
def _select(
    places: Stations, columns: Columns, smooth: Floats, on_beam: Mask, height: int, width: int
) -> Any:
    """Select the measured and the rejected points; return five fields of `Centreline`.

    A rejected column's point is the smooth course of the beam in it, if that is in the image.
    """
    n, n_good, n_rejected = len(smooth), _NONE, _NONE
    points, directions, sigma = np.empty((n, 2)), np.zeros((n, 2)), np.empty(n)
    rejected, reasons = np.empty((n, 2)), np.empty(n, np.uint8)
    for i in range(n):
        along, upright = places.along[i], places.upright[i]
        # The pixel's coordinates along the path and across it.
        u, v = (0, 1) if upright else (1, 0)
        if columns.flags[i] == 0:
            points[n_good, u], points[n_good, v] = along, columns.fits.centre[i]
            directions[n_good, v], sigma[n_good] = 1.0, columns.sigma[i]
            n_good += 1
            continue
        expected = places.start[i] + places.sense[i] * smooth[i]
        if on_beam[i] and -0.5 < expected < (height if upright else width) - 0.5:
            rejected[n_rejected, u], rejected[n_rejected, v] = along, expected
            reasons[n_rejected] = columns.flags[i]
            n_rejected += 1
    return (
        points[:n_good],
        directions[:n_good],
        sigma[:n_good],
        rejected[:n_rejected],
        reasons[:n_rejected],
    )


def learn_profile_fit(images: Sequence[Grey], guide: Guide) -> BeamExtractor:
    """Learn the beam from images (height, width) of it at rest. Raises InputError."""
    learned = learn_appearance(images, guide)
    return BeamExtractor(learned.appearance, learned.guide)
