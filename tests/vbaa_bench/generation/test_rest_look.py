"""Rest images show the surfaces that do not move as the frames do."""

from pathlib import Path

import numpy as np

from solver.instrument.arrays import Floats
from tests.conftest import SMALL_SCENE
from vbaa_bench.assembly.clutter import CLUTTER
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.generation.plan import plan
from vbaa_bench.render.world import World
from vbaa_bench.scene.load import load_scene

EXTRA = """
clutter: {count: 30, size_mm: [6, 30], top_mm: -9}
object: {kind: cylinder, radius_mm: {uniform: [4, 30], per: push}}
"""


def _clutter(world: World) -> Floats:
    return np.vstack([world.vertices[name] for name in CLUTTER if name in world.names])


def test_clutter_is_the_same_at_rest_as_in_frames(tmp_path: Path, variant: str) -> None:
    """Although the object, whose way it must not be in, is drawn for each push and rest image."""
    path = tmp_path / "scene.yaml"
    path.write_text(SMALL_SCENE + EXTRA, encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    renderer = FrameRenderer(file.scene, work.rig, tmp_path, Layout(tmp_path), variant, 1)
    rest = [_clutter(renderer.rest_world(number)) for number in range(3)]
    pushed = [_clutter(renderer.pushed_world(renderer.pose(s))) for s in work.shards[0]]
    assert len(rest[0]) > 100
    for other in (*rest[1:], *pushed):
        np.testing.assert_array_equal(other, rest[0])
