"""Contact sheet: one frame of every scene in one image."""

from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Grey
from solver.instrument.files import write_bytes
from solver.instrument.images import eight_bit
from solver.instrument.transforms import apply
from vbaa_bench.assembly.scene_assembler import Pose
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.generation.frame_renderer import FrameRenderer, Metering
from vbaa_bench.generation.plan import Plan, plan
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.load import SceneFile, load_scene

TILE_PX, CAPTION_PX, COLUMNS = 360, 26, 6
# Magnification and half size of the inset at the contact, in the tile's lower right corner.
ZOOM, HALF_PX = 5, 14
PAPER, INK = 245, 30


def contact_sheet(
    scenes: Sequence[Path], out: Path, variant: str, progress: Callable[[int, int], None]
) -> None:
    """Render a frame of every scene and write them as one PNG. Raises InputError."""
    tiles = []
    for number, path in enumerate(scenes):
        tiles.append(_tile(load_scene(path), variant))
        progress(number + 1, len(scenes))
    tiles += [np.full_like(tiles[0], PAPER)] * (-len(tiles) % COLUMNS)
    rows = [np.hstack(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    success, data = cv2.imencode(".png", np.vstack(rows), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert success
    write_bytes(out, data.tobytes())


def _tile(file: SceneFile, variant: str) -> np.ndarray:
    image, renderer, pose = photograph(file, variant)
    tile = np.full((CAPTION_PX + TILE_PX, TILE_PX), PAPER, np.uint8)
    group = file.path.parent.name
    name = file.path.stem if group == "scenes" else f"{group}/{file.path.stem}"
    cv2.putText(tile, name, (4, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, INK, 1, cv2.LINE_AA)
    scale = TILE_PX / max(image.shape)
    resized = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    thumbnail = np.asarray(resized, dtype=np.uint8)
    tile[CAPTION_PX : CAPTION_PX + thumbnail.shape[0], : thumbnail.shape[1]] = brightened(thumbnail)
    if pose.state.contacts:
        inset = brightened(_surroundings(image, _contact_pixel(pose, renderer)))
        side = len(inset)
        tile[-side:, -side:] = inset
        cv2.rectangle(tile, (TILE_PX - side, len(tile) - side), (TILE_PX - 1, len(tile) - 1), 160)
    return tile


def photograph(file: SceneFile, variant: str) -> tuple[Grey, FrameRenderer, Pose]:
    """Render a scene's representative frame; return its 8-bit image, renderer and pose."""
    scene_plan = plan(file)
    folder = file.path.parent.resolve()
    renderer = FrameRenderer(file.scene, scene_plan.rig, folder, Layout(Path()), variant, threads=0)
    spec = _representative_frame(scene_plan, renderer)
    image, _ = renderer.photograph(spec, Metering(renderer.measure_exposure(lambda: None)))
    return eight_bit(image), renderer, renderer.pose(spec)


def _representative_frame(scene_plan: Plan, renderer: FrameRenderer) -> FrameSpec:
    """Choose a frame of the largest push and occlusion, with a contact of medium distance."""
    trials = list(scene_plan.frame_specs)
    availability = min((t.cover.availability for t in trials if t.cover is not None), default=1.0)
    candidates = [t for t in trials if t.cover is None or t.cover.availability == availability]
    candidates = [
        t for t in candidates if t.cover is None or t.cover.kind != "removed"
    ] or candidates
    largest = {
        t.push: max(t.push.targets, key=lambda g: g.pushing_angle or g.deflection or 0)
        for t in candidates
    }
    candidates = [t for t in candidates if t.target == largest[t.push]]
    candidates.sort(key=lambda t: (renderer.pose(t).state.pushing_angle, t.index))
    return candidates[len(candidates) // 2]


def _contact_pixel(pose: Pose, renderer: FrameRenderer) -> Floats:
    camera_frame_from_clamp = pose.camera_frame_from_clamp
    point = (
        apply(camera_frame_from_clamp, pose.state.contact.point[None]) + renderer.rig.base_position
    )
    pixel: Floats = renderer.rig.camera.project(point)[0]
    return pixel


def _surroundings(image: Grey, pixel: Floats) -> Grey:
    """Crop the image around a pixel, and enlarge it."""
    u, v = np.rint(pixel).astype(int)
    left = int(np.clip(u - HALF_PX, 0, image.shape[1] - 2 * HALF_PX))
    top = int(np.clip(v - HALF_PX, 0, image.shape[0] - 2 * HALF_PX))
    crop = image[top : top + 2 * HALF_PX, left : left + 2 * HALF_PX]
    large: Grey = np.kron(crop, np.ones((ZOOM, ZOOM), np.uint8))
    return large


def brightened(image: Grey) -> Grey:
    """Brighten an image of linear sensor values for display."""
    bright: Grey = np.rint(255 * (image / 255) ** 0.6).astype(np.uint8)
    return bright
