"""Construction of a scene's lights. They are fixed relative to the camera, in Sigma_a."""

from pathlib import Path

import numpy as np
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.transforms import turn_about_z
from solver.instrument.units import DEGREE, MILLIMETRE
from vbaa_bench.geometry import lamps
from vbaa_bench.geometry.objects import sheet
from vbaa_bench.render.environment import (
    laboratory,
    plane_irradiance,
    read_environment,
    rotated,
)
from vbaa_bench.render.lights import Ambient, Environment, Lamp, Light, Projector, Spot
from vbaa_bench.scene.lighting import (
    AreaSpec,
    BackSpec,
    EnvironmentSpec,
    LampSpec,
    RingSpec,
    SideSpec,
    SpotSpec,
    StripeSpec,
)
from vbaa_bench.scene.schema import Scene

ALONG = np.array([1.0, 0.0, 0.0])
UP = np.array([0.0, 0.0, 1.0])
# Pixels of the stripe's slide across the width of a blurred edge.
EDGE_PX = 8


def lights(scene: Scene, folder: Path, *, panels: bool = True) -> list[Light]:
    """Build the lights of a scene; `folder` contains the files that it names. Raises InputError.

    Without `panels`, backlights are off, as for a calibration: a board in front of one is dark. If
    no light is left, or the scene has no `lights`, the soft lamp is used.
    """
    built, ambient = _lamps(scene, folder, panels), scene.ambient
    if ambient is None:
        return built
    # Lamps hide a part of the surroundings: the irradiance that they would give with radiance 1.
    hidden = sum(_unit_irradiance(light, scene) for light in built)
    unit = 1.0 if scene.lights else hidden  # the soft lamp has radiance 1
    return _with_ambient(built, ambient.irradiance * unit / (np.pi - hidden))


def _unit_irradiance(light: Light, scene: Scene) -> float:
    """Compute the irradiance of plane C where the camera looks, if a lamp had radiance 1.

    It is 0 for a light that hides nothing of the surroundings above plane C.
    """
    if not isinstance(light, Lamp) or light.mesh.vertices[:, 2].min() <= 0:
        return 0.0
    aim = _mm(scene.camera.look_at_mm) * [1, 1, 0]
    return lamps.irradiance(light.mesh, aim, UP)


def _with_ambient(built: list[Light], radiance: float) -> list[Light]:
    """Add light of the same radiance from all directions.

    Mitsuba allows one light around a scene: it is added to an environment's radiances.
    """
    merged: list[Light] = [
        Environment(light.image + radiance) if isinstance(light, Environment) else light
        for light in built
    ]
    has_environment = any(isinstance(light, Environment) for light in built)
    return merged if has_environment else [*merged, Ambient(radiance)]


def _lamps(scene: Scene, folder: Path, panels: bool) -> list[Light]:
    """Build the lights of `light` or `lights`."""
    specs = [spec for spec in scene.lights if panels or spec.kind != "back"]
    if specs:
        return [_light(spec, scene, folder) for spec in specs]
    x, y, z = scene.camera.position_mm
    # If the scene has other lights, the camera may be above the default soft lamp: raise the lamp.
    height = max(scene.light.height_mm, 1.1 * z) if scene.lights else scene.light.height_mm
    middle = np.array([x, y, height]) * MILLIMETRE
    return [Lamp(sheet(middle, scene.light.side_mm * MILLIMETRE, -1))]


def _light(spec: LampSpec, scene: Scene, folder: Path) -> Light:
    camera, looked_at = _mm(scene.camera.position_mm), _mm(scene.camera.look_at_mm)
    match spec:
        case RingSpec():
            ahead = looked_at - camera
            radii = spec.inner_radius_mm * MILLIMETRE, spec.outer_radius_mm * MILLIMETRE
            return _lamp(lamps.annulus(camera, ahead, *radii), looked_at, spec.irradiance)
        case BackSpec():
            height = (spec.height_above_background_mm - scene.background.distance_mm) * MILLIMETRE
            middle = np.array([looked_at[0], looked_at[1], height])
            panel = lamps.rectangle(middle, UP, ALONG, _sides(spec.size_mm))
            return _lamp(panel, middle * [1, 1, 0], spec.irradiance)
        case SideSpec():
            away = turn_about_z(spec.azimuth_deg * DEGREE)[:3, :3] @ ALONG
            elevation = spec.elevation_deg * DEGREE
            direction = np.cos(elevation) * away + np.sin(elevation) * UP
            middle = looked_at + spec.distance_mm * MILLIMETRE * direction
            horizontal = np.cross(UP, away)
            panel = lamps.rectangle(middle, -direction, horizontal, _sides(spec.size_mm))
            return _lamp(panel, looked_at, spec.irradiance)
        case EnvironmentSpec():
            image = laboratory() if spec.file is None else read_environment(folder, spec.file)
            image = rotated(image, spec.rotation_deg * DEGREE)
            return Environment(image * spec.irradiance / plane_irradiance(image))
    position = _mm(spec.position_mm)
    aim = looked_at if spec.aim_mm is None else _mm(spec.aim_mm)
    match spec:
        case AreaSpec():
            panel = lamps.rectangle(position, aim - position, ALONG, _sides(spec.size_mm))
            return _lamp(panel, aim, spec.irradiance)
        case SpotSpec():
            return Spot(position, aim, spec.cone_angle_deg * DEGREE, spec.irradiance)
        case StripeSpec():
            width, slide = _stripe(spec)
            along = lamps.axes(aim - position, ALONG)[0]
            return Projector(position, aim, along, width, slide, spec.irradiance)


def _lamp(panel: trimesh.Trimesh, aim: Floats, irradiance: float) -> Lamp:
    """Build a lamp whose radiance gives the irradiance on a sheet at the aim that faces it."""
    towards = np.asarray(panel.vertices).mean(axis=0) - aim
    unit_irradiance = lamps.irradiance(panel, aim, towards / np.linalg.norm(towards))
    return Lamp(panel, irradiance / unit_irradiance)


def _stripe(spec: StripeSpec) -> tuple[float, Floats]:
    """Return a slide's width [m] at the aim, and its image (height, width), 1 in the stripe."""
    pixel = spec.edge_width_mm / EDGE_PX
    sides = []
    for size in (spec.length_mm, spec.width_mm):
        count = int(np.ceil((size + 2 * spec.edge_width_mm) / pixel))
        positions = (np.arange(count) - (count - 1) / 2) * pixel
        # Half a sine wave from light to dark, similar to an edge slightly out of focus.
        edge = np.clip((np.abs(positions) - size / 2) / spec.edge_width_mm, -0.5, 0.5)
        sides.append(0.5 - 0.5 * np.sin(np.pi * edge))
    along, across = sides
    return len(along) * pixel * MILLIMETRE, np.outer(across, along)


def _mm(position: tuple[float, float, float]) -> Floats:
    return np.array(position) * MILLIMETRE


def _sides(size_mm: tuple[float, float]) -> tuple[float, float]:
    return size_mm[0] * MILLIMETRE, size_mm[1] * MILLIMETRE
