"""Consistency checks of a rig before use: board views and rest images against rig.json."""

import contextlib
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from solver.antenna import Antenna
from solver.at_rest.landmarks import FARTHEST
from solver.calibrate.uncertainty import calibration_uncertainty
from solver.core.thresholds import THRESHOLDS
from solver.fitting.first_contact import nearest_linear_bend
from solver.instrument.arrays import Grey
from solver.instrument.board import Charuco
from solver.instrument.errors import InputError
from solver.instrument.image_frame import ImageFrame
from solver.instrument.observation import CHECKED_FRAMES
from solver.instrument.units import DEGREE, MILLIMETRE, NEWTON_SQUARE_MILLIMETRE
from solver.to_measurement import to_measurement
from solver.tracker import extract_centreline

# Two values that differ by more than this number of their combined sigmas are a finding.
CONTRADICTION = 3.0
# Share of the stated sag by which the bow at rest may differ from it. Chosen: a diameter that is
# off by 5 % changes EI by 20 %.
SAG_TOLERANCE = 0.2
# Offset and slope, over its tip's sag and the length, of the line of least squares through a sag of
# (6 s^2 - 4 s^3 + s^4) / 3. Derived.
SAG_OFFSET, SAG_SLOPE = -2 / 15, 16 / 15


# Factor by which the beam's width in the rest images may differ from the stated one, beside a
# pixel. Chosen: blur and gloss change it by less.
WIDTH_FACTOR = 1.5
# Young's modulus [Pa] of the softest and the stiffest beam: rubber, and diamond.
SOFTEST, STIFFEST = 1e6, 1.2e12


class Finding(NamedTuple):
    """Result of a check: a short `name` for programs, and a `message` with cause and remedy."""

    name: str
    message: str


def findings(antenna: Antenna, frames: Sequence[ImageFrame] = ()) -> tuple[Finding, ...]:
    """List the contradictions among board views, rest images, `frames` of pushes and rig.json."""
    checks = (
        _stretched, _copies, _left_out, _second_line, _ground, _width, _modulus, _bent, _scale,
        _pose, _landmarks,
    )  # fmt: skip
    of_rest = (finding for check in checks for finding in check(antenna))
    return (*of_rest, *_ground_in_frames(antenna, frames), *_side(antenna, frames))


def _stretched(antenna: Antenna) -> Iterator[Finding]:
    stretch = antenna.calibration.stretch
    if stretch is not None and stretch.is_significant:
        yield Finding("board_stretched", stretch.sentence)


def _copies(antenna: Antenna) -> Iterator[Finding]:
    if antenna.at_rest.copies:
        yield Finding(
            "rest_images_identical",
            f"rest images that are copies of another are ignored ({antenna.at_rest.copies}): "
            "record each with a separate exposure",
        )


def _left_out(antenna: Antenna) -> Iterator[Finding]:
    if antenna.at_rest.rejected:
        numbers = ", ".join(str(i + 1) for i in antenna.at_rest.rejected)
        yield Finding(
            "rest_image_left_out",
            f"distinct rest image {numbers} was rejected: its beam is displaced from the "
            "others (touched or swinging)",
        )


def _second_line(antenna: Antenna) -> Iterator[Finding]:
    detector = antenna.extract.detector
    if detector is not None and detector.appearance.second_line:
        yield Finding("second_line", detector.appearance.second_line)


def _ground(antenna: Antenna) -> Iterator[Finding]:
    detector = antenna.extract.detector
    bare = None if detector is None else detector.appearance.bare_ground
    if bare is not None and bare.problem:
        yield Finding("ground_inconsistent", bare.problem)


def _ground_in_frames(antenna: Antenna, frames: Sequence[ImageFrame]) -> Iterator[Finding]:
    """Compare frames with a ground that was photographed without the beam."""
    detector = antenna.extract.detector
    ground = None if detector is None else detector.appearance.ground_at_rest
    if detector is None or ground is None or not ground.bare_images:
        return
    noise, images = detector.appearance.noise, list(_scaled(antenna, frames[:CHECKED_FRAMES]))
    without = [image for image in images if ground.in_image(image, noise).gain(image) is None]
    if len(without) > len(images) / 2:
        yield Finding(
            "ground_not_in_frames",
            f"{len(without)} of {len(images)} images of pushes do not show the ground of the "
            "images in ground/, which does not serve them: the camera, the ground or the focus has "
            "changed since",
        )


