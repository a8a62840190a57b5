"""Appearance of the beam at rest: polarity, width and shading, learned from the rest images."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from solver.centreline.bare_ground import BareGround, GroundAtRest
from solver.centreline.effective_profile import (
    EffectiveProfile,
    effective_profile,
    read_columns,
)
from solver.centreline.flags import Expected
from solver.centreline.ground import Ground, learn_ground
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise, estimate_noise, mean_image
from solver.centreline.pixel_grid import grid_period
from solver.centreline.profile import (
    Profile,
    Section,
    contrast_before,
    own_light,
    tilt_response,
)
from solver.centreline.profile_fit import MARGIN, Fits, KnownGround, fit_profiles
from solver.centreline.rest_columns import RestColumns, Shape, check_count, shape_of
from solver.centreline.rest_detection import RestDetection, find_rest_line
from solver.centreline.second_line import describe
from solver.centreline.section_on_ground import (
    NO_GROUND_ERRORS,
    GroundErrors,
    section_on_ground,
)
from solver.centreline.section_search import find_in_own_light, find_sections
from solver.centreline.stations import Stations, stations
from solver.centreline.thresholds import THRESHOLDS
from solver.centreline.two_faces import Faces, Strip, fit_faces, learn_faces
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.transforms import turn_about_z

# Trial widths, times the rig's diameter: a round beam looks wider out of focus, and a flat strip is
# wider than it is thick. A round beam with its soft shadow also looks like a wide strip.
WIDTHS, FLAT_WIDTHS = (1, 2), (1, 2, 4, 8)
# Pixels beside the beam that its image covers, before its section is known. Chosen: a sharp image.
FIRST_REACH_PX = 2.0
# How far the tip may be beyond the stated length, over it: up to there, pixels may show the beam,
# not the ground. Chosen: rulers and wire cutters are better.
TIP_MARGIN = 0.01
# Largest distance [px] of the beam from the path along which its section is searched for. Chosen:
# from 0.6 px on, fits of a sharp profile to a beam of one pixel ended at wrong places.
FAR_PX = 0.3
# How often the ground under a beam is interpolated again across its own width. Measured: with an
# edge two pixels beside a thin beam, the first width was 12 % too large, and the next one 6 %.
NARROWER = 2
# Least light of a beam, over that of the ground that it hides, to which a change of its light is
# compared. Chosen: a black beam reflects a twentieth.
MIN_LIGHT = 0.2


class _Described(NamedTuple):
    """The columns of the rest images along a path (m, 2) [px], and the profiles of the beam.

    Of the `shapes` of sections, the best one is first; there are none where no section shows the
    beam. The `sampled` profile is None where it is seen in part or not at all.
    """

    rest: RestColumns
    path: Floats
    shapes: list[Shape]
    sampled: Profile | None


@dataclass(frozen=True)
class Appearance:
    """Appearance of the beam, learned from the rest images.

    `polarity` is 1 for a beam brighter than its background and -1 for a darker one; `amplitude`
    [gray px] is given along `length` [px] of the path; `misfit` is the typical chi^2 per degree of
    freedom of a profile fit, at least 1; `sigma_px` is the part of a centre's error that does not
    come from the sensor's noise; `ground` is the background's median gray value. `half` pixels on
    either side are fitted. `radius` [px] is that of the rig for a round beam: the section's follows
    the profile, in which shading and edges of a dark beam are alike. `ground_at_rest` is None for a
    ground without structure; `bare_ground` is what images without the beam show of it, None where
    there are none; `ground_errors` are those by the ground at rest. A profile that `is_sampled` is
    that of the images, not that of the section; one that is `in_part` was seen at some places
    between the pixels only. `second_line` describes a line beside the beam, "" if there is none,
    and `second_line_sigma_px` is that of the error by which it moves all of the beam. `faces` are
    those of a flat strip that shows two. `grid_period` [px] is that of the grid on which the images
    were processed, 0 for raw ones. Where grounds differ, or the contrast has either sign,
    `own_light` [gray px] is given along `length`, and the profile is that of this light; else None.
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
    radius: float
    full_scale: int
    ground_at_rest: Ground | None = None
    ground_errors: GroundErrors = NO_GROUND_ERRORS
    bare_ground: GroundAtRest | None = None
    is_sampled: bool = False
    in_part: bool = False
    second_line: str = ""
    second_line_sigma_px: float = 0.0
    faces: Faces | None = None
    grid_period: int = 0
    own_light: Floats | None = None

    def fits(self, image: Grey, places: Stations, known: KnownGround | None = None) -> Fits:
        """Fit the columns of an image (height, width), before a known ground if there is one."""
        fits = fit_profiles(
            image, places, self.profile, self.noise, self.half, self.full_scale, known
        )
        if self.faces is None:
            return fits
        start = np.where(np.isfinite(fits.sigma), fits.centre, places.start)
        places = places._replace(start=start)
        edges = fit_faces(image, places, self.faces, self.noise, self.half, self.full_scale)
        return Fits(*edges.fits)

    def amplitudes(self, length: Floats) -> Floats:
        """Return the amplitudes (n,) at rest at n places along the path [px]."""
        return np.interp(length, self.length, self.amplitude)

    def expected(self, length: Floats, fits: Fits, knows_ground: bool) -> Expected:
        """Compute the amplitudes (n,) that the beam at rest has before the ground of an image.

        `length` (n,) [px] are the places of the fits. The beam's own light has changed by one
        factor everywhere. A beam that is as bright as the mean of a ground is seen by what it hides
        of its structure, where the fit `knows_ground`.
        """
        if self.own_light is None:
            amplitude = self.amplitudes(length)
            return Expected(amplitude, np.abs(amplitude), 0.0)
        hidden = 2 * self.section.radius * fits.background
        light = np.interp(length, self.length, self.own_light)
        shown = np.isfinite(fits.sigma)
        if shown.any():
            now, before = (float(np.median(v[shown])) for v in (fits.amplitude + hidden, light))
            # The light of a black beam is noise.
            least = MIN_LIGHT * float(np.median(hidden[shown]))
            light *= 1 + (now - before) / max(before, least, 1e-9)
        amplitude = light - hidden
        largest = self.section.resolution if knows_ground else 0.0
        return Expected(amplitude, np.maximum(np.abs(amplitude), light), largest)

    @property
    def shading(self) -> float:
        """Weight of the beam's own shading in the middle of its contrast with the ground."""
        return shading_weight(self._amplitude, self.radius, self.ground)

    @property
    def knows_section(self) -> bool:
        """Whether the section describes the images, so that its width is that of the beam."""
        return not self.is_sampled and self.misfit <= THRESHOLDS.max_section_misfit

    @cached_property
    def fit_response(self) -> float:
        """Shift of a profile fit by the beam's shading, over that of the contrast's middle."""
        beside = self.noise.dark + self.noise.per_gray * self.ground
        on_beam = self.noise.per_gray * max(self._amplitude, 0.0)
        weights = np.array([beside, on_beam])
        table = self.before(self._amplitude, self.ground)
        return tilt_response(table, self.section, weights, self.half)

    def before(self, amplitude: float, ground: float) -> Profile:
        """Return the profile of the contrast with a `ground` [gray], of this `amplitude`."""
        return contrast_before(self.profile, amplitude / (2 * self.section.radius), ground)

    @cached_property
    def _amplitude(self) -> float:
        return self.polarity * float(np.median(np.abs(self.amplitude)))


