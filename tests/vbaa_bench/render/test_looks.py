"""Clamp, clutter, table edge, grime and ambient light: as plain Mitsuba renders them."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from results.render_speed.plain import Plain
from solver.instrument.arrays import Floats
from tests.draws import scene_seed, seeded
from vbaa_bench.assembly.plan import plan
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.render.frame import NoiseTarget, render_frame, render_static_layer
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.scene.load import load_scene

SCENE = seeded("""
title: All looks at once, from afar
seed: 8
camera: {width_px: 96, height_px: 40, focal_length_px: 112, tip_in_view: true,
  position_mm: [100, 10, 360], look_at_mm: [106, 12, 0]}
calibration: {columns: 8, rows: 5, square_mm: 10, center_mm: [106.0, 12.0]}
clamp: {jaw_mm: [20, 12, 8]}
clutter: {count: 14, size_mm: [15, 60]}
background: {pattern: textured, correlation_mm: 10, reflectance: 0.3, fixed_to: FIXED,
  edge: {distance_mm: 45, azimuth_deg: 80, drop_mm: 150}}
beam: {diameter_mm: 3, youngs_modulus_gpa: 5, grime: {dust_pct: 10}, tip: cut}
ambient: {irradiance: 0.4}
lights: [{kind: area}]
pushes: {contact_distance_mm: [140], deflection_pct: [5, 10]}
""")
IMAGES, REFERENCES, SAMPLES = 8, 6, 196
FALSE_ALARM = 1e-5


@pytest.mark.thorough
@pytest.mark.false_alarm(FALSE_ALARM, "Welch's t test with Bonferroni's limit")
@pytest.mark.parametrize("fixed_to", ["antenna", "world"])
def test_no_surface_is_biased(fixed_to: str, tmp_path: Path, variant: str) -> None:
    if variant == PLAIN:
        pytest.skip("slow without LLVM, and the same")
    path = tmp_path / "looks.yaml"
    path.write_text(SCENE.replace("FIXED", fixed_to), encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    renderer = FrameRenderer(file.scene, work.rig, tmp_path, variant, 2)
    first, last = (renderer.pose(spec) for spec in sorted(work.frame_specs, key=lambda s: s.index))
    # The world is made in another pose than that of the images.
    renderer.pushed_world(first)
    world = renderer.pushed_world(last)
    assert world.names[0] == "beam"
    ground = {"background", "floor", "table_side", "clutter_matt", "clutter_gloss", "clutter_bare"}
    clamp = {"hub", "jaw", "screw", "flange", "cable"}
    assert set(world.names) == {"beam", "object"} | clamp | ground
    assert world.moving == {"beam", "object"} | (set() if fixed_to == "antenna" else ground)
    target = NoiseTarget(lambda radiance: np.asarray(0.1 * radiance + 1e-3), 4, 2.0, 2.0, 0.7)
    images = []
    for seed in range(IMAGES):
        static = render_static_layer(world, target, scene_seed(1000 + seed))
        images.append(render_frame(world, static, target, scene_seed(seed)))
    plain = Plain(world, "multijitter")
    references = np.array(
        [plain.radiance(SAMPLES, scene_seed(50 + seed)) for seed in range(REFERENCES)]
    )
    index, found = images[0].layers.object_index, {}
    assert images[0].layers.beam_mask[index == 1].all()
    radiance = np.array([image.radiance for image in images])
    regions = {n: index == i for i, n in enumerate(world.names, 1) if (index == i).sum() > 8}
    assert len(regions) >= 5
    regions["all"] = index >= 0
    for name, where in regions.items():
        chance = _chance(radiance[:, where], references[:, where])
        if chance < FALSE_ALARM / len(regions):
            found[name] = radiance[:, where].mean() / references[:, where].mean() - 1
    assert found == {}


def _chance(ours: Floats, theirs: Floats) -> float:
    """Welch's t test of a region's mean, from image to image."""
    means = ours.mean(axis=1), theirs.mean(axis=1)
    return float(stats.ttest_ind(*means, equal_var=False).pvalue)
