"""Lighting sheet: one image of the same push under each light, by material and background."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from results.pictures.contact_sheet import CAPTION_PX, INK, PAPER, brightened, photograph
from solver.instrument.files import write_bytes
from vbaa_bench.scene.camera import CalibrationSpec, CameraSpec
from vbaa_bench.scene.load import SceneFile, load_scene
from vbaa_bench.scene.push import PushSpec
from vbaa_bench.scene.rendering import RenderSpec
from vbaa_bench.scene.schema import Scene

TILE_PX, GAP_PX = 288, 4
# Nearer than a scene's own camera and oblique, as in a photograph of a rig.
CAMERA = CameraSpec(
    width_px=TILE_PX,
    height_px=TILE_PX,
    focal_length_px=640,
    position_mm=(62.0, -110.0, 240.0),
    look_at_mm=(55.0, 6.0, -4.0),
    tip_in_view=False,
)
BOARD = CalibrationSpec(square_mm=3, center_mm=(55.0, 6.0))
PUSH = PushSpec(contact_distance_mm=(80,), deflection_pct=(20,))
# Three bounces: bare steel is black except for its reflections.
RENDER = RenderSpec(bounces=3, noise_near_beam=0.5, noise_elsewhere=1.0, noise_static_layer=0.5)
# Changes to the scene in each column.
LOOKS: dict[str, dict[str, dict[str, Any]]] = {
    "painted, plain": {},
    "bare, plain": {
        "beam": {"paint": "bare"},
        "object": {"paint": "bare", "roughness": 0.2},
        "hub": {"paint": "bare", "roughness": 0.2},
        "background": {"reflectance": 0.18},
    },
    "bare, wood": {
        "beam": {"paint": "bare"},
        "object": {"paint": "gloss", "reflectance": 0.6},
        "background": {
            "pattern": "textured",
            "reflectance": 0.25,
            "contrast": 0.25,
            "correlation_mm": 2.5,
            "correlation_ratio": 15,
        },
    },
    "painted, felt": {
        "object": {"paint": "bare"},
        "background": {
            "pattern": "textured",
            "reflectance": 0.15,
            "contrast": 0.35,
            "correlation_mm": 1.5,
        },
    },
    "black, graded": {
        "beam": {"paint": "black"},
        "object": {"paint": "gloss", "reflectance": 0.4},
        "hub": {"paint": "gloss", "reflectance": 0.2},
        "background": {
            "pattern": "graded",
            "reflectance": 0.2,
            "far_reflectance": 0.7,
            "gradient_mm": 140.0,
        },
    },
    "painted, squares": {
        "object": {"paint": "black"},
        "background": {"pattern": "squares", "reflectance": 0.12, "square_reflectance": 0.05},
    },
}


def lighting_sheet(
    scenes: Sequence[Path], out: Path, variant: str, progress: Callable[[int, int], None]
) -> None:
    """Render a frame of every scene in every look and write them as one PNG. Raises InputError."""
    rows = []
    for number, path in enumerate(scenes):
        file = load_scene(path)
        tiles = []
        for column, (name, look) in enumerate(LOOKS.items()):
            tiles.append(_tile(file, look, f"{path.stem}: {name}", variant))
            progress(number * len(LOOKS) + column + 1, len(scenes) * len(LOOKS))
        rows.append(np.hstack(tiles))
    success, data = cv2.imencode(".png", np.vstack(rows), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert success
    write_bytes(out, data.tobytes())


def _tile(
    file: SceneFile, look: dict[str, dict[str, Any]], caption: str, variant: str
) -> np.ndarray:
    image, _, _ = photograph(SceneFile(file.path, dressed(file.scene, look), {}), variant)
    tile = np.full((CAPTION_PX + TILE_PX, TILE_PX + GAP_PX), PAPER, np.uint8)
    cv2.putText(tile, caption, (2, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.45, INK, 1, cv2.LINE_AA)
    tile[CAPTION_PX:, :TILE_PX] = brightened(image)
    return tile


def dressed(scene: Scene, look: dict[str, dict[str, Any]]) -> Scene:
    """Change a scene to another look and to the sheet's own camera, board, push and rendering."""
    changes: dict[str, Any] = {
        part: getattr(scene, part).model_copy(update=update) for part, update in look.items()
    }
    changes |= {"camera": CAMERA, "calibration": BOARD, "pushes": PUSH, "render": RENDER}
    return scene.model_copy(update=changes)
