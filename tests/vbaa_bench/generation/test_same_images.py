"""Images of four small scenes are those that were made before, on every machine.

On the same kind of processor their bytes are equal; elsewhere one gray value in a thousand may
differ, as vectors of another width make it. `make golden` compares whole scenes of two versions.

  python -m tests.vbaa_bench.generation.test_same_images     makes the images anew
"""

import shutil
import tempfile
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from solver.instrument.arrays import Grey
from solver.instrument.images import png_bytes, read_grey
from vbaa_bench.assembly.plan import plan
from vbaa_bench.dataset.target import FAST, processor, reference_target
from vbaa_bench.generation.frame_renderer import FrameRenderer, metered_frames
from vbaa_bench.render.variant import choose
from vbaa_bench.scene.load import load_scene

IMAGES: Final = Path(__file__).parents[2] / "data" / "images"
MADE_ON: Final = IMAGES / "processor.txt"
MESH: Final = Path(__file__).parents[3] / "scenes" / "objects" / "hexagon.stl"
CAMERA: Final = """
title: A small image
seed: 7
camera: {width_px: 96, height_px: 40, focal_length_px: 130, position_mm: [120, 14, 360],
         look_at_mm: [120, 14, 0]}
calibration: {columns: 20, rows: 5, square_mm: 10, center_mm: [120, 20], views: 3}
render: {noise_near_beam: 2, noise_elsewhere: 2, noise_static_layer: 2}
"""
SCENES: Final = {
    "block": """
background: {pattern: textured}
lights: [{kind: area, position_mm: [60, -250, 420], size_mm: [300, 200]}]
sensor: {full_well_e: 2000, read_noise_e: 20, prnu_pct: 2, dsnu_e: 10, gamma: 1.4}
pushes: {contact_distance_mm: [150], deflection_pct: [15]}
""",
    "knife_edge": """
object: {kind: knife_edge}
occlusion: {kind: [leaves], place: [middle], availability: [0.7], count: 5}
lights: [{kind: environment}]
pushes: {contact_distance_mm: [120], normal_deg: [30], deflection_pct: [10]}
""",
    "mesh": """
object: {kind: mesh, file: hexagon.stl}
beam: {grime: {smudge_contrast: 0.2, dust_pct: 2}}
optics: {aperture_mm: 4, focus_distance_mm: 340, vignetting_pct: 10}
lights: [{kind: spot, position_mm: [-40, -180, 350]}, {kind: ring}]
pushes: {contact_distance_mm: [140], deflection_pct: [12]}
""",
    "two_pegs": """
object: {kind: peg}
second_peg: {distance_mm: 190, gap_mm: 1}
background: {pattern: squares}
clutter: {count: 10, top_mm: -9}
sensor: {kind: ideal}
pushes: {contact_distance_mm: [90], pushing_angle_deg: [6]}
""",
}
# Share of gray values that may differ elsewhere. Measured with vectors of 4 and 16 values: none,
# but 0.2 % on a texture, whose places are known to a thousandth of its pixel.
ELSEWHERE: Final = {"block": 4e-3}


def rendered(text: str, folder: Path) -> Grey:
    """The frame of a scene."""
    shutil.copy(MESH, folder)
    path = folder / "scene.yaml"
    path.write_text(CAMERA + text, encoding="utf-8")
    file = load_scene(path)
    planned = plan(file)
    specs = list(planned.frame_specs)
    renderer = FrameRenderer(file.scene, planned.rig, folder, FAST, 1)
    image, _ = renderer.expose_frame(specs[-1], renderer.meter(metered_frames(specs)))
    return image


@pytest.mark.parametrize("name", SCENES)
def test_the_image_is_the_one_made_before(name: str, variant: str, tmp_path: Path) -> None:
    if variant != FAST:
        pytest.skip("another variant renders other images")
    image, before = rendered(SCENES[name], tmp_path), read_grey(IMAGES / f"{name}.png")
    assert np.ptp(before) > 100
    differ = np.mean(image != before)
    made_here = f"{processor()}, {reference_target(FAST)}" == MADE_ON.read_text("utf-8").strip()
    assert differ == 0 if made_here else differ <= ELSEWHERE.get(name, 1e-3)


def main() -> None:
    """Make the images anew."""
    assert choose() == FAST
    IMAGES.mkdir(parents=True, exist_ok=True)
    for name, text in SCENES.items():
        with tempfile.TemporaryDirectory() as folder:
            (IMAGES / f"{name}.png").write_bytes(png_bytes(rendered(text, Path(folder))))
    MADE_ON.write_text(f"{processor()}, {reference_target(FAST)}\n", "utf-8")


if __name__ == "__main__":
    main()
