"""Rendering of frames: layers equal the truth, radiance depends on its seed alone."""

import gc
import weakref
from pathlib import Path
from types import ModuleType
from typing import Any

import cv2
import mitsuba as mi
import numpy as np
import pytest

from solver.instrument.arrays import Floats
from tests.draws import scene_seed
from vbaa_bench.assembly.experiment import Experiment
from vbaa_bench.assembly.plan import Plan, plan
from vbaa_bench.assembly.pose import Pose
from vbaa_bench.assembly.scene_assembler import SceneAssembler
from vbaa_bench.render import frame as rendering
from vbaa_bench.render import pilots as pilot_samples
from vbaa_bench.render.frame import NoiseTarget, StaticLayer, render_frame
from vbaa_bench.render.layers import Layers, every_pixel
from vbaa_bench.render.tracing import SETS, Traced, trace
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.world import World
from vbaa_bench.scene.load import load_scene


@pytest.fixture(scope="module")
def work(small_scene: Path) -> Plan:
    return plan(load_scene(small_scene))


@pytest.fixture(scope="module")
def poses(small_scene: Path, work: Plan) -> list[Pose]:
    file, made = load_scene(small_scene), []
    for spec in sorted(work.frame_specs, key=lambda spec: spec.index):
        experiment = Experiment(file.scene, work.rig, spec.push, file.path.parent)
        made.append(Pose(experiment, spec, experiment.states()[spec.step]))
    return made


@pytest.fixture(scope="module")
def assembler(small_scene: Path, work: Plan, variant: str) -> SceneAssembler:
    activate(variant, 2)
    return SceneAssembler(load_scene(small_scene).scene, work.rig, small_scene.parent)


@pytest.fixture(scope="module")
def world(assembler: SceneAssembler, poses: list[Pose]) -> World:
    return assembler.pushed_world(poses[0])


@pytest.fixture(scope="module")
def seen(world: World) -> Layers:
    return every_pixel(world)


def coarse(radiance: Floats) -> Floats:
    """A sensor of much noise: shots that grow with the square root of light."""
    return np.asarray(0.01 * np.sqrt(np.maximum(radiance, 1e-4)))


TARGET = NoiseTarget(coarse)


@pytest.fixture(scope="module")
def ground(world: World) -> StaticLayer:
    return rendering.render_static_layer(world, TARGET, scene_seed(1))


def test_arc_length_and_depth_are_those_of_the_beam(
    world: World, seen: Layers, poses: list[Pose]
) -> None:
    state = poses[0].state
    v, u = np.nonzero(seen.beam_mask)
    assert len(np.unique(u)) > 430  # the beam is continuous from the hub to its tip
    assert np.diff(np.unique(u)).max() == 1
    s, x, y, z = state.centreline.T
    assert (z == 0).all()
    arc = seen.arc_length_mm[v, u] * 1e-3
    place = np.column_stack([np.interp(arc, s, x), np.interp(arc, s, y), np.zeros(len(arc))])
    pixels = world.camera.project(place)
    radius_px = 700 * 0.4e-3 / 0.36
    assert np.linalg.norm(pixels - np.column_stack([u, v]), axis=1).max() < 1.1 * radius_px
    depth = seen.depth_mm[v, u] * 1e-3
    axis = (place @ world.camera.camera_from_antenna[2, :3]) + world.camera.camera_from_antenna[
        2, 3
    ]
    # The visible surface lies up to one radius in front of the centreline.
    assert (axis - depth > -2e-5).all()
    assert (axis - depth < 0.42e-3).all()


def test_every_surface_has_its_index(world: World, seen: Layers) -> None:
    assert world.names == ("beam", "hub", "background", "object")
    assert set(np.unique(seen.object_index)) == {1, 2, 3, 4}
    assert ((seen.object_index == 1) == (seen.beam_mask > 0)).all()
    assert (seen.arc_length_mm[seen.object_index != 1] == 0).all()


@pytest.mark.thorough
def test_tracing_chosen_pixels_agrees_with_the_renderer(world: World, seen: Layers) -> None:
    v, u = np.nonzero(seen.beam_mask)
    pixels = np.column_stack([u, v])
    found = trace(world, pixels, np.full(len(pixels), 64), scene_seed(5), "whole")
    film = mi.render(world.scene, sensor=world.sensor, spp=64, seed=mi.UInt32(scene_seed(77)))
    reference = np.asarray(film)[pixels[:, 1], pixels[:, 0], 0]
    # The mean over the beam's pixels; a path of 64 samples errs by 3 % in each. See
    # test_unbiased for smaller differences.
    assert found.radiance.mean() == pytest.approx(reference.mean(), rel=0.008)
    assert (found.coverage > 0).all()


