"""Appearance of the beam at rest: polarity, width and shading, learned from the rest images."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import median_filter

from solver.centreline.effective_profile import (
    EffectiveProfile,
    effective_profile,
    read_columns,
)
from solver.centreline.ground import Ground, learn_ground
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise, estimate_noise
from solver.centreline.profile import Profile, Section, profile, tilt_response
from solver.centreline.profile_fit import MARGIN, KnownGround
from solver.centreline.rest_columns import RestColumns, Shape, check_count
from solver.centreline.rest_detection import find_rest_line
from solver.centreline.second_line import SecondLine
from solver.centreline.section_on_ground import section_on_ground
from solver.centreline.section_search import find_sections
from solver.centreline.stations import Stations, stations
from solver.centreline.thresholds import THRESHOLDS
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.medians import SIGMA_OVER_MAD
from solver.instrument.transforms import turn_about_z

# Trial widths, times the rig's diameter: a round beam looks wider out of focus, and a flat strip is
# wider than it is thick. A round beam with its soft shadow also looks like a wide strip.
WIDTHS, FLAT_WIDTHS = (1, 2), (1, 2, 4, 8)
# Pixels beside the beam that its image covers, before its section is known. Chosen: a sharp image.
FIRST_REACH_PX = 2.0


@dataclass(frozen=True)
class Appearance:
    """Appearance of the beam, learned from the rest images.

    `polarity` is 1 for a beam brighter than its background and -1 for a darker one; `amplitude`
    [gray px] is given along `length` [px] of the path; `misfit` is the typical chi^2 per degree of
    freedom of a profile fit, at least 1; `sigma_px` is the part of a centre's error that does not
    come from the sensor's noise; `ground` is the background's median gray value. `half` pixels on
    either side are fitted. `radius` [px] is that of the rig for a round beam: the section's follows
    the profile, in which shading and edges of a dark beam are alike. `ground_at_rest` is None for a
    ground without structure. A profile that `is_sampled` is that of the images, not that of the
    section; one that is `in_part` was seen at some places between the pixels only. `second_line`
    describes a line beside the beam, "" if there is none, and `second_line_sigma_px` is that of the
    error by which it moves all of the beam.
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
    is_sampled: bool = False
    in_part: bool = False
    second_line: str = ""
    second_line_sigma_px: float = 0.0

    @property
    def shading(self) -> float:
        """Weight of the beam's own shading in the middle of its contrast with the ground."""
        return shading_weight(self._amplitude, self.radius, self.ground)

    @cached_property
    def fit_response(self) -> float:
        """Shift of a profile fit by the beam's shading, over that of the contrast's middle."""
        beside = self.noise.dark + self.noise.per_gray * self.ground
        on_beam = self.noise.per_gray * max(self._amplitude, 0.0)
        weights = np.array([beside, on_beam])
        return tilt_response(self.profile, self.section, weights, self.half)

    @cached_property
    def _amplitude(self) -> float:
        return float(np.median(self.amplitude))


def shading_weight(amplitude: float, radius: float, ground: float) -> float:
    """Compute the weight of the beam's own shading in the middle of its contrast with the ground.

    It is the beam's mean gray value over its contrast: 1 before a black ground, more before a gray
    one, and negative for a beam that is darker than its ground. `amplitude` [gray px] is the
    contrast's integral across the beam, `radius` [px] that of the beam, `ground` its gray value.
    """
    contrast = amplitude / (2 * radius)
    return (contrast + ground) / contrast


