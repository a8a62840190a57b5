"""Tapered and curved wires, and their places across the beam. Lengths are [m]."""

from dataclasses import dataclass

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, turn_about_z
from vbaa_bench.geometry.tube import tube

# A chord is off its arc by 3e-5 of the length at a bow of 10 %: less than 0.02 px across an image.
_SEGMENTS = 60
_FACETS = 12
# Draws of a place for one wire. Chosen: the hub is small, so that few wires take a second one.
_TRIES = 100
# Share of the wire's length, from either end, within which it does not cross the beam.
_END = 0.15
# Share of the beam's length, from the clamp, within which no wire crosses it.
_BASE = 0.1


@dataclass(frozen=True)
class Wire:
    """A level wire of `length`, `diameter` at its thick end, and `bow` (sagitta over length)."""

    length: float
    diameter: float
    tip_ratio: float
    bow: float

    @property
    def turn(self) -> float:
        """Angle [rad] by which it turns from end to end: that of a flat arc, as of a bowed beam."""
        return 8 * self.bow

    def mesh(self) -> trimesh.Trimesh:
        """Mesh it in z = 0 about the middle of its arc, which is along x there."""
        s = np.linspace(0.0, 1.0, _SEGMENTS + 1)
        radius = self.diameter / 2 * (1 + (self.tip_ratio - 1) * s)
        return tube(self.centreline(s), radius, _FACETS)

    def centreline(self, share: Floats) -> Floats:
        """Compute points (n, 3) at shares (n,) of the length: a circular arc about the origin."""
        s = (share - 0.5) * self.length
        turned = self.turn * s / self.length
        across = s * np.sinc(turned / 2 / np.pi) * np.sin(turned / 2)
        return np.column_stack([s * np.sinc(turned / np.pi), across, np.zeros(len(s))])


def crossing(
    wire: Wire,
    beam_length: float,
    angles: tuple[float, float],
    hub: float,
    random: np.random.Generator,
) -> Floats | None:
    """Draw a pose (4, 4) in which a wire crosses the x axis between clamp and tip.

    Its direction where it crosses is drawn between `angles` [rad]. It stays out of the circle of
    radius `hub` about the origin; None if there is no room.
    """
    samples = np.linspace(0.0, 1.0, _SEGMENTS + 1)
    for _ in range(_TRIES):
        share = random.uniform(_END, 1 - _END)
        place = random.uniform(_BASE, 1.0) * beam_length
        # The wire's direction at the crossing is that at its middle, turned by the arc between.
        heading = random.uniform(*angles) - wire.turn * (share - 0.5)
        pose = turn_about_z(heading)
        crossed = apply(pose, wire.centreline(np.array([share])))[0]
        pose[:2, 3] = np.array([place, 0.0]) - crossed[:2]
        points = apply(pose, wire.centreline(samples))[:, :2]
        if np.linalg.norm(points, axis=1).min() > hub + wire.diameter + wire.length / _SEGMENTS:
            return pose
    return None
