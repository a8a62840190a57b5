"""Many noisy images of one pose against a plain renderer's: their mean is the same everywhere."""

from dataclasses import dataclass

import cv2
import mitsuba as mi
import numpy as np
import numpy.typing as npt
import pytest
from scipy import stats

from results.render_speed.image_error import Line, beam_line
from solver.instrument.arrays import Floats
from tests.draws import scene_seed, seeded
from vbaa_bench.assembly.plan import plan
from vbaa_bench.generation.frame_renderer import FrameRenderer
from vbaa_bench.render.camera import sensor_dict
from vbaa_bench.render.frame import (
    NoiseTarget,
    RenderedRadiance,
    StaticLayer,
    render_frame,
    render_static_layer,
)
from vbaa_bench.render.loading import load
from vbaa_bench.render.variant import PLAIN
from vbaa_bench.render.world import World
from vbaa_bench.scene.load import load_scene

pytestmark = pytest.mark.thorough

Mask = npt.NDArray[np.bool_]

# A soft lamp and a point; a sheet that hides the contact; hub, beam, object and their shadows.
SCENE = seeded("""
title: Beam, contact, object, hub and a sheet over them, from near by
seed: 5
camera:
  width_px: 144
  height_px: 48
  focal_length_px: 1000
  position_mm: [24.0, 2.0, 360.0]
  look_at_mm: [24.2, 0.5, 0.0]
  roll_deg: 0.6
  tip_in_view: false
calibration: {columns: 6, rows: 3, square_mm: 4, center_mm: [24.0, 0.5]}
lights:
  - {kind: area, position_mm: [40.0, -200.0, 420.0]}
  - {kind: spot, position_mm: [0.0, -150.0, 500.0]}
occlusion: {kind: [sheet], place: [contact], availability: [0.97]}
pushes: {contact_distance_mm: [30], deflection_pct: [10]}
""")
# At the beam's edge images and references contribute equally to the uncertainty of the ratio of
# means, 0.12 %.
IMAGES, REFERENCES, SAMPLES = 28, 22, 144
# The chance that any region of an unbiased renderer is taken for biased.
FALSE_ALARM = 1e-5
# The render's noise over the sensor's: so much that a pixel gets a few samples.
COARSE = (3.0, 3.0, 1.0)
FINE = (0.3, 0.3, 0.1)


@dataclass(frozen=True)
class Seen:
    """Images (n, h, w), each on its own static layer, and plain renders (m, h, w), of one pose;
    the regions of the image, and the beam's path."""

    images: Floats
    references: Floats
    regions: dict[str, Mask]
    line: Line


@pytest.fixture(scope="module")
def seen(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Seen:
    if variant == PLAIN:
        pytest.skip("slow without LLVM, and the same")
    path = tmp_path_factory.mktemp("unbiased") / "near.yaml"
    path.write_text(SCENE, encoding="utf-8")
    file = load_scene(path)
    work = plan(file)
    renderer = FrameRenderer(file.scene, work.rig, path.parent, variant, 2)
    pose = renderer.pose(work.frame_specs[0])
    world = renderer.pushed_world(pose)
    noise = renderer.sensor(renderer.measure_exposure()).noise_sigma
    coarse, fine = NoiseTarget(noise, 4, *COARSE), NoiseTarget(noise, 4, *FINE)
    images = [
        render_frame(
            world,
            render_static_layer(world, coarse, scene_seed(1000 + seed)),
            coarse,
            scene_seed(seed),
        ).radiance
        for seed in range(IMAGES)
    ]
    references = plain_renders(world)
    ground = render_static_layer(world, fine, scene_seed(1))
    regions = regions_of(world, render_frame(world, ground, fine, scene_seed(2)), ground)
    return Seen(np.array(images), references, regions, beam_line(renderer.rig, pose))


def plain_renders(world: World) -> Floats:
    """The whole frame by Mitsuba's own path integrator and multijittered sampler."""
    described = sensor_dict(world.camera, world.unit.render_from_antenna)
    described["to_world"] = mi.ScalarTransform4f(described["to_world"])
    sensor = load({**described, "sampler": {"type": "multijitter", "sample_count": SAMPLES}})
    integrator = load({"type": "path", "max_depth": 2})
    films = [
        mi.render(
            world.scene,
            sensor=sensor,
            integrator=integrator,
            spp=SAMPLES,
            seed=mi.UInt32(scene_seed(5000 + s)),
        )
        for s in range(REFERENCES)
    ]
    return np.array([np.asarray(film)[..., 0] for film in films], dtype=np.float64)


def regions_of(world: World, seen: RenderedRadiance, ground: StaticLayer) -> dict[str, Mask]:
    """Masks (h, w): the inner pixels of every surface, and the edges that move."""
    index = seen.layers.object_index
    surface = {name: index == number for number, name in enumerate(world.names, start=1)}
    alone = seen.coverage == 0
    light, unshaded = seen.radiance, ground.radiance
    rim = grown(surface["occluder"]) & grown(~surface["occluder"])
    floor = ~grown(~surface["background"]) & alone & ~rim
    return {
        "beam core": (seen.coverage > 0.95) & ~rim,
        "beam edge": (seen.coverage > 0.02) & (seen.coverage < 0.95) & ~rim,
        "shadow": floor & (light < 0.9 * unshaded),
        "occluder's edge": rim,
        "ground": floor & (light > 0.97 * unshaded),
        "moving object": ~grown(~surface["object"]) & alone,
        "hub": ~grown(~surface["hub"]) & alone,
    }


def grown(mask: Mask) -> Mask:
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)


def biased(images: Floats, references: Floats, regions: dict[str, Mask]) -> dict[str, float]:
    """The relative difference of means wherever chance does not explain it.

    Welch's t test of each region's mean, from image to image, with Bonferroni's limit.
    """
    found = {}
    for name, where in regions.items():
        ours, plain = images[:, where].mean(axis=1), references[:, where].mean(axis=1)
        chance = stats.ttest_ind(ours, plain, equal_var=False).pvalue
        if chance < FALSE_ALARM / len(regions):
            found[name] = float(ours.mean() / plain.mean() - 1)
    return found


def test_every_region_is_there(seen: Seen) -> None:
    assert min(where.sum() for where in seen.regions.values()) > 60


@pytest.mark.false_alarm(FALSE_ALARM, "Welch's t test with Bonferroni's limit")
def test_no_region_is_biased(seen: Seen) -> None:
    assert biased(seen.images, seen.references, seen.regions) == {}


def test_a_bias_of_an_eightieth_at_the_beams_edge_is_found(seen: Seen) -> None:
    edge = seen.regions["beam edge"]
    # From no bias at all, so that what is found does not hang on what chance brought.
    level = seen.references[:, edge].mean() / seen.images[:, edge].mean()
    assert biased(seen.images * level, seen.references, {"beam edge": edge}) == {}
    for factor in (1.0125, 0.9875):
        wrong = np.where(edge, factor * level * seen.images, seen.images)
        found = biased(wrong, seen.references, seen.regions)
        assert found == {"beam edge": pytest.approx(factor - 1)}


def test_the_centroid_is_not_biased(seen: Seen) -> None:
    ours, plain = seen.images.mean(axis=0), seen.references.mean(axis=0)
    apart = seen.line.centroids(ours, plain) - seen.line.centroids(plain, plain)
    clear = ~np.isnan(apart)
    assert clear.sum() > 80
    assert abs(apart[clear].mean()) < 0.0035  # +- 0.0006
