"""Construction of a scene's lights. They are fixed relative to the camera, in Sigma_a."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from solver.instrument.errors import InputError
from solver.instrument.units import MILLIMETRE
from vbaa_bench.geometry.sheets import irradiance
from vbaa_bench.render.image_files import SceneImages
from vbaa_bench.scene.lights.ambient import Ambient
from vbaa_bench.scene.lights.emitter import Emitter
from vbaa_bench.scene.lights.light import UP, LightKind, LightSetting
from vbaa_bench.scene.schema import Scene


def lights(scene: Scene, folder: Path, *, panels: bool = True) -> list[Emitter]:
    """Build the lights of a scene; `folder` contains the files that it names. Raises InputError.

    Without `panels`, backlights are off, as for a calibration: a board in front of one is dark. If
    no light is left, or the scene has no `lights`, the soft lamp is used.
    """
    setting, files = scene.light_setting, SceneImages(folder)
    kinds = [kind for kind in scene.lights if panels or kind.panel_mm(setting) is None]
    built = [_emitter(kind, setting, files) for kind in kinds]
    if not built:
        # If the scene has other lights, the camera may be above the default soft lamp.
        built = [scene.light.emitter(setting, raised=bool(scene.lights))]
    if scene.ambient is None:
        return built
    # Lamps hide a part of the surroundings: the irradiance that they would give with radiance 1.
    hidden = sum(_unit_irradiance(light, scene) for light in built)
    unit = 1.0 if scene.lights else hidden  # the soft lamp has radiance 1
    return _with_ambient(built, scene.ambient.irradiance * unit / (np.pi - hidden))


def _emitter(kind: LightKind, setting: LightSetting, files: SceneImages) -> Emitter:
    """Build a light. Raises InputError if a user's kind returns something else."""
    built: object = kind.emitter(setting, files)
    if not isinstance(built, Emitter):
        raise InputError(
            f"lights: emitter of the kind {kind.kind} has returned {type(built).__name__}, allowed "
            "is one Emitter; `together` makes one mesh of several sheets"
        )
    return built


def _unit_irradiance(light: Emitter, scene: Scene) -> float:
    """Compute the irradiance of plane C where the camera looks, if a lamp had radiance 1.

    It is 0 for a light that hides nothing of the surroundings above plane C.
    """
    lamp = light.sheet
    if lamp is None or lamp.mesh.vertices[:, 2].min() <= 0:
        return 0.0
    aim = np.array(scene.camera.look_at_mm) * MILLIMETRE * [1, 1, 0]
    return irradiance(lamp.mesh, aim, UP)


def _with_ambient(built: Sequence[Emitter], radiance: float) -> list[Emitter]:
    """Add light of the same radiance from all directions.

    Mitsuba allows one light around a scene: it is added to an environment's radiances.
    """
    brighter = [light.with_ambient(radiance) for light in built]
    merged = [new or old for new, old in zip(brighter, built, strict=True)]
    return merged if any(brighter) else [*merged, Ambient(radiance)]
