"""The change of a pixel by one scene after the other, as on a GPU: as in both scenes at once."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from solver.instrument.arrays import Floats
from tests.draws import scene_seed, seeded
from vbaa_bench.assembly.plan import plan
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.render import tracing
from vbaa_bench.render.tracing import trace
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.render.world import World
from vbaa_bench.scene.load import load_scene

SCENE = seeded("""
title: A soft lamp, a block that shades the ground, and a beam
seed: 5
camera:
  width_px: 72
  height_px: 32
  focal_length_px: 180
  position_mm: [60.0, 10.0, 300.0]
  look_at_mm: [60.2, 10.0, 0.0]
  tip_in_view: false
calibration: {columns: 6, rows: 3, square_mm: 8, center_mm: [60.0, 10.0]}
lights: [{kind: side, azimuth_deg: 120, elevation_deg: 30, size_mm: [300, 150]}]
object: {kind: block, side_mm: 20, top_mm: 6}
pushes: {contact_distance_mm: [60], deflection_pct: [10]}
""")
# Seeds that are averaged, and samples per set.
SEEDS, SET_SIZE = 16, 32
# The chance that two unbiased estimates are taken for different ones, in any of the rows.
FALSE_ALARM = 1e-5


@pytest.fixture(
    params=[1, pytest.param(2, marks=pytest.mark.thorough)], ids=["direct", "reflected"]
)
def world(request: pytest.FixtureRequest, variant: str, tmp_path: Path) -> World:
    if variant == PLAIN:
        pytest.skip("it renders whole images, of one scene after the other")
    path = tmp_path / "block.yaml"
    path.write_text(SCENE + f"render: {{bounces: {request.param}}}", encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    renderer = FrameRenderer(file.scene, work.rig, tmp_path, variant, 2)
    return renderer.pushed_world(renderer.pose(work.frame_specs[0]))


def changes(world: World) -> tuple[Floats, Floats]:
    """Estimate the change (seeds, h, w) of every pixel, and the beam's cover of it."""
    shape = (world.camera.height, world.camera.width)
    rows, columns = np.indices(shape).reshape(2, -1)
    pixels, size = np.column_stack([columns, rows]), np.full(rows.size, SET_SIZE)
    traced = [trace(world, pixels, size, scene_seed(seed), "change") for seed in range(SEEDS)]
    radiance, cover = [t.radiance for t in traced], [t.coverage for t in traced]
    return np.reshape(radiance, (-1, *shape)), np.reshape(cover, (-1, *shape))


def test_the_change_is_the_same_in_one_scene_after_the_other(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    both, both_cover = changes(world)
    monkeypatch.setattr(tracing, "uses_optix", lambda: True)
    world._frozen.clear()
    after, after_cover = changes(world)
    assert np.abs(both).max() > 0.01
    changed = (both != 0).any(axis=(0, 2))
    rows = [radiance[:, changed].sum(axis=2) for radiance in (both, after)]
    p = stats.ttest_ind(*rows, equal_var=False).pvalue
    assert p.min() > FALSE_ALARM / changed.sum()
    p = stats.ttest_ind(both_cover.sum((1, 2)), after_cover.sum((1, 2)), equal_var=False).pvalue
    assert p > FALSE_ALARM
    if world.bounces == 1:  # else light from the moving parts reaches all pixels
        untouched = (both == 0).all(axis=0)
        assert untouched.any()
        # Exactly, except where a faint edge of a shadow was missed by the one or the other.
        assert np.mean(after[:, untouched] == 0) > 0.99
