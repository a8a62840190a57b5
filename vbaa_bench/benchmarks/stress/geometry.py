"""Geometric perturbations: displaced cameras, bent beams, turned and cropped images.

Resampling must keep an image's noise, or the solver would get images that are smoother than any
camera's. Uniform shifts are made in the Fourier domain, which keeps white noise white and its
standard deviation the same; other warps interpolate by quintic splines, which keep at least 92 %
of the standard deviation. Beyond its border an image continues as its own reflection. Results are
rounded to gray values again.
"""

from dataclasses import replace

import cv2
import numpy as np
from scipy import ndimage

from solver.instrument.arrays import Floats, Grey
from solver.instrument.board import Chessboard
from solver.instrument.transforms import rigid, turn_about_z
from solver.instrument.units import MILLIMETRE
from vbaa_bench.benchmarks.stress.recording import (
    NotApplicableError,
    Perturbation,
    Recording,
    requantised,
)

# Padding by reflection before a shift; the ringing of the shift decays within it.
_PADDING_PX = 32


def shifted(image: Grey, shift: Floats) -> Grey:
    """Shift the image by `shift` (2,) [px], as (u, v)."""
    padded = np.pad(image.astype(float), _PADDING_PX, mode="symmetric")
    spectrum = ndimage.fourier_shift(np.fft.fft2(padded), (shift[1], shift[0]))
    moved = np.fft.ifft2(spectrum).real[_PADDING_PX:-_PADDING_PX, _PADDING_PX:-_PADDING_PX]
    return requantised(moved, image)


def warped(image: Grey, source: Floats) -> Grey:
    """Sample every pixel at the position `source` (2, height, width), as (u, v), of the image."""
    values = ndimage.map_coordinates(image.astype(float), source[::-1], order=5, mode="mirror")
    return requantised(values, image)


def shifted_across(pixels: float) -> Perturbation:
    """Shift the frames across the beam at rest, like a camera that moved after calibration."""
    return lambda recording, _random: _shift_frames(recording, _across(recording) * pixels)


def shifted_along(pixels: float) -> Perturbation:
    """Shift the frames along the beam at rest."""
    return lambda recording, _random: _shift_frames(recording, _along(recording) * pixels)


def stabilised(pixels: float) -> Perturbation:
    """Shift every image of the beam at random, by up to `pixels` in u and in v."""

    def perturb(recording: Recording, random: np.random.Generator) -> Recording:
        return recording.beams(lambda image: shifted(image, random.uniform(-pixels, pixels, 2)))

    return perturb


def zoomed(factor: float) -> Perturbation:
    """Enlarge all images of the beam about their centre; the board's images stay unchanged."""

    def perturb(recording: Recording, _random: np.random.Generator) -> Recording:
        return recording.beams(lambda image: warped(image, _source_positions(image, factor)))

    def _source_positions(image: Grey, factor: float) -> Floats:
        pixels = _pixels(image)
        centre = (np.array(image.shape[::-1]) - 1)[:, None, None] / 2
        return np.asarray(centre + (pixels - centre) / factor)

    return perturb


def bent_rests(tip_mm: float, touched: int | None = None) -> Perturbation:
    """Bend the beam of the rest images as a force at its tip does, by `tip_mm` there.

    `touched` is the number of the only image to bend; with None all are bent.
    """

    def perturb(recording: Recording, _random: np.random.Generator) -> Recording:
        rests = list(recording.rests)
        if touched is not None and len(rests) < 2:
            raise NotApplicableError("needs two rest images")
        source = _straight_positions(recording, tip_mm * MILLIMETRE)
        for number in range(len(rests)) if touched is None else (touched,):
            rests[number] = warped(rests[number], source)
        return replace(recording, rests=tuple(rests))

    return perturb


def turned(quarters: int) -> Perturbation:
    """Turn all images clockwise by quarter-turns, as a rolled camera does; the rig is the same.

    The colours of the board's squares show its orientation.
    """

    def perturb(recording: Recording, _random: np.random.Generator) -> Recording:
        _chessboard(recording)
        return recording.each(lambda image: np.rot90(image, -quarters))

    return perturb