def learn_appearance(images: Sequence[Grey], guide: Guide) -> tuple[Appearance, Guide]:
    """Learn the beam's appearance, and turn the guide to the beam's direction at rest.

    Raises InputError where no beam is found along the rig's x axis.
    """
    noise = estimate_noise(images)
    mean = np.mean([np.asarray(image, np.float64) for image in images], axis=0)
    full_scale = guide.full_scale or int(np.iinfo(images[0].dtype).max)
    line = find_rest_line(mean, guide, FLAT_WIDTHS if guide.flat else WIDTHS)
    if line is None:
        raise InputError(
            "the rest images show no beam along the rig's x axis: if they show one elsewhere, the "
            "origin is wrong (base.position_mm, board.antenna_from_board_translation_mm)"
        )
    stated = None if guide.flat else guide.radius_px
    guide = replace(guide, radius=line.width * guide.radius)
    on_beam = line.places[(line.places[:, 0] > 0) & (line.places[:, 0] < 0.98 * guide.length)]
    path, beam = guide.pixels(on_beam), _to_the_tip(line.places, guide)
    places = stations(path, mean.shape)
    if places.size < THRESHOLDS.min_stations:
        raise InputError(
            f"the rest images show {places.size} columns of the beam, "
            f"needed are {THRESHOLDS.min_stations}"
        )
    second_line = "" if line.second is None else _sentence(line.second, guide)
    clear = math.inf if line.second is None else line.second.clear_px
    needed = math.ceil(guide.radius_px + FIRST_REACH_PX) + 1
    overlap = 0.0 if line.second is None or clear >= needed else abs(line.second.contrast)
    moved_px = 0.0
    apart = max(clear, needed)
    rest = RestColumns(images, places, noise, line.polarity, guide.radius_px, full_scale, apart)
    reach = guide.radius_px + FIRST_REACH_PX
    ground = learn_ground(images, beam, reach, noise, int(reach + 0.5) + MARGIN)
    if ground is not None:
        # A nearer line is a part of the ground. What is left moves the beam alike at rest and bent.
        look = _look_before(rest, ground, beam, stated)
    elif overlap > THRESHOLDS.max_overlap_contrast:
        raise InputError(
            f"{second_line}; it begins {clear:.1f} px from the beam's axis, needed are {needed}"
        )
    else:
        moved_px = THRESHOLDS.overlap_sigma_px * overlap
        sampled, table = _sampled(rest), None
        if sampled is not None:
            path = _moved(path, places, places.sense * sampled.off_path)
            rest = replace(rest, places=stations(path, mean.shape))
            table = None if rest.in_part else sampled.table
        look = _look(rest, table, stated)
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
    look = replace(look, second_line=second_line, second_line_sigma_px=moved_px)
    return look, replace(guide, antenna_from_beam=antenna_from_beam, radius=radius)