def shading_weight(amplitude: float, radius: float, ground: float) -> float:
    """Compute the weight of the beam's own shading in the middle of its contrast with the ground.

    It is the beam's mean gray value over its contrast: 1 before a black ground, more before a gray
    one, and negative for a beam that is darker than its ground. `amplitude` [gray px] is the
    contrast's integral across the beam, `radius` [px] that of the beam, `ground` its gray value.
    """
    contrast = amplitude / (2 * radius)
    return (contrast + ground) / contrast


class Learned(NamedTuple):
    """What the rest images show: the beam's `appearance`, and the `guide` turned to the beam."""

    appearance: Appearance
    guide: Guide


def learn_appearance(images: Sequence[Grey], guide: Guide) -> Learned:
    """Learn the beam's appearance, and turn the guide to the beam's direction at rest.

    Raises InputError where no beam is found along the rig's x axis.
    """
    noise = estimate_noise(images)
    mean = mean_image(images)
    full_scale = guide.full_scale or int(np.iinfo(images[0].dtype).max)
    bare = None
    if guide.bare_ground is not None:
        bare = guide.bare_ground.at_rest(mean, noise, len(images))
    known = None if bare is None else bare.ground
    line = _find_line(mean, guide, known)
    tilt = guide.strip_tilt
    strip = None if tilt is None else Strip(2 * guide.radius_px, tilt)
    stated = None if strip is not None else guide.radius_px
    guide = replace(guide, radius=line.width * guide.radius)
    on_beam = line.places[(line.places[:, 0] > 0) & (line.places[:, 0] < 0.98 * guide.length)]
    path, beam = guide.pixels(on_beam), _to_the_tip(line.places, guide)
    places = stations(path, mean.shape)
    check_count(places.size)
    second_line = "" if line.second is None else describe(line.second, guide)
    clear = math.inf if line.second is None else line.second.clear_px
    needed = math.ceil(guide.radius_px + FIRST_REACH_PX) + 1
    overlap = 0.0 if line.second is None or clear >= needed else abs(line.second.contrast)
    moved_px = 0.0
    apart = max(clear, needed)
    rest = RestColumns(images, places, noise, line.polarity, guide.radius_px, full_scale, apart)
    reach = guide.radius_px + FIRST_REACH_PX
    half = int(reach + 0.5) + MARGIN
    ground = learn_ground(images, beam, reach, noise, half, known)
    if ground is not None:
        # A nearer line is a part of the ground. What is left moves the beam alike at rest and bent.
        look = _look_before(rest, ground, half, beam, stated)
    elif overlap > THRESHOLDS.max_overlap_contrast:
        raise InputError(
            f"{second_line}; it begins {clear:.1f} px from the beam's axis, needed are {needed}"
        )
    else:
        moved_px = THRESHOLDS.overlap_sigma_px * overlap
        described = _along_the_beam(rest, path, line.either_sign and strip is None)
        path = described.path
        look = _look(described, stated, strip)
    x, y = guide.places(path).T
    slope = float(np.polyfit(x, y, 1)[0])
    antenna_from_beam = guide.antenna_from_beam @ turn_about_z(np.arctan(slope))
    if look.sigma_px > THRESHOLDS.max_scatter_px:
        raise InputError(
            f"the columns of the beam at rest scatter by {look.sigma_px:.1f} px about a smooth "
            f"curve, allowed is {THRESHOLDS.max_scatter_px:g}: the ground's structure hides the "
            "beam"
        )
    radius = look.section.radius * guide.pixel
    look = replace(
        look,
        second_line=second_line,
        second_line_sigma_px=moved_px,
        grid_period=grid_period(images, noise),
    )
    guide = replace(guide, antenna_from_beam=antenna_from_beam, radius=radius)
    if bare is None:
        return Learned(look, guide)
    # The images of the ground are kept once: `ground_at_rest` has what is used of them.
    look = replace(look, bare_ground=bare._replace(ground=None))
    return Learned(look, replace(guide, bare_ground=None))


