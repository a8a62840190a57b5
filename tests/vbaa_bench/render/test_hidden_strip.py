"""The strip of a lamp that the beam hides: shadows come from it, and no mean depends on it."""

import copy
import itertools
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import trimesh

from solver.instrument.arrays import Floats
from tests.draws import scene_seed
from tests.vbaa_bench.render.test_thin_beams import CAMERA, MIDDLE, beam, world_before
from vbaa_bench.geometry.sheets import rectangle, sheet
from vbaa_bench.geometry.tube import arc_length_of_vertices, tube
from vbaa_bench.render.device_array import index_of
from vbaa_bench.render.hidden_strip import HiddenStrip
from vbaa_bench.render.surface import RenderUnit, Surface
from vbaa_bench.render.tracing import Quantity, trace
from vbaa_bench.render.variant import activate, is_scalar
from vbaa_bench.render.world import World
from vbaa_bench.scene.lights.emitter import Lamp

ABOVE = sheet(np.array([0.12, 0.0, 0.42]), 0.7, -1)
TILTED = rectangle(
    np.array([0.02, -0.3, 0.3]), np.array([0.1, 0.3, -0.3]), np.array([1.0, 0.3, 0.0]), (0.4, 0.1)
)
LENGTH, RINGS, FACETS = 0.024, 60, 24
# Places on the ground [m], along and across, from where the beam's middle hides the lamp's.
PLACES = np.array([[0, 0], [0, 1.5], [0, -4], [8, 3], [-10, 0.5], [11.5, 1]]) * 1e-3
SAMPLES = 400_000
QUANTITIES: tuple[Quantity, ...] = ("whole", "change")


@pytest.fixture(scope="module", autouse=True)
def _renderer(variant: str) -> None:
    activate(variant, 2)
    if is_scalar():
        pytest.skip("without wavefronts whole images are rendered")


def bent(rise: float) -> Floats:
    """Centreline (n, 3) [m] of an arc in plane C, whose tip is raised."""
    t = np.linspace(-0.5, 0.5, RINGS)
    arc = np.column_stack([LENGTH * t, 0.15 * LENGTH * (t + 0.5) ** 2, rise * (t + 0.5) ** 2])
    return np.asarray(MIDDLE + arc)


def world_of(lamp: trimesh.Trimesh, rise: float) -> World:
    skin = tube(bent(rise), 3e-4, FACETS, caps_apart=True)
    s = arc_length_of_vertices(np.linspace(0, LENGTH, RINGS), FACETS)
    ground = sheet(MIDDLE - [0, 0, 0.01], 2.0, 1)
    surfaces = {
        "beam": Surface(skin, 0.8, arc_length=s, smooth=True),
        "background": Surface(ground, 0.4),
    }
    unit = RenderUnit(3e-4, MIDDLE)
    return World(CAMERA, Lamp(lamp), surfaces, unit, still={"background"})


@pytest.mark.parametrize("rise", [0.0, 0.004])
@pytest.mark.parametrize("lamp", [ABOVE, TILTED], ids=["above", "tilted"])
def test_it_is_what_rays_to_the_lamp_meet(lamp: trimesh.Trimesh, rise: float) -> None:
    world = world_of(lamp, rise)
    (strip,) = world.hidden_strips.values()
    (emitter,) = world.scene.emitters()
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(scene_seed(1), SAMPLES)
    hidden = np.zeros(2)
    towards = np.asarray(lamp.vertices).mean(axis=0) - MIDDLE
    for place in PLACES - 0.01 * towards[:2] / towards[2]:
        point = world.unit(MIDDLE + np.append(place, -0.01))
        si = dr.zeros(mi.SurfaceInteraction3f, SAMPLES)
        si.p, si.n = mi.Point3f(*point.tolist()), mi.Normal3f(0, 0, 1)
        u = sampler.next_2d()
        ray = si.spawn_ray_to(emitter.sample_direction(si, u)[0].p)
        meets = np.asarray(world.scene.ray_test(ray))
        strata = strip.strata(si.p, mi.UInt32(4))
        along, across = (u.y, u.x) if strip.upright else (u.x, u.y)
        lower, length = strata.overlap(along)
        inside = np.asarray((across >= lower) & (across <= lower + length))
        # The strip is a little wider than the polygon that the rays meet, and has square ends.
        hidden += meets.mean(), inside.mean()
        assert (meets & ~inside).mean() <= 0.015 * meets.mean() + 20 / SAMPLES
        assert (inside & ~meets).mean() < 0.04 * inside.mean() + 20 / SAMPLES
    assert hidden[0] > 0.01