def _width(antenna: Antenna) -> Iterator[Finding]:
    """Compare the width of a round beam at rest with the stated one."""
    detector, stated = antenna.extract.detector, antenna.rig.beam.diameter
    if detector is None or detector.appearance.faces or not detector.appearance.knows_section:
        return
    shown = 2 * detector.appearance.section.radius * antenna.pixel
    ratio = shown / stated
    if abs(shown - stated) > antenna.pixel and not 1 / WIDTH_FACTOR < ratio < WIDTH_FACTOR:
        yield Finding(
            "width_inconsistent",
            f"the beam looks {shown / MILLIMETRE:.3g} mm wide in the rest images, and "
            f"beam.diameter_mm is {stated / MILLIMETRE:g}",
        )


def _modulus(antenna: Antenna) -> Iterator[Finding]:
    """Compute Young's modulus of a round beam from its EI: units are easily confused."""
    beam = antenna.rig.beam
    modulus = beam.flexural_rigidity / (math.pi / 64 * beam.diameter**4)
    if antenna.rig.known_psi is None and not SOFTEST <= modulus <= STIFFEST:
        yield Finding(
            "rigidity_implausible",
            f"a round beam of beam.diameter_mm {beam.diameter / MILLIMETRE:g} and "
            f"beam.flexural_rigidity_n_mm2 {beam.flexural_rigidity / NEWTON_SQUARE_MILLIMETRE:.3g} "
            f"has a Young's modulus of {modulus / 1e9:.2g} GPa, and materials have "
            f"{SOFTEST / 1e9:g} to {STIFFEST / 1e9:g}: the unit is N mm^2",
        )


def _bent(antenna: Antenna) -> Iterator[Finding]:
    rest, sag = antenna.rest, antenna.rig.sag_in_plane[1]
    s = np.linspace(0.0, 1.0, 50)
    bow, _ = rest.bow_at(rest.length * s)
    left = np.abs(bow - sag * (6 * s**2 - 4 * s**3 + s**4) / 3).max()
    if rest.bent and left > SAG_TOLERANCE * abs(sag):
        yield Finding(
            "rest_images_bent",
            f"the beam at rest has a bow of {np.abs(bow).max() / MILLIMETRE:.3f} mm, which is "
            "subtracted: if the unloaded beam is straight, something touches it; if it sags, set "
            "beam.sag_mm or, in the image's plane, beam.sag_in_plane_mm",
        )
    elif rest.bow_undecided and not sag:
        _, sigma = rest.bow_at(rest.length * s)
        yield Finding(
            "bow_undecided",
            f"the beam at rest may have a bow of {math.sqrt(3) * sigma.max() / MILLIMETRE:.3f} mm, "
            "or image processing or compression imitates one, because the beam crosses few pixel "
            "rows; the sigmas include it: rotate the camera so that the beam crosses more rows, or "
            "record unprocessed images",
        )


def _scale(antenna: Antenna) -> Iterator[Finding]:
    """Check the scale; errors of square, length, base and zoom cannot be distinguished."""
    tip, rig = antenna.tip_at_rest, antenna.rig
    tolerance = rig.tolerances
    length = rig.beam.length
    if tip is not None:
        seen, tip_sigma = float(tip.point[0]), math.sqrt(tip.covariance[0, 0])
    elif antenna.at_rest.length_seen is not None:
        seen, tip_sigma = antenna.at_rest.length_seen, antenna.pixel
    else:
        return
    # The visible end of a cut, rounded or shaded beam is displaced by up to its radius.
    sigma = math.hypot(
        tolerance.beam_length,
        math.sqrt(antenna.base_covariance[0, 0]),
        antenna.lengths_sigma * length,
        tip_sigma,
        rig.beam.radius / 2,
    )
    if abs(seen - length) > CONTRADICTION * sigma:
        yield Finding(
            "scale_inconsistent",
            f"the tip at rest is measured {seen / MILLIMETRE:.2f} mm from the clamp, "
            f"beam.length_mm is {length / MILLIMETRE:.2f} (sigma of the difference "
            f"{sigma / MILLIMETRE:.2f} mm): board.square_mm, beam.length_mm or the origin, "
            "base.position_mm, is wrong, or the zoom has changed since the calibration",
        )