def _find_line(mean: Floats, guide: Guide, ground: BareGround | None) -> RestDetection:
    """Find the beam in the mean image (height, width) of it at rest, before a `ground` if known.

    Raises InputError where no beam is found along the rig's x axis.
    """
    widths = WIDTHS if guide.strip_psi is None else FLAT_WIDTHS
    flat = mean if ground is None else mean - ground.gray + np.median(ground.gray)
    line = find_rest_line(flat, guide, widths)
    if line is not None:
        return line
    if ground is not None and find_rest_line(mean, guide, widths) is not None:
        raise InputError(
            "the images in ground/ show the beam where it is at rest: take them before it is "
            "mounted, or remove them"
        )
    raise InputError(
        "the rest images show no beam along the rig's x axis: if they show one elsewhere, the "
        "origin is wrong (base.position_mm, board.antenna_from_board_translation_mm)"
    )


def _sampled(rest: RestColumns) -> EffectiveProfile | None:
    """Sample the profile along the path, and the beam's distance (n,) from it.

    Return None if too few columns are within the image and below full scale.
    """
    half = rest.half_width(_nominal(rest))
    columns = read_columns(rest.images, rest.places, half, rest.noise, rest.full_scale)
    sampled = effective_profile(columns, half - MARGIN, rest.polarity)
    if sampled is None:
        return None
    off_path = np.interp(rest.places.length, columns.length, sampled.off_path)
    return EffectiveProfile(sampled.table, off_path)


def _nominal(rest: RestColumns) -> Section:
    """Return the rig's section, which extends FIRST_REACH_PX further in the image."""
    return Section(rest.radius, FIRST_REACH_PX / 3, 0.0, 0.0)


