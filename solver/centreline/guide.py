"""Conversion between places in the beam's plane and pixels of the image."""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from solver.centreline.bare_ground import BareGround
from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply
from solver.planes.plane_c import apply_homography

# Number of scan lines over the beam's length.
LINES = 72
# Places of a path over the beam's length: a beam that looks longer is within them.
PLACES = np.linspace(0.0, 1.06, 96)


@dataclass(frozen=True)
class Guide:
    """The camera, and the frame of the beam at rest in plane C (`antenna_from_beam`, (4, 4)).

    `length` [m] of the beam and `radius` [m] of its section. `free_tilt` is True where the motor
    may have turned the beam by any angle relative to the camera. `full_scale` is a saturated
    pixel's gray value, None where it is the largest of the image's type. `strip_psi` [rad] is the
    inclination of a flat strip's thickness, None for a round beam; a strip may look several times
    as wide as its radius states. `bare_ground` is the ground without the beam, None where no images
    show it.
    """

    camera: Camera
    antenna_from_beam: Floats
    length: float
    radius: float
    free_tilt: bool = False
    full_scale: int | None = None
    strip_psi: float | None = None
    bare_ground: BareGround | None = None

    def pixels(self, places: Floats) -> Floats:
        """Project places (n, 2) [m] of the beam's frame in plane C to pixels (n, 2)."""
        if not self.camera.distortion:
            return apply_homography(self._image_from_beam, places)
        points = np.column_stack([places, np.zeros(len(places))])
        return self.camera.project(apply(self.antenna_from_beam, points))

    def places(self, pixels: Floats) -> Floats:
        """Find the places (n, 2) [m] of the beam's frame that are seen at pixels (n, 2).

        Pixels that the distortion model does not reach give NaN; the others are not affected.
        """
        if self.camera.distortion:
            pixels = self.camera.undistorted_pixels(pixels)
        return apply_homography(self._beam_from_image, pixels)

    def turned_about(self) -> "Guide":
        """Return the guide of a beam whose clamp and tip are exchanged."""
        half_turn = np.diag([-1.0, -1.0, 1.0, 1.0])
        half_turn[0, 3] = self.length
        return replace(self, antenna_from_beam=self.antenna_from_beam @ half_turn)

    @cached_property
    def _image_from_beam(self) -> Floats:
        """Homography (3, 3) from places to pixels, without the lens's distortion."""
        antenna_from_beam = self.antenna_from_beam[np.ix_([0, 1, 3], [0, 1, 3])]
        plane = self.camera.normalised_from_plane
        return np.asarray(self.camera.matrix @ plane @ antenna_from_beam)

    @cached_property
    def _beam_from_image(self) -> Floats:
        return np.asarray(np.linalg.inv(self._image_from_beam), dtype=np.float64)

    @cached_property
    def pixel(self) -> float:
        """Size [m] of a pixel at the middle of the beam."""
        middle = np.array([[self.length / 2, 0.0, 0.0]])
        return float(1 / self.camera.pixels_per_metre(apply(self.antenna_from_beam, middle))[0])

    @property
    def strip_tilt(self) -> float | None:
        """Angle [rad] of a strip's thickness to the image, at the middle of the beam."""
        if self.strip_psi is None:
            return None
        _, y, z, _ = np.linalg.inv(self.antenna_from_beam) @ self.camera.viewpoint
        return self.strip_psi + math.atan2(y, z)

    @property
    def radius_px(self) -> float:
        """Radius of the beam's section in the image [px]."""
        return self.radius / self.pixel

    @cached_property
    def ends(self) -> Floats:
        """Pixels (2, 2) of the beam at rest: just beyond its clamp, and at its tip."""
        return self.pixels(np.array([[0.02 * self.length, 0.0], [self.length, 0.0]]))

    @cached_property
    def scans_columns(self) -> bool:
        """Whether the beam at rest runs mainly along the image rows, so that columns cross it."""
        along, down = np.abs(self.ends[1] - self.ends[0])
        return bool(along >= down)

    @cached_property
    def scan_lines(self) -> npt.NDArray[np.uint64]:
        """Pixel columns (rows for an upright beam) that cross the beam's length."""
        axis = 0 if self.scans_columns else 1
        near, far = self.ends[:, axis]
        low, high = min(near, far), max(near, far)
        if self.free_tilt:
            low, high = near - (high - low), near + (high - low)
        limit = self.camera.width if self.scans_columns else self.camera.height
        low, high = (min(max(end, 0), limit - 1) for end in (low, high))
        lines = np.linspace(low, high, LINES).astype(np.uint64)
        return np.asarray(lines[np.append(True, lines[1:] != lines[:-1])])
