"""Antenna: data learned once per rig, and derived quantities that hold for every frame."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from solver.at_rest.rest_line import RestLine
from solver.at_rest.rest_state import RestState
from solver.calibrate import Calibration
from solver.centreline.extractor import Extractor
from solver.instrument.arrays import Floats
from solver.instrument.gray_scale import EIGHT_BIT, GrayScale
from solver.instrument.grid_error import GridError
from solver.instrument.measurement import Tip
from solver.instrument.rig import Rig
from solver.instrument.transforms import invert
from solver.planes.plane_c import on_plane
from solver.planes.sag import correct_for_sag, scale_error

# Prior sigma [rad] of the motor angle where the camera is fixed in the world.
ANY_TILT = 0.5


@dataclass(frozen=True)
class Antenna:
    """All that is learned once per rig: calibrated camera and the beam at rest.

    `clamp_sigma` [m] and `scale_sigma` (relative) are the calibration's uncertainties along the
    beam. `scale` is the gray scale of the rest images, which frames must share.
    """

    rig: Rig
    calibration: Calibration
    at_rest: RestState
    clamp_sigma: float = 0.0
    scale_sigma: float = 0.0
    scale: GrayScale = EIGHT_BIT

    @property
    def rest(self) -> RestLine:
        """The beam's line at rest."""
        return self.at_rest.line

    @property
    def extract(self) -> Extractor:
        """The beam extractor."""
        return self.at_rest.extract

    def without(self, error: GridError | None) -> "Antenna":
        """Return the antenna whose beam at rest is measured without an error of the pixel grid.

        `error` is that of a frame's centreline, from which it has been subtracted.
        """
        if error is None or not self.at_rest.lines:
            return self
        at_rest = self.at_rest.without(error, self.calibration, self.rig)
        return replace(self, at_rest=at_rest)

    @cached_property
    def antenna_from_beam(self) -> Floats:
        """The frame (4, 4) of the beam at rest, as `Measurement` has it, in Sigma_a."""
        tilt, side = math.atan(self.rest.slope), self.rig.deflects_towards
        frame = np.eye(4)
        frame[:2, 0] = math.cos(tilt), math.sin(tilt)
        frame[:2, 1] = -side * math.sin(tilt), side * math.cos(tilt)
        frame[:2, 3] = self.rig.base_position[0], self.rest.y_at_clamp
        return frame

    @cached_property
    def viewpoint(self) -> Floats:
        """The camera's viewpoint (4,), homogeneous, in the frame of the beam at rest."""
        return np.asarray(invert(self.antenna_from_beam) @ self.calibration.camera.viewpoint)

    @cached_property
    def base_covariance(self) -> Floats:
        """Covariance (3, 3) of the clamp's pose, as `Measurement` has it without a shifted image.

        The motor angle is not read where the camera is fixed in the world: the clamp's tilt is then
        almost unknown, and is the motor's angle.
        """
        tolerance = self.rig.tolerances
        covariance = np.zeros((3, 3))
        covariance[0, 0] = tolerance.base_position**2 + tolerance.board_translation**2
        covariance[0, 0] += self.clamp_sigma**2
        covariance[1:, 1:] = self.rest.line_covariance
        # A nanometre and a nanoradian keep the covariance of an exact rig regular.
        covariance += np.diag([1e-18, 1e-18, 1e-18])
        if self.in_world:
            covariance[2, 2] += ANY_TILT**2
        return covariance

    @cached_property
    def by_pixel(self) -> Floats:
        """Derivatives (2, 2) [m/px] of a place on C by its pixel's u and v, at the beam's middle.

        The place is in the frame of the beam at rest, as a row for each of u and v.
        """
        pixel = self.calibration.camera.project(self._middle)
        _, by_pixel = on_plane(self.calibration.camera, np.vstack([pixel, pixel]), np.eye(2))
        return by_pixel @ self.antenna_from_beam[:2, :2]

    @cached_property
    def pixel(self) -> float:
        """Size [m] of a pixel at the middle of the beam at rest."""
        return float(1 / self.calibration.camera.pixels_per_metre(self._middle)[0])

    @property
    def _middle(self) -> Floats:
        """The middle (1, 3) [m] of the beam at rest."""
        return (np.array([self.rig.beam.length / 2, 0.0, 0.0]) + self.rig.base_position)[None]

    @property
    def rim(self) -> float:
        """Height [m] of a cylinder's nearest rim above its axis, a mean over the beam's width."""
        return self.rig.beam.radius * math.pi / 4

    def tip_in_beam_frame(self, pixel: Floats, covariance: Floats) -> tuple[Floats, Floats]:
        """Locate a tip detected at `pixel` (2,), with `covariance` (2, 2) [px^2], on plane C.

        Return its point (2,) [m] and its covariance (2, 2) [m^2].
        The visible part of a cylinder's end is the rim that is nearest to the camera.
        """
        camera = self.calibration.camera
        # Derivatives of the point by the pixel's u and v.
        points, by_pixel = on_plane(camera, np.array([pixel, pixel]), np.eye(2))
        viewpoint, point = (
            camera.viewpoint,
            correct_for_sag(points[:1], camera.viewpoint, self.rig)[0],
        )
        outward = (viewpoint[3] * point - viewpoint[:2]) / viewpoint[2]
        axes, clamp = self.antenna_from_beam[:2, :2], self.antenna_from_beam[:2, 3]
        jacobian = by_pixel @ axes
        return (point - self.rim * outward - clamp) @ axes, jacobian.T @ covariance @ jacobian

    @cached_property
    def tip_at_rest(self) -> Tip | None:
        """The tip at rest, in the frame of the beam at rest; None where it was not detected."""
        at_rest = self.at_rest
        if at_rest.tip is None or at_rest.tip_covariance is None or self.in_world:
            return None
        return Tip(*self.tip_in_beam_frame(at_rest.tip, at_rest.tip_covariance), self.rim)

    @cached_property
    def tip_sigma(self) -> float | None:
        """Relative sigma of the length up to the visible tip, from the rest images.

        None where they do not show the tip. The error of the clamp's position along the beam is
        included: it is an error of the length between clamp and tip.
        """
        tip = self.tip_at_rest
        if tip is None:
            return None
        shift = self.rig.tolerances.camera_shift_px * self.pixel
        variance = tip.covariance[0, 0] + self.base_covariance[0, 0] + shift**2
        return math.sqrt(variance) / self.rig.beam.length

    @cached_property
    def lengths_sigma(self) -> float:
        """Relative sigma of all lengths, from the rig's tolerances and the calibration.

        A clamp off plane C, or a board that was not in it, is nearer to the camera or farther from
        it than assumed: all lengths have the same relative error. A board tilted about its middle
        is off by its angle times half the beam. The calibration's own error is added.
        """
        camera, rig, tolerance = self.calibration.camera, self.rig, self.rig.tolerances
        if camera.telecentric:  # distance does not change its scale, tilt only to second order
            return math.hypot(tolerance.board_rotation**2, self.scale_sigma)
        height = float(camera.viewpoint[2])
        tilt_error = tolerance.board_rotation * rig.beam.length / 2
        plane_error = math.hypot(tolerance.base_position, tolerance.board_translation, tilt_error)
        sag_error = scale_error(camera.viewpoint, rig)
        return math.hypot(plane_error / height, sag_error, self.scale_sigma)

    @property
    def in_world(self) -> bool:
        """Whether the camera is fixed in the world, and does not turn with the motor."""
        return self.rig.camera_mount == "world"