def _sentence(second: SecondLine, guide: Guide) -> str:
    """Describe a line beside the beam by its distance, side and contrast, with what to do."""
    across = guide.pixel * second.offset
    here, there = guide.pixels(np.array([[0.5 * guide.length, 0.0], [0.5 * guide.length, across]]))
    right, down = there - here
    if abs(down) >= abs(right):
        side = "below" if down > 0 else "above"
    else:
        side = "right of" if right > 0 else "left of"
    return (
        f"the rest images show a second line parallel to the beam, {abs(second.offset):.0f} px "
        f"{side} it, with {abs(second.contrast):.2g} times its contrast: a shadow, a reflection or "
        "another wire; remove it, or move the lamp or the ground"
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


def _look(rest: RestColumns, sampled: Profile | None, radius: float | None) -> Appearance:
    """Estimate the section that gives the smoothest centres and the smallest residuals.

    Where the section leaves more than noise, the `sampled` profile may take its place. `radius`
    [px] is the rig's, None for a flat strip.
    """
    shapes = _described(rest)
    shape, others = (shapes[0], shapes[1:]) if shapes else (None, [])
    if sampled is not None and (shape is None or shape.misfit > THRESHOLDS.max_section_misfit):
        other = rest.shape(_nominal(rest), sampled)
        if shape is None or other.course_sigma < shape.course_sigma:
            shape = other
    if shape is None:
        raise InputError("the rest images show no beam of the rig's diameter")
    fits, good = shape.fits, shape.good
    noise_variance = float(np.mean([f.sigma[good] ** 2 for f in fits])) / len(fits)
    amplitude = np.mean([f.amplitude for f in fits], axis=0)
    # What is not known of the section moves all centres at rest alike.
    unknown = [float(np.median(np.abs(shape.centre - other.centre)[good])) for other in others]
    excess = max(shape.scatter**2 - noise_variance, 0.0)
    return Appearance(
        polarity=rest.polarity,
        noise=rest.noise,
        section=shape.section,
        profile=shape.table,
        # The median filter removes the noise of single columns.
        amplitude=median_filter(amplitude[good], 21, mode="nearest"),
        length=rest.places.length[good],
        misfit=max(1.0, shape.misfit),
        sigma_px=math.hypot(math.sqrt(excess), *unknown),
        ground=float(np.median([np.median(f.background[good]) for f in fits])),
        half=rest.half_width(shape.section),
        radius=radius or shape.section.radius,
        full_scale=rest.full_scale,
        is_sampled=sampled is not None and shape.table is sampled,
        in_part=rest.in_part,
    )


def _described(rest: RestColumns) -> list[Shape]:
    """Describe the profile by sections, the best one first; none where none shows the beam."""
    shapes = []
    for section in find_sections(rest):
        with suppress(InputError):
            shapes.append(rest.shape(section, rest.table(section)))
    return shapes


def _look_before(
    rest: RestColumns, ground: Ground, beam: Floats, radius: float | None
) -> Appearance:
    """Estimate the section before a ground with structure; `beam` (n, 2) [px] is its path."""
    mean = np.mean([np.asarray(image, np.float64) for image in rest.images], axis=0)
    variance = rest.noise.variance(mean) / len(rest.images)
    half = int(rest.radius + FIRST_REACH_PX + 0.5) + MARGIN
    look = section_on_ground(mean, variance, rest.places, rest.radius, half, ground)
    # With the beam's own width, less of the ground is unknown.
    section, off_path = look.section, rest.places.sense * look.off_path
    places = rest.places._replace(start=rest.places.start + off_path)
    reach = section.radius + 2.5 * section.spread + 0.5
    half = rest.half_width(section)
    moved = _moved(beam, rest.places, off_path)
    ground = learn_ground(rest.images, moved, reach, rest.noise, half) or ground
    table = profile(section)
    fits = replace(rest, places=places).fits(table, half, KnownGround(ground, look.amplitude))
    good = np.all([np.isfinite(f.sigma) for f in fits], axis=0)
    good &= look.amplitude * rest.polarity > 0
    check_count(good)
    residual = np.mean([f.centre for f in fits], axis=0)[good] - places.start[good]
    # The error of the interpolated ground is the same in all images. Where it is like the beam,
    # a sigma may be of any size.
    variance_px = float(np.median([f.sigma[good] for f in fits])) ** 2
    scatter = (SIGMA_OVER_MAD * np.median(np.abs(residual))) ** 2
    return Appearance(
        polarity=rest.polarity,
        noise=rest.noise,
        section=section,
        profile=table,
        amplitude=look.amplitude[good],
        length=rest.places.length[good],
        misfit=max(1.0, float(np.median([f.chi2[good] / f.dof[good] for f in fits]))),
        sigma_px=float(np.sqrt(max(scatter - variance_px, 0.0))),
        ground=ground.level,
        half=half,
        radius=radius or section.radius,
        full_scale=rest.full_scale,
        ground_at_rest=ground,
    )


def _to_the_tip(places: Floats, guide: Guide) -> Floats:
    """Compute the pixels (n, 2) of a path from the clamp to the tip."""
    x = np.linspace(0.0, guide.length, 50)
    return guide.pixels(np.column_stack([x, np.interp(x, *places.T)]))


def _moved(beam: Floats, places: Stations, off_path: Floats) -> Floats:
    """Move a path (m, 2) [px] with its stations, by `off_path` (n,) across their columns."""
    upright = 2 * np.count_nonzero(places.upright) >= places.size
    used = places.upright == upright
    order = np.argsort(places.along[used])
    axis = 0 if upright else 1
    moved = np.array(beam)
    moved[:, 1 - axis] += np.interp(beam[:, axis], places.along[used][order], off_path[used][order])
    return moved
