"""Rest images show the surfaces that do not move as the frames do."""

from pathlib import Path

import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.clutter import CLUTTER
from vbaa_bench.assembly.plan import plan
from vbaa_bench.assembly.shared_world import SharedWorld, rest_grime_id, shared_world
from vbaa_bench.generation.frame_renderer import FrameRenderer, Metering
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.render.world import World
from vbaa_bench.scene.load import load_scene

KNOCKED = """
background: {pattern: squares, reflectance: 0.4, square_turn_deg: 30}
render: {noise_near_beam: 3, noise_elsewhere: 3, noise_static_layer: 2}
"""
EXTRA = """
clutter: {count: 30, size_mm: [6, 30], top_mm: -9}
object: {kind: cylinder, radius_mm: {uniform: [4, 30], per: push}}
"""


def _clutter(world: World) -> Floats:
    return np.vstack([world.vertices[name] for name in CLUTTER if name in world.names])


@pytest.mark.thorough
def test_clutter_is_the_same_at_rest_as_in_frames(tmp_path: Path, variant: str) -> None:
    """Although the object, whose way it must not be in, is drawn for each push and rest image."""
    path = tmp_path / "scene.yaml"
    path.write_text(SMALL_SCENE + EXTRA, encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    renderer = FrameRenderer(file.scene, work.rig, tmp_path, variant, 1)
    rest = [_clutter(renderer.rest_world(number)) for number in range(3)]
    specs = work.frame_specs[: file.scene.frames_per_shard]
    pushed = [_clutter(renderer.pushed_world(renderer.pose(spec))) for spec in specs]
    assert rest[0].size
    for other in (*rest[1:], *pushed):
        np.testing.assert_array_equal(other, rest[0])


@pytest.mark.parametrize("per", ["rig", "push", "frame"])
def test_a_beam_has_the_same_dirt_at_rest_as_in_frames(tmp_path: Path, per: str) -> None:
    """Unless it is the dirt that is drawn for each push or frame; a new object changes nothing."""
    path = tmp_path / "scene.yaml"
    dirt = f"\nbeam: {{grime: {{smudge_contrast: {{uniform: [0.1, 0.2], per: {per}}}}}}}\n"
    path.write_text(SMALL_SCENE + EXTRA + dirt, encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    patterns = [rest_grime_id(file.scene, number) for number in range(2)]
    last: SharedWorld | None = None
    specs = work.frame_specs[: file.scene.frames_per_shard]
    for spec in specs:
        last = shared_world(file.scene, work.rig, tmp_path, spec, last)
        patterns.append(last.assembler.grime_id)
    pushes = {spec.push_id for spec in specs}
    count = {"rig": 1, "push": 2 + len(pushes), "frame": 2 + len(specs)}
    assert len(set(patterns)) == count[per]


@pytest.mark.thorough
@pytest.mark.parametrize("knock", [0, 3])
def test_a_camera_that_was_knocked_shows_the_ground_elsewhere(
    tmp_path: Path, variant: str, knock: int
) -> None:
    if variant == PLAIN:
        pytest.skip("whole images take too long")
    path = tmp_path / "scene.yaml"
    text = SMALL_SCENE.replace("camera:\n", f"camera:\n  knock_px: [{knock}, 0]\n")
    path.write_text(text + KNOCKED, encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    renderer = FrameRenderer(file.scene, work.rig, tmp_path, variant, 1)
    metering = Metering(renderer.measure_exposure())
    rest = renderer.rest_image(0, metering.exposure).astype(np.float32)
    frame = renderer.frame(work.frame_specs[0], metering).image.astype(np.float32)
    # The ground below the beam and its object.
    off = {
        du: float(np.abs(frame[-60:-5, 100 + du : 450 + du] - rest[-60:-5, 100:450]).mean())
        for du in range(-4, 5)
    }
    assert min(off, key=lambda du: off[du]) == knock