def test_the_variance_is_that_from_picture_to_picture(world: World, seen: Layers) -> None:
    v, u = np.nonzero(seen.beam_mask)
    pixels = np.column_stack([u, v])[::5]
    size = np.full(len(pixels), 9)
    images = [trace(world, pixels, size, scene_seed(seed), "whole") for seed in range(24)]
    spread = np.var([found.radiance for found in images], axis=0, ddof=1).mean()
    stated = np.mean([found.variance for found in images])
    assert stated == pytest.approx(spread, rel=0.3)


@pytest.mark.thorough
def test_the_same_seed_gives_the_same_bits_whatever_came_before(
    assembler: SceneAssembler, world: World, poses: list[Pose], seen: Layers, ground: StaticLayer
) -> None:
    first, *_, last = poses
    one = render_frame(world, ground, TARGET, scene_seed(5))
    assembler.repose(world, last)
    assert (render_frame(world, ground, TARGET, scene_seed(5)).radiance != one.radiance).any()
    assembler.repose(world, first)
    again = render_frame(world, ground, TARGET, scene_seed(5))
    assert (again.layers.arc_length_mm == seen.arc_length_mm).all()
    assert (again.radiance == one.radiance).all()
    assert (again.variance == one.variance).all()
    assert (render_frame(world, ground, TARGET, scene_seed(6)).radiance != one.radiance).any()


@pytest.mark.thorough
def test_layers_traced_where_surfaces_move_equal_those_of_the_whole_image(
    assembler: SceneAssembler, world: World, poses: list[Pose], ground: StaticLayer
) -> None:
    assembler.repose(world, poses[-1])
    found, whole = render_frame(world, ground, TARGET, scene_seed(5)).layers, every_pixel(world)
    assembler.repose(world, poses[0])
    for layer in ("object_index", "depth_mm", "normal", "arc_length_mm", "occlusion"):
        assert (getattr(found, layer) == getattr(whole, layer)).all(), layer


@pytest.mark.thorough
def test_the_noise_near_the_beam_reaches_its_target(world: World, ground: StaticLayer) -> None:
    if is_scalar():
        pytest.skip("without wavefronts every pixel gets the same samples")
    images = [render_frame(world, ground, TARGET, scene_seed(seed)) for seed in range(12)]
    radiance = np.array([image.radiance for image in images])
    near = cv2.dilate(images[0].layers.beam_mask.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    ratio = radiance.std(axis=0, ddof=1)[near] / coarse(radiance.mean(axis=0))[near]
    # Twelve images estimate a standard deviation to a fifth.
    assert np.median(ratio) < 1 / 3
    assert np.quantile(ratio, 0.95) < 0.45
    # Where nothing that moves is seen or shades, all images equal the static layer.
    affected = images[0].affected
    assert 0.05 < affected.mean() < 0.98
    assert (radiance[:, ~affected] == ground.radiance[~affected]).all()
    assert all((image.samples[~affected] == 0).all() for image in images)
    # Elsewhere a pixel is left out by chance, with a probability of at most 3/4.
    often = np.mean([image.samples >= SETS for image in images], axis=0)[affected]
    assert often.mean() > 0.25


def test_the_beam_is_white_on_a_dark_ground(
    world: World, seen: Layers, ground: StaticLayer
) -> None:
    image = render_frame(world, ground, TARGET, scene_seed(1)).radiance
    core, sheet = image[seen.beam_mask], image[seen.object_index == 3]
    assert np.median(core) > 8 * np.median(sheet)
    assert image.min() >= 0


def test_a_frame_without_a_static_layer_equals_one_with_it(
    world: World, ground: StaticLayer
) -> None:
    alone, onto = (
        render_frame(world, static, TARGET, scene_seed(3)).radiance for static in (None, ground)
    )
    assert alone.mean() == pytest.approx(onto.mean(), rel=0.003)


@pytest.mark.parametrize("module", [pilot_samples, rendering], ids=["pilots", "samples"])
def test_pixels_without_a_radiance_become_no_gray_values(
    module: ModuleType, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*arguments: Any) -> Traced:
        traced = trace(*arguments)
        traced.radiance[7] = np.nan
        return traced

    if is_scalar() and module is pilot_samples:
        pytest.skip("a scalar variant has no pilots")
    monkeypatch.setattr(module, "trace", broken)
    with pytest.raises(ArithmeticError, match="pixels have no radiance"):
        render_frame(world, None, TARGET, 3)


def test_a_mesh_of_another_size_is_refused(world: World) -> None:
    with pytest.raises(ValueError, match="vertices"):
        world.move({"object": np.zeros((3, 3))})


def test_a_world_that_has_moved_is_freed_without_garbage_collection(
    assembler: SceneAssembler, poses: list[Pose]
) -> None:
    """Its materials would be in the kernels of the next world."""
    gc.disable()
    try:
        moved = assembler.pushed_world(poses[0])
        assembler.repose(moved, poses[1])
        every_pixel(moved)
        reference = weakref.ref(moved)
        del moved
        assert reference() is None
    finally:
        gc.enable()
