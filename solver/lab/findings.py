"""Consistency checks of a rig before use: board views and rest images against rig.json."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from solver.antenna import Antenna
from solver.at_rest.landmarks import FARTHEST
from solver.calibrate.uncertainty import calibration_uncertainty
from solver.instrument.units import DEGREE, MILLIMETRE

# Two values that differ by more than this number of their combined sigmas are a finding.
CONTRADICTION = 3.0


class Finding(NamedTuple):
    """Result of a check: a short `name` for programs, and a `message` with cause and remedy."""

    name: str
    message: str


def findings(antenna: Antenna) -> tuple[Finding, ...]:
    """List the contradictions among board views, rest images and rig.json."""
    checks = (_copies, _left_out, _bent, _scale, _pose, _landmarks)
    return tuple(finding for check in checks for finding in check(antenna))


def _copies(antenna: Antenna) -> Iterator[Finding]:
    if antenna.at_rest.copies:
        yield Finding(
            "rest_images_identical",
            f"{antenna.at_rest.copies} of the rest images are copies of another and count for "
            "nothing: take each with an exposure of its own",
        )


def _left_out(antenna: Antenna) -> Iterator[Finding]:
    if antenna.at_rest.left_out:
        numbers = ", ".join(str(i + 1) for i in antenna.at_rest.left_out)
        yield Finding(
            "rest_image_left_out",
            f"distinct rest image {numbers} shows the beam elsewhere than the others, touched or "
            "swinging, and was left out",
        )


def _bent(antenna: Antenna) -> Iterator[Finding]:
    rest = antenna.rest
    if rest.bow.any():
        bow, _ = rest.bow_at(np.linspace(0.0, rest.length, 50))
        yield Finding(
            "rest_images_bent",
            f"the beam at rest is bent by {np.abs(bow).max() / MILLIMETRE:.3f} mm, which is taken "
            "off as its own bow: if it is straight by itself, something touches it; if it hangs, "
            "state beam.sag_mm",
        )
    elif rest.bow_undecided:
        _, sigma = rest.bow_at(np.linspace(0.0, rest.length, 50))
        yield Finding(
            "bow_undecided",
            f"the beam at rest looks bent by {math.sqrt(3) * sigma.max() / MILLIMETRE:.3f} mm, "
            "but it crosses so few pixel rows that the camera's processing or compression may do "
            "that; the stated sigmas include it: turn the camera until the beam crosses more rows, "
            "or take unprocessed images",
        )


def _scale(antenna: Antenna) -> Iterator[Finding]:
    """Check the scale; errors of square, length, base and zoom cannot be distinguished."""
    tip, rig = antenna.tip_at_rest, antenna.rig
    if tip is None:
        return
    tolerance = rig.tolerances
    length = rig.beam.length
    # The visible end of a cut, rounded or shaded beam is displaced by up to its radius.
    sigma = math.hypot(
        tolerance.beam_length,
        math.sqrt(antenna.base_covariance[0, 0]),
        antenna.lengths_sigma * length,
        math.sqrt(tip.covariance[0, 0]),
        rig.beam.radius / 2,
    )
    off = tip.point[0] - length
    if abs(off) > CONTRADICTION * sigma:
        yield Finding(
            "scale_inconsistent",
            f"the tip at rest is seen {tip.point[0] / MILLIMETRE:.2f} mm from the clamp, stated is "
            f"a length of {length / MILLIMETRE:.2f} mm, and their sigma is "
            f"{sigma / MILLIMETRE:.2f} mm: board.square_mm, beam.length_mm, base.position_mm or a "
            "zoom after the calibration is wrong; nothing in the images says which",
        )


def _pose(antenna: Antenna) -> Iterator[Finding]:
    """Compare the beam at rest with the x axis given by the stated pose of the board."""
    rig, rest = antenna.rig, antenna.rest
    if antenna.in_world:  # then the motor angle at rest is not stated
        return
    tolerance = rig.tolerances
    known = calibration_uncertainty(antenna.calibration, rig)
    place_sigma = math.hypot(
        tolerance.base_position,
        tolerance.board_translation,
        # The board rotates about its centre.
        tolerance.board_rotation * rig.beam.length / 2,
        known.across,
        math.sqrt(rest.line_covariance[0, 0]),
    )
    turn_sigma = math.hypot(
        tolerance.board_rotation, known.turn, math.sqrt(rest.line_covariance[1, 1])
    )
    place, turn = rest.y_at_clamp - rig.base_position[1], math.atan(rest.slope)
    if abs(turn) > CONTRADICTION * turn_sigma:
        yield Finding(
            "pose_inconsistent",
            f"the beam at rest lies at {turn / DEGREE:.3f} degrees to the rig's x axis, with a "
            f"sigma of {turn_sigma / DEGREE:.3f}: board.antenna_from_board_rotation_vector_deg is "
            "wrong, board.rotation_sigma_deg too small, or the beam is clamped askew",
        )
    elif abs(place) > CONTRADICTION * place_sigma:
        yield Finding(
            "pose_inconsistent",
            f"the beam at rest leaves the clamp {place / MILLIMETRE:.3f} mm beside its stated "
            f"place, with a sigma of {place_sigma / MILLIMETRE:.3f} mm: base.position_mm or "
            "board.antenna_from_board_translation_mm is wrong, or their sigmas are too small",
        )


def _landmarks(antenna: Antenna) -> Iterator[Finding]:
    landmarks = antenna.at_rest.landmarks
    if not landmarks.known:
        least = 3 * landmarks.shift_sigma
        moves = f"by less than {least:.1f} px " if least <= FARTHEST else ""
        yield Finding(
            "camera_shift_unknown",
            f"a camera that moves {moves}later cannot be noticed, for what the image shows beside "
            "the beam has too few or too faint edges: bring the clamp or a fixed mark into view, "
            "or state camera.camera_shift_sigma_px",
        )
