"""The clamp's surfaces, and whether the object has room beside its jaw."""

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

CLAMP: Final = ("jaw", "screw", "flange", "cable")
# Length of the cable over the beam's, and its distance behind the jaw where it sinks, over the
# flange's radius. Chosen: it leaves the view, and passes the flange.
_CABLE_LENGTH, _CABLE_REACH = 0.6, 1.6


def clamp_surfaces(scene: Scene, ground: float) -> Iterator[tuple[str, Surface]]:
    """Yield the surfaces of a scene's clamp in the clamp's frame [m], above a `ground` [m]."""
    spec, mm = scene.clamp, MILLIMETRE
    assert spec is not None
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