def _look(described: _Described, radius: float | None, strip: Strip | None) -> Appearance:
    """Estimate the section that gives the smoothest centres and the smallest residuals.

    Where the section leaves more than noise, the sampled profile may take its place. `radius` [px]
    is the rig's, None for a flat `strip`, of which two faces may be seen.
    """
    rest, _, shapes, sampled = described
    shape, others = (shapes[0], shapes[1:]) if shapes else (None, [])
    if sampled is not None and (shape is None or shape.misfit > THRESHOLDS.max_section_misfit):
        other = rest.shape(_nominal(rest), sampled)
        if shape is None or other.course_sigma < shape.course_sigma:
            shape = other
    if shape is None:
        raise InputError("the rest images show no beam of the rig's diameter")
    seen = None if strip is None else learn_faces(rest, shape, strip)
    if seen is not None:
        shape, others = seen.shape, []
    fits, good = shape.fits, shape.good
    amplitude = np.mean([f.amplitude for f in fits], axis=0)[good]
    background = np.mean([f.background for f in fits], axis=0)[good]
    hidden = 2 * shape.section.radius * background
    # What is not known of the section moves all centres at rest alike.
    unknown = [float(np.median(np.abs(shape.centre - other.centre)[good])) for other in others]
    look = _described_by(
        shape,
        rest,
        amplitude=_without_noise(amplitude),
        noise_variance=float(np.mean([f.sigma[good] ** 2 for f in fits])) / len(fits),
        ground=float(np.median([np.median(f.background[good]) for f in fits])),
        radius=radius,
    )
    return replace(
        look,
        sigma_px=math.hypot(look.sigma_px, *unknown),
        is_sampled=seen is None and sampled is not None and shape.table is sampled,
        in_part=rest.in_part,
        faces=None if seen is None else seen.faces,
        own_light=None if shape.table.cover is None else _without_noise(amplitude + hidden),
    )


def _without_noise(amplitude: Floats) -> Floats:
    """Replace the amplitudes (n,) of columns, which have noise, by their local medians."""
    return np.asarray(median_filter(amplitude, 21, mode="nearest"))


def _described_by(
    shape: Shape,
    rest: RestColumns,
    *,
    amplitude: Floats,
    noise_variance: float,
    ground: float,
    radius: float | None,
) -> Appearance:
    """Describe the beam by its shape, and by the `amplitude` (n,) of its good columns.

    `noise_variance` [px^2] is the part of the centres' scatter that comes from noise, `ground` the
    gray value beside the beam, and `radius` [px] the rig's, None for a flat strip.
    """
    return Appearance(
        polarity=rest.polarity,
        noise=rest.noise,
        section=shape.section,
        profile=shape.table,
        amplitude=amplitude,
        length=rest.places.length[shape.good],
        misfit=max(1.0, shape.misfit),
        sigma_px=math.sqrt(max(shape.scatter**2 - noise_variance, 0.0)),
        ground=ground,
        half=rest.half_width(shape.section),
        radius=radius or shape.section.radius,
        full_scale=rest.full_scale,
    )


def _along_the_beam(rest: RestColumns, path: Floats, either_sign: bool) -> _Described:
    """Describe the profile in the rest images along a path (m, 2) [px] that follows the beam.

    A beam whose contrast is of `either_sign` is described by its own light, and so are others
    before grounds that differ. A section that does not describe the beam does not know what of the
    ground it hides.
    """
    if either_sign:
        described = _searched(replace(rest, own_light=True), path)
        if described.shapes:
            return described
    sampled, table = _sampled(rest), None
    if sampled is not None:
        path = _moved(path, rest.places, sampled.off_path)
        rest = rest.along(path)
        table = None if rest.in_part else sampled.table
    described = _searched(rest, path)
    in_own_light = _in_own_light(described)
    return in_own_light or described._replace(sampled=table)


def _searched(rest: RestColumns, path: Floats) -> _Described:
    """Search for sections, and where the beam is far from the path, once more along the beam.

    It is so at the thin end of a tapered beam.
    """
    shapes = _shapes(rest)
    off_path = _off_path(rest, shapes)
    if np.abs(off_path).max() > FAR_PX:
        path = _moved(path, rest.places, off_path)
        rest = rest.along(path)
        shapes = _shapes(rest)
    return _Described(rest, path, shapes, None)