@pytest.mark.thorough
@pytest.mark.parametrize("shift", [0.0, 0.5, 30.0])
def test_the_mean_does_not_depend_on_the_strip(shift: float) -> None:
    """`shift` is by how many radii the strip is wrong."""
    world = world_of(ABOVE, 0.0)
    (name, right), rows_columns = next(iter(world.hidden_strips.items())), np.mgrid[0:40:3, 0:56:3]
    pixels = rows_columns.reshape(2, -1).T[:, ::-1]
    wrong = copy.copy(right)
    wrong.beam = right.beam._replace(y=right.beam.y + shift)
    sums = []
    for strips in ({}, {name: wrong}):
        vars(world)["hidden_strips"] = strips
        images = [
            trace(
                world, pixels, np.full(len(pixels), 8), scene_seed(100 * seed), "change", 32
            ).radiance
            for seed in range(24)
        ]
        sums.append(np.sum(images, axis=1))
    one, other = sums
    error = np.hypot(one.std(ddof=1), other.std(ddof=1)) / np.sqrt(len(one))
    assert abs(one.mean() - other.mean()) < 4.5 * error
    assert error < 0.05 * abs(one.mean())


@pytest.mark.thorough
def test_shadows_have_less_noise() -> None:
    world = world_of(ABOVE, 0.0)
    pixels = np.mgrid[0:40:3, 0:56:3].reshape(2, -1).T[:, ::-1]
    strips, noise = world.hidden_strips, []
    for used in (strips, {}):
        vars(world)["hidden_strips"] = used
        found = trace(world, pixels, np.full(len(pixels), 4), scene_seed(3), "change", 64)
        noise.append(np.sqrt(np.median(found.variance)))
    # What is left is that of the place in the pixel.
    assert noise[0] < 0.2 * noise[1]


def test_a_beam_that_turns_back_or_passes_the_lamp_has_none() -> None:
    angle = np.linspace(-2.5, 1.0, 40)
    line = np.column_stack([np.sin(angle), 1 - np.cos(angle), 0 * angle - 3])
    rings = line[:, None] + np.array([[0.0, 0.01, 0], [0, 0, 0.01], [0, -0.01, 0], [0, 0, -0.01]])
    facing_down = np.diag([1.0, -1.0, -1.0, 1.0])
    assert HiddenStrip.of(rings, facing_down) is None
    assert HiddenStrip.of(rings[20:], facing_down) is not None
    assert HiddenStrip.of(rings[20:] + np.array([0, 0, 4]), facing_down) is None


@pytest.mark.parametrize("rise", [0.0, 0.004])
def test_a_beam_hides_nothing_from_points_that_are_not_behind_it(
    rise: float, capfd: pytest.CaptureFixture[str]
) -> None:
    """Points in the plane of the lamp are on the lamp itself, if the camera sees it."""
    (strip,) = world_of(TILTED, rise).hidden_strips.values()
    z = np.asarray(strip.beam.z)
    heights = [-3.0, 0.0, 1e-30, 0.5 * z.min(), z.min(), z.mean(), z[200]]
    x = [0.0, *np.asarray(strip.beam.ends), strip.half_sides[0], 1e30]
    points = np.array(list(itertools.product(x, [0.0, 3.0], heights)))
    with dr.scoped_set_flag(dr.JitFlag.Debug, True):
        for along in (0.0, 0.5, 1.0):
            overlap = strip.overlap(mi.Point3f(*map(mi.Float, points.T)), mi.Float(along))
            lower, length = (np.asarray(values) for values in overlap)
            assert np.isfinite(lower).all()
            assert (length[points[:, 2] <= z.min()] == 0).all()
            assert ((length >= 0) & (length <= 1)).all()
    assert "out-of-bounds" not in capfd.readouterr().err


def test_places_outside_of_an_array_have_the_index_of_its_end() -> None:
    places = mi.Float([-np.inf, -1, -0.0, 0.9, 1, 2.5, 3, 1e30, np.inf, np.nan])
    assert np.asarray(index_of(places, 3)).tolist() == [0, 0, 0, 0, 1, 2, 2, 2, 2, 0]


@pytest.mark.thorough
@pytest.mark.parametrize("distortion", [(), (-0.3, 0.0, 0.0, 0.0, 0.0)], ids=["ideal", "distorted"])
def test_a_world_that_moves_renders_what_it_renders_anew(distortion: tuple[float, ...]) -> None:
    """Kernels are recorded for the beam's first place, and repeated for the others."""
    camera = replace(CAMERA, distortion=distortion)
    world = world_before(camera)
    pixels, size = np.argwhere(np.ones((40, 56)))[:, ::-1], np.full(40 * 56, 4)
    for angle_deg in (3.0, 30.0, 80.0, 85.0):
        world.move({"beam": beam(2.0, angle_deg, 0.3)})
        repeated = [trace(world, pixels, size, scene_seed(5), quantity) for quantity in QUANTITIES]
        world._frozen = {}
        anew = [trace(world, pixels, size, scene_seed(5), quantity) for quantity in QUANTITIES]
        for one, other in zip(repeated, anew, strict=True):
            assert (one.radiance == other.radiance).all()
            assert one.radiance.any()
            assert (one.coverage == other.coverage).all()
