"""The beam at rest, from its images: appearance, line, landmarks, noise and free end."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from solver.at_rest.agreement import Learn, agreeing_images
from solver.at_rest.landmarks import Landmarks, learn_landmarks
from solver.at_rest.rest_line import RestLine, fit_rest_line
from solver.at_rest.rest_points import without_grid_error
from solver.at_rest.thresholds import THRESHOLDS
from solver.calibrate import Calibration
from solver.centreline import Centreline
from solver.centreline.extractor import Extractor
from solver.centreline.guide import Guide
from solver.centreline.noise import Noise, estimate_noise
from solver.centreline.section_on_ground import NO_GROUND_ERRORS, GroundErrors
from solver.instrument.arrays import Floats, Grey
from solver.instrument.errors import InputError
from solver.instrument.grid_error import GridError
from solver.instrument.rig import Rig
from solver.instrument.units import DEGREE

# Margin [px] beside the beam without landmarks, for its immediate shadow.
BESIDE_PX = 3.0
# Lengths, over the stated one, at which a beam's free end is looked for. Chosen: an end is found if
# it is in the last quarter.
_OTHER_LENGTHS = (1.1, 1.3, 1.6, 2.0, 0.95, 0.75, 0.58, 0.45)
# Largest sigma [px] of an end that shows that the beam runs the other way. Chosen: a free end is
# known to a tenth of a pixel, and one of a beam that fades before a dark clamp to three pixels.
_SHARP_PX = 1.0
# End of the beam's path for the landmarks, beyond its tip, over its length.
BEYOND_TIP = 1.08


@dataclass(frozen=True)
class RestState:
    """The beam at rest: its extractor, its line, the landmarks about it, and its free end.

    `noise` is that of the gray values, `copies` counts the images that repeat another one,
    `rejected` holds the indices, among the distinct images, of those that disagree with the others.
    `tip` (2,) [px] is the image of the free end and `tip_covariance` (2, 2) [px^2] its covariance;
    None where it is not detected. Then `length_seen` [m] is the distance from the clamp to an end
    elsewhere, None where there is none either. `sigma_px` is the median one of a point. `lines` are
    the centrelines of the images that agree.
    """

    extract: Extractor
    line: RestLine
    landmarks: Landmarks
    noise: Noise
    tip: Floats | None
    tip_covariance: Floats | None
    copies: int
    rejected: tuple[int, ...]
    length_seen: float | None = None
    sigma_px: float = 0.0
    lines: tuple[Centreline, ...] = ()

    def without(self, error: GridError, calibration: Calibration, rig: Rig) -> "RestState":
        """Fit the line again to centrelines without an error that repeats with the pixel grid.

        A beam at rest hardly crosses the grid, so that such an error looks like a bow.
        """
        lines = [without_grid_error(line, error) for line in self.lines]
        of_ground = _ground_errors(self.extract)
        return replace(self, line=fit_rest_line(lines, calibration, rig, of_ground))


def learn_rest_state(
    images: Sequence[Grey], guide: Guide, learn: Learn, calibration: Calibration, rig: Rig
) -> RestState:
    """Learn the beam at rest from gray images (height, width) of it.

    `learn` makes the extractor. Raises InputError where the images show no beam, show it in
    different places, or with too little contrast to find its place.
    """
    used = agreeing_images(images, guide, learn)
    noise = estimate_noise(used.images)
    line = fit_rest_line(
        used.lines,
        calibration,
        rig,
        _ground_errors(used.extract),
        rows_alike=_rows_alike(used.extract, len(used.images)),
    )
    _check_direction(line, used.extract, used.images[0], used.lines[0], rig)
    width = 4 * guide.radius_px + 2 * BESIDE_PX
    tip, tip_covariance = _mean_tip(used.lines)
    return RestState(
        extract=used.extract,
        line=line,
        landmarks=learn_landmarks(used.images, _path(line, calibration, rig), width, noise),
        noise=noise,
        tip=tip,
        tip_covariance=tip_covariance,
        copies=used.copies,
        rejected=used.rejected,
        length_seen=_length_seen(used.extract, used.images[0]) if tip is None else None,
        sigma_px=float(np.median(np.concatenate([line.sigma for line in used.lines]))),
        lines=tuple(used.lines),
    )


def _length_seen(extract: Extractor, image: Grey) -> float | None:
    """Look for the free end [m] of a beam that is longer or shorter than the rig states."""
    detector = extract.detector
    if detector is None:
        return None
    for factor in _OTHER_LENGTHS:
        other = replace(detector.guide, length=factor * detector.guide.length)
        tip = replace(detector, guide=other)(image).tip
        if tip is not None:
            return float(other.places(tip[None])[0, 0])
    return None


def _ground_errors(extract: Extractor) -> GroundErrors:
    """Return the errors of the line by a ground that images without the beam show."""
    return (
        NO_GROUND_ERRORS if extract.detector is None else extract.detector.appearance.ground_errors
    )


def _rows_alike(extract: Extractor, images: int) -> bool:
    """Return whether errors of the beam at rest that repeat in all images are alike in all rows.

    They are where images are as a sensor takes them. A single image does not show whether it was
    processed.
    """
    if extract.detector is None or images < 2:
        return False
    return not extract.detector.appearance.grid_period


def _mean_tip(lines: Sequence[Centreline]) -> tuple[Floats | None, Floats | None]:
    """Average the tip's pixel and covariance; the grid's error is the same in all images."""
    tips = [line.tip for line in lines if line.tip is not None]
    covariances = [line.tip_covariance for line in lines if line.tip_covariance is not None]
    if 2 * len(tips) <= len(lines):
        return None, None
    return np.mean(tips, axis=0), np.mean(covariances, axis=0)


def _check_direction(
    rest: RestLine, extract: Extractor, image: Grey, line: Centreline, rig: Rig
) -> None:
    """Reject a beam that does not run from the rig's clamp along its x axis. Raises InputError."""
    key = "board.antenna_from_board_rotation_vector_deg"
    angle = math.atan(rest.slope)
    if abs(angle) > THRESHOLDS.max_misalignment and rig.camera_mount == "antenna":
        raise InputError(
            f"the beam at rest is at {angle / DEGREE:.1f} degrees to the rig's x axis, allowed "
            f"are {THRESHOLDS.max_misalignment / DEGREE:.0f}: correct the third number of {key}, "
            "or the origin, base.position_mm"
        )
    detector = extract.detector
    if line.tip is None and detector is not None:
        turned = detector.guide.turned_about()
        end = replace(detector, guide=turned)(image)
        if end.tip is None or end.tip_covariance is None:
            return
        # A clamp's edge may look like a tip: the tip is sharp, and at the beam's length, within
        # three sigmas.
        tolerance = rig.tolerances
        along = np.diff(turned.ends, axis=0)[0]
        along /= math.hypot(*along)
        if along @ end.tip_covariance @ along > _SHARP_PX**2:
            return
        along *= turned.pixel
        sigma = math.hypot(
            tolerance.beam_length,
            tolerance.base_position,
            tolerance.board_translation,
            tolerance.tip,
            math.sqrt(along @ end.tip_covariance @ along),
        )
        if abs(turned.places(end.tip[None])[0, 0] - turned.length) < 3 * sigma:
            raise InputError(
                "the beam's free end is at the clamp's position in rig.json: the rig's x axis "
                f"runs from the clamp to the tip, so turn {key} by 180 degrees about z and "
                "correct board.antenna_from_board_translation_mm; or the images are mirrored, "
                "which a board without markers does not show: switch that off in the camera"
            )


def _path(rest: RestLine, calibration: Calibration, rig: Rig) -> Floats:
    """Compute pixels (n, 2) of the beam at rest, from its clamp to beyond its tip."""
    x = np.linspace(0.0, BEYOND_TIP * rig.beam.length, 100)
    y = rest.y_at_clamp + rest.slope * x + rest.bow_at(np.minimum(x, rest.length))[0]
    points = np.column_stack([rig.base_position[0] + x, y, np.zeros_like(x)])
    return calibration.camera.project(points)
