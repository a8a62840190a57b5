"""Wires across the beam: tapered and curved, at random places over the ground. Lengths are [m]."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.transforms import apply, turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.geometry.mesh import Mesh
from vbaa_bench.geometry.solids import together
from vbaa_bench.geometry.textures import texel_each
from vbaa_bench.geometry.tube import tube
from vbaa_bench.render.surface import Surface
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

# Name of the surface of all wires.
WIRES: Final = "wires"
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

    def mesh(self) -> Mesh:
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


def wires_surface(scene: Scene, rig: TrueRig, pattern_id: int = 0) -> Surface | None:
    """Build the wires of a scene in the frame of its ground [m]; None if there is no room.

    `pattern_id` is the number of the random draws.
    """
    spec = scene.wires
    assert spec is not None
    random, count = random_generator(scene, "wires", pattern_id), spec.count
    diameters, lengths = (
        low * (high / low) ** random.uniform(size=count) * MILLIMETRE
        for low, high in (spec.diameter_mm, spec.length_mm)
    )
    tips = random.uniform(*spec.tip_ratio, count)
    bows = random.uniform(*spec.bow_pct, count) * PERCENT
    reflectances = random.uniform(*spec.reflectance, count)
    heights = random.permutation(np.linspace(*spec.height_mm, count)) * MILLIMETRE
    angles = spec.crossing_deg[0] * DEGREE, spec.crossing_deg[1] * DEGREE
    # The hub is about the motor's axis, and an offset clamp is joined to it.
    hub = scene.hub.radius_mm + float(np.linalg.norm(scene.clamp_offset_mm[:2]))
    meshes, chosen = [], []
    for number in range(count):
        values = lengths[number], diameters[number], tips[number], bows[number]
        wire = Wire(*(float(value) for value in values))
        pose = crossing(wire, rig.beam.length, angles, hub * MILLIMETRE, random)
        if pose is None:
            continue
        pose[2, 3] = heights[number]
        mesh = wire.mesh()
        mesh.vertices = apply(pose, np.asarray(mesh.vertices))
        meshes.append(mesh)
        chosen.append(number)
    if not meshes:
        return None
    texture = texel_each(meshes, reflectances[chosen])
    mesh = together(meshes)
    return Surface(mesh, 0.0, spec.paint, roughness=spec.roughness, texture=texture)