def reversed_beam(recording: Recording, _random: np.random.Generator) -> Recording:
    """Reverse the stated direction of the beam: clamp and tip are exchanged.

    The rig's pose of the board is turned by 180 degrees about the middle of the beam.
    """
    to_middle = np.array([recording.rig.beam.length / 2, 0.0, 0.0])
    middle = recording.rig.base_position + to_middle
    rotation = rigid(np.zeros(3), middle) @ turn_about_z(np.pi) @ rigid(np.zeros(3), -middle)
    rig = replace(recording.rig, antenna_from_board=rotation @ recording.rig.antenna_from_board)
    return replace(recording, rig=rig)


def mirrored(recording: Recording, _random: np.random.Generator) -> Recording:
    """Mirror all images, and the stated rig with them.

    A chessboard's upper left square must stay black, so the mirror is left-right where the board
    has an even number of columns, up-down otherwise. In the mirror the beam bends to the other
    side; left-right it points the other way too, so that the board is turned by 180 degrees.
    """
    board, rig = _chessboard(recording), recording.rig
    left_right = board.columns % 2 == 0
    turn = np.diag([1.0, -1.0, 1.0, 1.0])
    pose = turn @ rig.antenna_from_board @ np.diag([-1.0 if left_right else 1.0, 1.0, 1.0, 1.0])
    if not left_right:
        pose = pose @ turn
    stated = replace(
        rig,
        antenna_from_board=pose,
        base_position=turn[:3, :3] @ rig.base_position,
        deflects_towards=-rig.deflects_towards,
    )
    axis = 1 if left_right else 0
    return replace(recording.each(lambda image: np.flip(image, axis)), rig=stated)


def cropped(recording: Recording, _random: np.random.Generator) -> Recording:
    """Crop all images by a few pixels on every side, by an odd number in total for odd sizes."""
    return recording.each(lambda image: image[2:-1, 3:-2])


def resized(factor: float) -> Perturbation:
    """Resize all images by `factor`."""
    interpolation = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC

    def resize(image: Grey) -> Grey:
        return np.asarray(
            cv2.resize(image, None, fx=factor, fy=factor, interpolation=interpolation)
        )

    return lambda recording, _random: recording.each(resize)


def _shift_frames(recording: Recording, shift: Floats) -> Recording:
    return recording.only_frames(lambda image: shifted(image, shift))


def _along(recording: Recording) -> Floats:
    """Return the unit vector (2,) of the image along the beam at rest, from clamp to tip."""
    x, y, _ = recording.rig.base_position
    length = recording.rig.beam.length
    direction = recording.in_image(x + length, y) - recording.in_image(x, y)
    return np.asarray(direction / np.linalg.norm(direction))


def _across(recording: Recording) -> Floats:
    u, v = _along(recording)
    return np.array([-v, u])


def _straight_positions(recording: Recording, tip: float) -> Floats:
    """Map pixels of the bent beam's image to positions (2, height, width) in the straight one's."""
    camera, rig = recording.camera, recording.rig
    pixels = _pixels(recording.rests[0])
    rays = camera.normalised(pixels.reshape(2, -1).T)
    homogeneous = np.column_stack([rays, np.ones(len(rays))]) @ camera.plane_from_normalised.T
    points = np.column_stack([homogeneous[:, :2] / homogeneous[:, 2:], np.zeros(len(homogeneous))])
    s = np.clip((points[:, 0] - rig.base_position[0]) / rig.beam.length, 0.0, 1.0)
    points[:, 1] -= rig.deflects_towards * tip * (3 * s**2 - s**3) / 2
    return np.asarray(camera.project(points).T.reshape(pixels.shape))


def _pixels(image: Grey) -> Floats:
    """Return the coordinates (2, height, width) of all pixels, as (u, v)."""
    v, u = np.mgrid[: image.shape[0], : image.shape[1]].astype(float)
    return np.stack([u, v])


def _chessboard(recording: Recording) -> Chessboard:
    board = recording.rig.board
    if not isinstance(board, Chessboard):
        raise NotApplicableError("needs a chessboard, which stays valid if turned or mirrored")
    return board
