"""Clutter on the ground: where there is room for it, and its surfaces."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from solver.instrument.units import DEGREE, MILLIMETRE, PERCENT
from vbaa_bench.assembly.ground import motor_axis, view_of_ground
from vbaa_bench.assembly.part_textures import untouched_object
from vbaa_bench.geometry.clutter import Room, Sector, places, thing
from vbaa_bench.geometry.solids import together
from vbaa_bench.geometry.textures import texel_each
from vbaa_bench.render.surface import Surface
from vbaa_bench.scene.clutter import ClutterSpec
from vbaa_bench.scene.paint import Paint
from vbaa_bench.scene.random_streams import random_generator
from vbaa_bench.scene.rigs import TrueRig
from vbaa_bench.scene.schema import Scene

_PAINTS: Final[tuple[Paint, ...]] = ("matt", "gloss", "bare")
CLUTTER: Final = tuple(f"clutter_{paint}" for paint in _PAINTS)
# Roughness of all things.
_ROUGHNESS = 0.35
# A rigid push to a deflection d takes an angle of up to d [rad]; a yielding object takes more.
_ANGLE_OVER_DEFLECTION = 1.5


def clutter_surfaces(
    scene: Scene, rig: TrueRig, folder: Path, pattern_id: int = 0
) -> Iterator[tuple[str, Surface]]:
    """Yield the clutter of a scene in the frame of its ground [m], one surface for each paint.

    `pattern_id` is the number of the random draws.
    """
    spec, ground = scene.clutter, scene.background.height
    assert spec is not None
    random = random_generator(scene, "clutter", pattern_id)
    low, high = np.log(np.array(spec.size_mm) * MILLIMETRE)
    sizes = np.exp(random.uniform(low, high, spec.count))
    height = spec.highest_mm(ground / MILLIMETRE) * MILLIMETRE - ground
    things = [
        thing(kind, float(size), height, random)
        for kind, size in zip(random.choice(spec.things, spec.count), sizes, strict=True)
    ]
    radii = np.array([np.linalg.norm(mesh.vertices[:, :2], axis=1).max() for mesh in things])
    reflectances = random.uniform(*spec.reflectance, spec.count)
    paints = random.choice(_PAINTS, spec.count)
    drawn = places(_room(scene, spec, rig, folder), radii, random)
    for paint, name in zip(_PAINTS, CLUTTER, strict=True):
        chosen = np.flatnonzero((paints == paint) & ~np.isnan(drawn[:, 0]))
        if not len(chosen):
            continue
        for number in chosen:
            things[number].apply_translation([*drawn[number], ground])
        mesh = together([things[number] for number in chosen])
        texture = texel_each([things[number] for number in chosen], reflectances[chosen])
        yield name, Surface(mesh, 0.0, paint, roughness=_ROUGHNESS, texture=texture)


def _room(scene: Scene, spec: ClutterSpec, rig: TrueRig, folder: Path) -> Room:
    """Find the part of the ground in view that the object and the beam leave free."""
    mm, length = MILLIMETRE, rig.beam.length
    low, high = view_of_ground(scene, rig.camera)
    axis = motor_axis(scene)
    angles = _swept_angles(scene)
    # The object is on one side of the beam, as deep as it is.
    depth, half_width = _object_extent(scene, rig, folder)
    near, far = 0.0, length + float(np.linalg.norm(axis))
    distances = _contact_distances(scene)
    if spec.under_beam and distances is not None:
        near, far = max(distances[0] - half_width, 0.0), distances[1] + half_width
    flange = 0.0 if scene.clamp is None else scene.clamp.flange_radius_mm
    hub = max(scene.hub.radius_mm, flange) * mm
    taken = (Sector(axis, (near, far), angles), Sector(axis, (0.0, hub), (-np.pi, np.pi)))
    edge = scene.background.edge
    line = None if edge is None else edge.line(np.array([length / 2, 0.0]))
    return Room(low, high, taken, depth, line)


def _swept_angles(scene: Scene) -> tuple[float, float]:
    """Bound the angles [rad] about the motor's axis at which beam and object are, on the ground."""
    pushes = scene.push_keys
    turns = getattr(pushes, "pushing_angle_deg", None) or (0.0,)
    deflections = pushes.deflection_pct or (0.0,)
    most = math.asin(min(max(deflections) * PERCENT, 1.0))
    low = min(0.0, *turns) * DEGREE
    high = max(max(turns) * DEGREE, _ANGLE_OVER_DEFLECTION * most)
    if scene.background.fixed_to == "antenna":
        return low, high
    first, last = (angle * DEGREE for angle in pushes.motor_angle_at_contact_deg)
    return min(first - high, 0.0), max(last - low, 0.0)


def _contact_distances(scene: Scene) -> tuple[float, float] | None:
    """Return the smallest and largest contact distance [m]; None against a wall."""
    distances = scene.push_keys.contact_distance_mm
    return None if distances is None else (min(distances) * MILLIMETRE, max(distances) * MILLIMETRE)


def _object_extent(scene: Scene, rig: TrueRig, folder: Path) -> tuple[float, float]:
    """Return how far [m] the object extends away from the beam, and to both sides along it."""
    if not scene.object.present:
        return 0.0, 0.0
    vertices = np.asarray(untouched_object(scene, rig, folder).vertices)
    return -float(vertices[:, 1].min()), float(np.abs(vertices[:, 0]).max())
