"""Between image and beam: where a place of the beam's plane is seen, and the other way."""

from dataclasses import dataclass

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from solver.instrument.transforms import apply, invert
from solver.plane import on_plane


@dataclass(frozen=True)
class Guide:
    """The camera, and the frame of the beam at rest in plane C (`antenna_from_beam`, (4, 4)).

    `length` [m] of the beam and `radius` [m] of its section. `free_tilt` says that the motor may
    have turned the beam by any angle against the camera.
    """

    camera: Camera
    antenna_from_beam: Floats
    length: float
    radius: float
    free_tilt: bool = False

    def pixels(self, places: Floats) -> Floats:
        """Pixels (n, 2) of places (n, 2) [m] of the beam's frame in plane C."""
        points = np.column_stack([places, np.zeros(len(places))])
        return self.camera.project(apply(self.antenna_from_beam, points))

    def places(self, pixels: Floats) -> Floats:
        """Places (n, 2) [m] of the beam's frame that are seen at pixels (n, 2)."""
        points, _ = on_plane(self.camera, pixels, np.zeros_like(pixels))
        beam_from_antenna = invert(self.antenna_from_beam)
        return np.asarray(points @ beam_from_antenna[:2, :2].T + beam_from_antenna[:2, 3])

    @property
    def pixel(self) -> float:
        """Size [m] of a pixel at the middle of the beam."""
        middle = np.array([[self.length / 2, 0.0, 0.0]])
        return float(1 / self.camera.pixels_per_metre(apply(self.antenna_from_beam, middle))[0])

    @property
    def radius_px(self) -> float:
        """Radius of the beam's section in the image [px]."""
        return self.radius / self.pixel

    @property
    def upright(self) -> bool:
        """Whether the beam at rest runs rather along the image's rows, and columns cross it."""
        (u0, v0), (u1, v1) = self.pixels(np.array([[0.0, 0.0], [self.length, 0.0]]))
        return bool(abs(u1 - u0) >= abs(v1 - v0))
