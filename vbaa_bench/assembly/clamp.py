"""The surfaces of what holds the beam, and whether the object has room beside the clamp's jaw."""

from collections.abc import Iterator
from typing import Final

import cv2
import numpy as np

from solver.instrument.arrays import Floats
from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry import clamp
from vbaa_bench.render.surface import Surface
from vbaa_bench.scene.laboratory import ClampSpec
from vbaa_bench.scene.schema import Scene

# Names of all surfaces that hold the beam.
HOLDER: Final = ("jaw", "screw", "flange", "cable", "adaptor", "hub")
# Length of the cable over the beam's, and its distance behind the jaw where it sinks, over the
# flange's radius. Chosen: it leaves the view, and passes the flange.
_CABLE_LENGTH, _CABLE_REACH = 0.6, 1.6


def holder_surfaces(scene: Scene) -> Iterator[tuple[str, Surface]]:
    """Yield the surfaces of a scene's clamp, adaptor and hub in the clamp's frame [m]."""
    spec, mm = scene.hub, MILLIMETRE
    top, offset = spec.top_mm * mm, np.array(scene.clamp_offset_mm) * mm
    if scene.clamp is not None:
        yield from _clamp_surfaces(scene, scene.clamp)
        if not offset.any():
            # The hub carries the flange: were both tops at one height, either could be seen.
            top = -(scene.clamp.jaw_mm[2] / 2 + scene.clamp.flange_thickness_mm) * mm
    bottom = scene.background.height if spec.bottom_mm is None else spec.bottom_mm * mm
    hub = clamp.hub(spec.radius_mm * mm, bottom, top)
    if offset.any():
        hub.apply_translation(-offset)
        yield "adaptor", Surface.of(clamp.adaptor(offset, spec.radius_mm * mm / 2), spec)
    yield "hub", Surface.of(hub, spec)


def _clamp_surfaces(scene: Scene, spec: ClampSpec) -> Iterator[tuple[str, Surface]]:
    """Yield the surfaces of the clamp, whose cable leads to the ground."""
    mm = MILLIMETRE
    length, width, height = (side * mm for side in spec.jaw_mm)
    jaw = clamp.jaw(length, width, height, scene.beam.diameter_mm * mm)
    yield "jaw", Surface.of(jaw, spec)
    screw = clamp.screw(spec.screw_radius_mm * mm, np.array([-length / 2, 0.0, height / 2]))
    yield "screw", Surface(screw, spec.reflectance, spec.screw_paint, roughness=spec.roughness)
    radius = spec.flange_radius_mm * mm
    flange = clamp.flange(radius, spec.flange_thickness_mm * mm, -height / 2)
    flange.apply_translation(-np.array([*scene.clamp_offset_mm[:2], 0.0]) * mm)
    yield "flange", Surface.of(flange, spec)
    start = np.array([-length, 0.0, -height / 4])
    away = _CABLE_LENGTH * scene.beam.length_mm * mm
    ground = scene.background.height
    cable = clamp.cable(start, _CABLE_REACH * radius, away, spec.cable_radius_mm * mm, ground)
    yield "cable", Surface(cable, spec.cable_reflectance, "gloss", roughness=0.5)


def overlaps_jaw(spec: ClampSpec, points: Floats) -> bool:
    """Test whether the hull of points (n, 3) [m] in the clamp's frame overlaps the jaw, from above.

    It is tested in x and y: an object that reaches plane C is as high as the jaw.
    """
    length, width, _ = (side * MILLIMETRE for side in spec.jaw_mm)
    x, y = [-length, 0.0, 0.0, -length], [-width / 2, -width / 2, width / 2, width / 2]
    jaw = np.column_stack([x, y]).astype(np.float32)
    outline = cv2.convexHull(points[:, :2].astype(np.float32))
    area, _ = cv2.intersectConvexConvex(jaw, outline)
    return area > 0
