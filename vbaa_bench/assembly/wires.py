"""Wires across the beam: their surface in the frame of the ground."""

from typing import Final

import numpy as np

from solver.instrument.transforms import apply
from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.assembly.clutter import texel_each
from vbaa_bench.geometry.solids import together
from vbaa_bench.geometry.wires import Wire, crossing
from vbaa_bench.render.surface import Surface
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

WIRES: Final = "wires"


def wires_surface(scene: Scene, rig: TrueRig, look: int = 0) -> Surface | None:
    """Build the wires of a scene in the frame of its ground [m]; None if there is no room.

    `look` numbers the random draws.
    """
    spec = scene.wires
    assert spec is not None
    random, count = random_generator(scene, "wires", look), spec.count
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
