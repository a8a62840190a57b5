"""Camera rays from film positions: point spread, lens distortion, aperture.

Rays are warped; images are never resampled. Mitsuba's sensor generates the ideal ray.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.camera import Camera
from vbaa_bench.render.device_array import device_array, index_of

# A Gaussian point spread is cut off at this number of sigmas.
_SIGMAS = 5.0


@dataclass(frozen=True)
class Lens:
    """A real lens: point spread and defocus.

    `point_spread_px` is the sigma of its Gaussian point spread, `aperture` the radius of its
    entrance pupil and `focus` the depth in focus, both in the same unit of length.
    """

    point_spread_px: float = 0.0
    aperture: float = 0.0
    focus: float = 1.0

    def scaled(self, factor: float) -> "Lens":
        """Convert the lens to another unit of length."""
        return replace(self, aperture=self.aperture * factor, focus=self.focus * factor)

    def blur_px(self, camera: Camera, nearest: float, farthest: float) -> int:
        """Bound the blur radius [px] of points between two depths [m]."""
        # Radius of the cone through a point, in the plane of focus.
        widest = self.aperture * max(abs(1 - self.focus / z) for z in (nearest, farthest))
        disc = camera.fx * widest / (1 if camera.telecentric else self.focus)
        return math.ceil(_SIGMAS * self.point_spread_px + disc)


class Optics:
    """Ray generator of a camera whose ideal pinhole or telecentric part is Mitsuba's `sensor`."""

    def __init__(self, camera: Camera, lens: Lens, sensor: Any, lens_axis: Floats) -> None:
        """`lens_axis` (3,) is the optical axis, a unit vector in render coordinates."""
        self.camera, self.lens = camera, lens
        self._sensor, self._axis = sensor, mi.Vector3f(*map(float, lens_axis))

    @property
    def dimensions(self) -> int:
        """Number of random pairs per ray: place in the pixel, point spread and pupil, if any."""
        return 1 + (self.lens.point_spread_px > 0) + (self.lens.aperture > 0)

    @property
    def state(self) -> Any:
        """Dr.Jit's arrays on which rays depend, except those of the sensor."""
        return self._shifts if self.camera.distortion else None

    def ray(self, column: Any, row: Any, u: Sequence[Any]) -> Any:
        """Generate rays through pixels, at places chosen by points `u` of the unit square.

        `column` and `row` are Dr.Jit floats.
        """
        in_pixel, *rest = u[: self.dimensions]
        x, y = column + in_pixel.x, row + in_pixel.y
        if self.lens.point_spread_px > 0:
            spread = mi.warp.square_to_std_normal(rest.pop(0)) * self.lens.point_spread_px
            x, y = x + spread.x, y + spread.y
        return self._ray_through(x, y, rest.pop(0) if rest else None)

    def centre_ray(self, column: Any, row: Any) -> Any:
        """Generate the ray through the centres of pixels and of the lens."""
        return self._ray_through(column + 0.5, row + 0.5, None)

    def _ray_through(self, x: Any, y: Any, pupil: Any) -> Any:
        """Generate a ray through film coordinates [px], counted from the image's corner."""
        camera = self.camera
        if camera.distortion:
            x, y = self._undistorted(x, y)
        film = mi.Point2f(x / camera.width, y / camera.height)
        ray, _ = self._sensor.sample_ray(0.0, 0.0, film, mi.Point2f(0.5))
        if pupil is None:
            return ray
        # A thin lens focuses all rays of a film point in the plane of focus. The ideal ray starts
        # on the near clip plane; any plane perpendicular to the axis would do.
        along = dr.dot(ray.d, self._axis)
        frame = mi.Frame3f(self._axis)
        offset = frame.to_world(_disk(pupil) * self.lens.aperture)
        focus_point = ray.o + ray.d * ((self.lens.focus - self._near) / along)
        start = ray.o + offset * (1 - self._near / self.lens.focus)
        ray.o = start
        ray.d = dr.normalize(focus_point - start)
        return ray

    @property
    def _near(self) -> float:
        return float(self._sensor.near_clip())

    def _undistorted(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Undistort a film point, bilinearly between pixel corners."""
        width = self.camera.width + 1 + 2 * self._margin
        height = self.camera.height + 1 + 2 * self._margin
        across = dr.clip(x + self._margin, 0, width - 1)
        down = dr.clip(y + self._margin, 0, height - 1)
        column, row = index_of(across, width - 1), index_of(down, height - 1)
        u, v = across - column, down - row
        shift = mi.Point2f(0)
        for corner, weight in (
            (row * width + column, (1 - u) * (1 - v)),
            (row * width + column + 1, u * (1 - v)),
            ((row + 1) * width + column, (1 - u) * v),
            ((row + 1) * width + column + 1, u * v),
        ):
            shift += dr.gather(mi.Point2f, self._shifts, corner) * weight
        return x + shift.x, y + shift.y

    @property
    def _margin(self) -> int:
        return math.ceil(_SIGMAS * self.lens.point_spread_px) + 1

    @cached_property
    def _shifts(self) -> Any:
        """Undistortion shifts of the pixel corners [px], row by row.

        Between corners the shift is linear to a millionth of a pixel.
        """
        rows, columns = np.mgrid[
            -self._margin : self.camera.height + self._margin + 1,
            -self._margin : self.camera.width + self._margin + 1,
        ]
        corners = np.column_stack([columns.ravel(), rows.ravel()]) - 0.5
        shifts = self.camera.undistorted_pixels(corners) - corners
        return mi.Point2f(*map(device_array, shifts.T))


def _disk(sample: Any) -> Any:
    point = mi.warp.square_to_uniform_disk_concentric(sample)
    return mi.Vector3f(point.x, point.y, 0)
