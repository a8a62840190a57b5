"""Contact sheet: one frame of every scene in one image, without repeating those that look alike."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from solver.instrument.arrays import Floats, Grey
from solver.instrument.files import write_bytes
from solver.instrument.images import eight_bit
from solver.instrument.transforms import apply
from vbaa_bench.assembly.plan import Plan, plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.generation.frame_renderer import FrameRenderer, Metering
from vbaa_bench.scene.frames import FrameSpec
from vbaa_bench.scene.load import SceneFile, load_scene

# The sheet of lights uses these sizes, too.
TILE_PX, CAPTION_PX = 360, 26
PAPER, INK = 245, 30
# A tile has the part of the image with the beam, STRIP_PX wide and high, and the contact enlarged.
# The strip's shape is that of scenes with 512 x 176 px, which most are.
STRIP_PX: Final = (348, 120)
COLUMNS, GAP_PX = 4, 8
# Magnification and half size of the picture of the contact.
ZOOM, HALF_PX = 5, 12
WIDTH_PX: Final = STRIP_PX[0] + 2 * ZOOM * HALF_PX
_LINE_PX: Final = 15
_LETTERS: Final = 70
# Largest mean difference [gray values of 255] of scenes that look alike. Chosen: noise, a bow or
# another force change 0.6 to 4, another object, light or beam 5 to 12.
_ALIKE: Final = 5.0
# The enlarged contact is blurred over five pixels, so that small shifts of the beam do not count.
_BLUR_PX: Final = 5 * ZOOM


@dataclass
class Tile:
    """A picture of a scene, and the names of all scenes that look like it."""

    picture: Grey
    names: list[str]

    def looks_like(self, picture: Grey) -> bool:
        """Compare the enlarged contacts, and the distributions of gray values of the strips."""
        strips, contacts = zip(*map(_look, (self.picture, picture)), strict=True)
        return all(np.abs(one - other).mean() < _ALIKE for one, other in (strips, contacts))


def contact_sheet(
    scenes: Sequence[Path], out: Path, variant: str, progress: Callable[[int, int], None]
) -> None:
    """Render a frame of every scene and write them as one PNG.

    A scene that looks like an earlier one is only named, below its picture. Raises InputError.
    """
    tiles: list[Tile] = []
    # Scenes of the paper first: others are then named below them.
    for number, path in enumerate(sorted(scenes, key=lambda path: (len(path.parts), path))):
        file = load_scene(path)
        add(tiles, _picture(*photograph(file, variant)), _name(path))
        progress(number + 1, len(scenes))
    rows = [_row(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    success, data = cv2.imencode(".png", np.vstack(rows), [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert success
    write_bytes(out, data.tobytes())


def add(tiles: list[Tile], picture: Grey, name: str) -> None:
    """Add a scene to the first tile that looks like it, or as a new tile."""
    alike = next((tile for tile in tiles if tile.looks_like(picture)), None)
    if alike is None:
        tiles.append(Tile(picture, [name]))
    else:
        alike.names.append(name)


def _look(picture: Grey) -> tuple[Floats, Floats]:
    """Describe a picture by what does not depend on where the beam is in the strip."""
    strip, contact = picture[:, : STRIP_PX[0]], picture[:, STRIP_PX[0] :]
    blurred = cv2.blur(np.asarray(contact, np.float64), (_BLUR_PX, _BLUR_PX))
    return np.quantile(strip, np.linspace(0.02, 0.98, 25)), np.asarray(blurred)


def _name(path: Path) -> str:
    group = path.parent.name
    return path.stem if group == "scenes" else f"{group}/{path.stem}"


def _row(tiles: Sequence[Tile]) -> np.ndarray:
    """Draw tiles side by side: the first name above a picture, the others below it."""
    notes = [_lines(tile.names[1:]) for tile in tiles]
    height = CAPTION_PX + STRIP_PX[1] + max(map(len, notes)) * _LINE_PX + GAP_PX
    row = np.full((height, COLUMNS * (WIDTH_PX + GAP_PX)), PAPER, np.uint8)
    for column, (tile, lines) in enumerate(zip(tiles, notes, strict=True)):
        left = column * (WIDTH_PX + GAP_PX)
        _write(row, tile.names[0], (left + 2, 18), 0.5)
        row[CAPTION_PX : CAPTION_PX + STRIP_PX[1], left : left + WIDTH_PX] = tile.picture
        for number, line in enumerate(lines):
            top = CAPTION_PX + STRIP_PX[1] + _LINE_PX * (number + 1) - 3
            _write(row, line, (left + 2, top), 0.38)
    return row


def _lines(names: Sequence[str]) -> list[str]:
    """Break the names of scenes that look alike into lines."""
    lines: list[str] = []
    for number, name in enumerate(names):
        word = name if number == len(names) - 1 else f"{name},"
        if lines and len(lines[-1]) + len(word) < _LETTERS:
            lines[-1] += f" {word}"
        else:
            lines.append(word if lines else f"alike: {word}")
    return lines


def _write(canvas: np.ndarray, text: str, at: tuple[int, int], size: float) -> None:
    cv2.putText(canvas, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, INK, 1, cv2.LINE_AA)


def _picture(image: Grey, renderer: FrameRenderer, pose: Pose) -> Grey:
    """Draw the part of an image with the beam, and the enlarged contact (without contact, tip)."""
    beam = _pixels(pose.state.centreline[:, 1:], pose, renderer)
    contacts = pose.state.contacts
    point = _pixels(contacts[0].point[None], pose, renderer)[0] if contacts else beam[-1]
    return np.hstack([brightened(_strip(image, beam)), brightened(_surroundings(image, point))])


def _strip(image: Grey, beam: Floats) -> Grey:
    """Cut the image to the beam, in the shape of STRIP_PX; paper where the image is smaller."""
    height, width = image.shape
    low, high = (float(np.clip(end, 0, height - 1)) for end in (beam[:, 1].min(), beam[:, 1].max()))
    tall = min(max(width * STRIP_PX[1] / STRIP_PX[0], high - low + 20), height)
    top = int(np.clip((low + high - tall) / 2, 0, height - tall))
    part = image[top : top + round(tall)]
    scale = min(STRIP_PX[0] / width, STRIP_PX[1] / len(part))
    size = (min(round(width * scale), STRIP_PX[0]), min(round(len(part) * scale), STRIP_PX[1]))
    strip = np.full(STRIP_PX[::-1], PAPER, np.uint8)
    left, above = ((whole - cut) // 2 for whole, cut in zip(STRIP_PX, size, strict=True))
    strip[above : above + size[1], left : left + size[0]] = cv2.resize(
        part, size, interpolation=cv2.INTER_AREA
    )
    return strip


def photograph(file: SceneFile, variant: str) -> tuple[Grey, FrameRenderer, Pose]:
    """Render a scene's representative frame; return its 8-bit image, renderer and pose."""
    scene_plan = plan(file)
    folder = file.folder.resolve()
    renderer = FrameRenderer(file.scene, scene_plan.rig, folder, variant, threads=0)
    spec = _representative_frame(scene_plan, renderer)
    image, _ = renderer.expose_frame(spec, Metering(renderer.measure_exposure()))
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


def _pixels(points: Floats, pose: Pose, renderer: FrameRenderer) -> Floats:
    """Project points (n, 3) in the clamp's frame to pixels (n, 2)."""
    in_camera_frame = apply(pose.camera_frame_from_clamp, points) + renderer.rig.base_position
    pixels: Floats = renderer.rig.camera.project(in_camera_frame)
    return pixels


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