def _pose(antenna: Antenna) -> Iterator[Finding]:
    """Compare the beam at rest with the x axis given by the stated pose of the board."""
    rig, rest = antenna.rig, antenna.rest
    if antenna.in_world:  # then the motor angle at rest is not stated
        return
    tolerance = rig.tolerances
    uncertainty = calibration_uncertainty(antenna.calibration, rig)
    offset_sigma = math.hypot(
        tolerance.base_position,
        tolerance.board_translation,
        # The board rotates about its centre.
        tolerance.board_rotation * rig.beam.length / 2,
        uncertainty.across,
        math.sqrt(rest.line_covariance[0, 0]),
    )
    angle_sigma = math.hypot(
        tolerance.board_rotation, uncertainty.turn, math.sqrt(rest.line_covariance[1, 1])
    )
    # Rows that the image does not show move the board's centre, to which the pose refers.
    or_rows = ", board.rows" if isinstance(rig.board, Charuco) else ""
    # Where no bow was subtracted, the line is that through a sagging beam.
    sag = 0.0 if rest.bow.any() else rig.sag_in_plane[1]
    offset = rest.y_at_clamp - rig.base_position[1] - SAG_OFFSET * sag
    angle = math.atan(rest.slope - SAG_SLOPE * sag / rig.beam.length)
    if abs(angle) > CONTRADICTION * angle_sigma:
        yield Finding(
            "pose_inconsistent",
            f"the beam at rest is at {angle / DEGREE:.3f} deg to the rig's x axis (sigma "
            f"{angle_sigma / DEGREE:.3f} deg): board.antenna_from_board_rotation_vector_deg or the "
            "origin, base.position_mm, is wrong, board.rotation_sigma_deg too small, or the beam "
            "misaligned in the clamp",
        )
    elif abs(offset) > CONTRADICTION * offset_sigma:
        yield Finding(
            "pose_inconsistent",
            f"the beam at rest leaves the clamp {offset / MILLIMETRE:.3f} mm along y from "
            f"base.position_mm (sigma {offset_sigma / MILLIMETRE:.3f} mm): base.position_mm"
            f"{or_rows} or board.antenna_from_board_translation_mm is wrong, or their sigmas are "
            "too small",
        )


def _landmarks(antenna: Antenna) -> Iterator[Finding]:
    landmarks = antenna.at_rest.landmarks
    if not landmarks.known:
        min_shift = 3 * landmarks.shift_sigma
        amount = f"of less than {min_shift:.1f} px " if min_shift <= FARTHEST else ""
        yield Finding(
            "camera_shift_unknown",
            f"camera motion {amount}cannot be detected, because the image beside the beam has too "
            "few or too weak edges: bring the clamp or a fixed mark into view, or set "
            "camera.camera_shift_sigma_px",
        )


def _side(antenna: Antenna, frames: Sequence[ImageFrame]) -> Iterator[Finding]:
    """Check the side to which the pushes bend the beam, which the rest images do not show."""
    significances = [_significance(antenna, frame) for frame in frames[:CHECKED_FRAMES]]
    bent = [value for value in significances if abs(value) > THRESHOLDS.contact_sigmas]
    opposite = sum(value < 0 for value in bent)
    if 2 * opposite > len(bent):
        side = antenna.rig.deflects_towards
        yield Finding(
            "side_inconsistent",
            f"{opposite} of the first {len(significances)} images show a beam that bends to the "
            f"other side than beam.deflects_towards {side} states: write {-side}, or the images "
            "are mirrored",
        )


def _scaled(antenna: Antenna, frames: Sequence[ImageFrame]) -> Iterator[Grey]:
    """Yield the images (height, width) of frames on the rest images' scale, if they are usable."""
    size = antenna.calibration.camera.height, antenna.calibration.camera.width
    for frame in frames:
        with contextlib.suppress(InputError):
            image = antenna.scale(frame.image())
            if image.shape == size:
                yield image


def _significance(antenna: Antenna, frame: ImageFrame) -> float:
    """Compute the bend over its sigma, positive to the stated side; 0 for an unusable image."""
    try:
        line = extract_centreline(antenna, frame.image())
        measurement = to_measurement(antenna, line, frame.readings)
    except InputError:
        return 0.0
    return nearest_linear_bend(measurement).significance
