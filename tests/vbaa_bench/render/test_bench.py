"""The rendered bench: layers that tell the truth, radiance without bias."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from vbaa_bench.experiment import Experiment
from vbaa_bench.plan import Plan, plan
from vbaa_bench.render.layers import Layers, layers
from vbaa_bench.render.picture import Sampling, picture
from vbaa_bench.render.tracing import radiance
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.world import World
from vbaa_bench.spec.load import load_scene
from vbaa_bench.studio import Pose, Studio


@pytest.fixture(scope="module")
def work(small_scene: Path) -> Plan:
    return plan(load_scene(small_scene))


@pytest.fixture(scope="module")
def poses(small_scene: Path, work: Plan) -> list[Pose]:
    file, made = load_scene(small_scene), []
    for trial in sorted(work.trials, key=lambda trial: trial.index):
        experiment = Experiment(file.scene, work.rig, trial.push, file.path.parent)
        made.append(Pose(experiment, trial, experiment.states()[trial.step]))
    return made


@pytest.fixture(scope="module")
def studio(small_scene: Path, work: Plan, variant: str) -> Studio:
    activate(variant, 2)
    return Studio(load_scene(small_scene).scene, work.rig, small_scene.parent)


@pytest.fixture(scope="module")
def world(studio: Studio, poses: list[Pose]) -> World:
    return studio.bench(poses[0])


@pytest.fixture(scope="module")
def seen(world: World) -> Layers:
    return layers(world)


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


def test_every_thing_has_its_index(world: World, seen: Layers) -> None:
    assert world.names == ("beam", "object", "hub", "background")
    assert set(np.unique(seen.object_index)) == {1, 2, 3, 4}
    assert ((seen.object_index == 1) == (seen.beam_mask > 0)).all()
    assert (seen.arc_length_mm[seen.object_index != 1] == 0).all()


def test_tracing_chosen_pixels_agrees_with_the_renderer(world: World, seen: Layers) -> None:
    v, u = np.nonzero(seen.beam_mask)
    pixels = np.column_stack([u, v])[::3]
    frames = np.array([radiance(world, pixels, 64, seed) for seed in range(8)])
    film = mi.render(world.scene, sensor=world.sensor, spp=512, seed=mi.UInt32(77))
    reference = np.asarray(film)[pixels[:, 1], pixels[:, 0], 0]
    difference = frames.mean(axis=0) - reference
    standard_error = np.sqrt(frames.var(axis=0, ddof=1) / 8 + frames.var(axis=0, ddof=1) * 64 / 512)
    # The mean over all the beam's pixels: unbiased within four standard errors.
    assert abs(difference.mean()) < 4 * np.sqrt((standard_error**2).sum()) / len(pixels)
    assert abs(difference.mean()) < 0.003 * reference.mean()


def test_the_same_seed_gives_the_same_bits_whatever_came_before(
    studio: Studio, world: World, poses: list[Pose], seen: Layers
) -> None:
    first, *_, last = poses
    sampling = Sampling(5, 16, 4)
    one = picture(world, seen.beam_mask, sampling, 5)
    studio.repose(world, last)
    assert (picture(world, layers(world).beam_mask, sampling, 5) != one).any()
    studio.repose(world, first)
    again = layers(world)
    assert (again.arc_length_mm == seen.arc_length_mm).all()
    assert (picture(world, again.beam_mask, sampling, 5) == one).all()
    assert (picture(world, again.beam_mask, sampling, 6) != one).any()


def test_the_beam_is_white_on_a_dark_ground(world: World, seen: Layers) -> None:
    if is_scalar():
        pytest.skip("slow without LLVM, and the same")
    image = picture(world, seen.beam_mask, Sampling(5, 64, 16), 1)
    core, ground = image[seen.beam_mask > 0], image[seen.object_index == 4]
    assert np.median(core) > 8 * np.median(ground)
    assert image.min() >= 0


def test_a_mesh_of_another_size_is_refused(world: World) -> None:
    with pytest.raises(ValueError, match="vertices"):
        world.move({"object": np.zeros((3, 3))})