def _off_path(rest: RestColumns, shapes: Sequence[Shape]) -> Floats:
    """Compute how far (n,) [px] the beam is from the path; 0 where no section describes it.

    Beyond the columns that show the beam, it is as far as in the last one.
    """
    length = rest.places.length
    if not shapes or shapes[0].misfit > THRESHOLDS.max_section_misfit:
        return np.zeros(len(length))
    good = shapes[0].good
    return np.interp(length, length[good], rest.smooth(shapes[0].centre, good)[good])


def _in_own_light(described: _Described) -> _Described | None:
    """Describe the beam by its own light; None where its contrast describes it as well."""
    rest, path, shapes, _ = described
    own = replace(rest, own_light=True)
    found = _shapes_of(find_in_own_light(rest, shapes), own) if shapes else []
    if not found or found[0].misfit > THRESHOLDS.max_section_misfit:
        return None
    return _Described(own, path, found, None)


def _shapes(rest: RestColumns) -> list[Shape]:
    """Describe the profile by sections, the best one first; none where none shows the beam."""
    return _shapes_of(find_sections(rest), rest)


def _shapes_of(sections: Sequence[Section], rest: RestColumns) -> list[Shape]:
    """Describe the profile by those sections that show the beam."""
    shapes = []
    for section in sections:
        with suppress(InputError):
            shapes.append(rest.shape(section, rest.table(section)))
    return shapes


def _look_before(
    rest: RestColumns, ground: Ground, half: int, beam: Floats, radius: float | None
) -> Appearance:
    """Describe the beam before a ground with structure; `beam` (n, 2) [px] is its path."""
    mean, n = mean_image(rest.images), len(rest.images)
    variance = rest.noise.variance(mean) / n
    found = None
    for _ in range(1 if ground.bare_images else 1 + NARROWER):
        if found is not None:
            # With the beam's own width, less of the ground is unknown.
            half = rest.half_width(found.section)
            reach = found.section.reach
            ground = learn_ground(rest.images, beam, reach, rest.noise, half) or ground
        found = section_on_ground(mean, variance, n, rest.places, rest.radius, half, ground, found)
        beam = _moved(beam, rest.places, found.off_path)
        rest = replace(rest, places=rest.places.moved(found.off_path))
    assert found is not None
    section, half = found.section, rest.half_width(found.section)
    table = own_light(section)
    fits = rest.fits(table, half, KnownGround(ground, found.amplitude))
    good = np.all([np.isfinite(f.sigma) for f in fits], axis=0)
    centre = rest.off_path(fits)
    course = np.zeros_like(centre)
    shape = shape_of(section, table, fits, centre, good, course)
    if shape.misfit > THRESHOLDS.max_section_misfit:
        # A section that does not describe the beam does not know its light.
        light = None
        good &= found.amplitude * rest.polarity > 0
        shape = shape_of(section, table, fits, centre, good, course)
    else:
        light = (found.amplitude + 2 * section.radius * ground.level)[good]
    look = _described_by(
        shape,
        rest,
        amplitude=found.amplitude[good],
        # The error of the interpolated ground is the same in all images. Where it is like the beam,
        # a sigma may be of any size.
        noise_variance=float(np.median([f.sigma[good] for f in fits])) ** 2,
        ground=ground.level,
        radius=radius,
    )
    return replace(
        look,
        ground_at_rest=ground,
        ground_errors=found.ground_errors,
        own_light=light,
    )


def _to_the_tip(places: Floats, guide: Guide) -> Floats:
    """Compute the pixels (n, 2) of a path from the clamp to beyond the tip, wherever it is."""
    x = np.linspace(0.0, (1 + TIP_MARGIN) * guide.length, 50)
    return guide.pixels(np.column_stack([x, np.interp(x, *places.T)]))


def _moved(beam: Floats, places: Stations, off_path: Floats) -> Floats:
    """Move a path (m, 2) [px] with its n stations, by `off_path` (n,) along its normal."""
    upright = 2 * np.count_nonzero(places.upright) >= places.size
    used = places.upright == upright
    order = np.argsort(places.along[used])
    axis = 0 if upright else 1
    across = (places.sense * off_path)[used][order]
    moved = np.array(beam)
    moved[:, 1 - axis] += np.interp(beam[:, axis], places.along[used][order], across)
    return moved
