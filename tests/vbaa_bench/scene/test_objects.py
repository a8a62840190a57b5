from collections.abc import Callable

import numpy as np
import pytest
import trimesh

from solver.instrument.arrays import Floats
from solver.instrument.errors import InputError
from vbaa_bench.geometry.clamp import adaptor
from vbaa_bench.geometry.solids import slab
from vbaa_bench.scene.objects.block import block
from vbaa_bench.scene.objects.cylinder import cylinder
from vbaa_bench.scene.objects.knife_edge import knife_edge
from vbaa_bench.scene.objects.pad import pad
from vbaa_bench.scene.objects.plunger import plunger
from vbaa_bench.scene.objects.sphere import sphere
from vbaa_bench.scene.objects.wall import wall
from vbaa_bench.scene.objects.weight import weight

BEAM_RADIUS = 0.4e-3

OBJECTS: dict[str, tuple[Callable[[], trimesh.Trimesh], float]] = {
    "edge block": (lambda: block(0.012, -0.015, 0.001), 0.012**2 * 0.016),
    "cylinder": (lambda: cylinder(0.05, -0.015, 0.002), np.pi * 0.05**2 * 0.017),
    "small cylinder": (lambda: cylinder(0.5e-3, -0.015, 0.002), np.pi * 0.5e-3**2 * 0.017),
    "sphere": (lambda: sphere(0.05), 4 / 3 * np.pi * 0.05**3),
    "small sphere": (lambda: sphere(0.5e-3), 4 / 3 * np.pi * 0.5e-3**3),
    "knife edge": (lambda: knife_edge(0.02, 0.01, 0.3), 0.01**2 * np.tan(0.3) * 0.02),
    "wall": (lambda: wall(0.03, 0.005, -0.01, 0.002), 0.03 * 0.005 * 0.012),
    "pad": (
        lambda: pad(0.02, 0.01, 0.05, -0.01, 0.004, 0.0, BEAM_RADIUS),
        # The box less the circular segment that its face cuts off to either side.
        0.014 * (0.02 * 0.01 - (0.02 * 0.05 - 0.01 * np.sqrt(0.05**2 - 0.01**2)
                                - 0.05**2 * np.arcsin(0.2))),
    ),
}  # fmt: skip


def pressed_pad(dent: float, face_radius: float = 0.05, radius: float = 0.4e-3) -> trimesh.Trimesh:
    return pad(0.02, 0.01, face_radius, -0.01, 0.004, dent, radius)


def pressed_plunger(compression: float) -> trimesh.Trimesh:
    return plunger(0.003, compression, 0.01, -0.004, 0.003)


@pytest.mark.parametrize("name", OBJECTS)
def test_an_object_is_closed_outward_and_of_its_volume(name: str) -> None:
    build, volume = OBJECTS[name]
    mesh = build()
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(volume, rel=2e-3)


@pytest.mark.parametrize("name", [*OBJECTS, "plunger"])
def test_an_object_touches_the_origin_from_below(name: str) -> None:
    mesh = pressed_plunger(0.002) if name == "plunger" else OBJECTS[name][0]()
    assert mesh.vertices[:, 1].max() == pytest.approx(0, abs=1e-9)
    # What lies in y = 0 is a point, a line or a rectangle, with the origin in it.
    touched = mesh.vertices[mesh.vertices[:, 1] > -1e-9]
    assert (touched.min(axis=0) < 1e-9).all()
    assert (touched.max(axis=0) > -1e-9).all()
    if name != "wall":
        assert touched[:, 0] == pytest.approx(0, abs=1e-9)


def spread_over(triangles: Floats, parts: int) -> Floats:
    """Points (n, 3) on each of the triangles (m, 3, 3), their rims included."""
    a, b = (grid.ravel() / parts for grid in np.mgrid[0 : parts + 1, 0 : parts + 1])
    weights = np.column_stack([a, b, 1 - a - b])[a + b <= 1 + 1e-9]
    return np.asarray(np.einsum("kj,fjx->fkx", weights, triangles).reshape(-1, 3))


@pytest.mark.thorough
@pytest.mark.parametrize("radius", [0.5e-3, 5e-3, 0.05])
def test_round_objects_are_round_to_a_micrometre_where_they_are_touched(radius: float) -> None:
    for mesh, across in ((cylinder(radius, -0.01, 0.002), [0, 1]), (sphere(radius), [0, 1, 2])):
        points = spread_over(mesh.triangles[np.abs(mesh.face_normals[:, 2]) < 0.9], 8)
        offset = points[:, across] + np.array([0, radius, 0])[: len(across)]
        near = offset[:, 1] > 0.9 * radius
        error = np.linalg.norm(offset[near], axis=1) - radius
        assert near.any()
        assert error.min() > -1e-6
        assert error.max() < 1e-12


def test_a_block_shows_its_edge_to_the_beam() -> None:
    mesh = block(0.012, -0.015, 0.001)
    edge = mesh.vertices[np.linalg.norm(mesh.vertices[:, :2], axis=1) < 1e-12]
    assert sorted(edge[:, 2]) == [-0.015, 0.001]
    assert mesh.vertices[:, 1].min() == pytest.approx(-0.012 * np.sqrt(2))
    assert mesh.bounds[:, 0] == pytest.approx([-0.012 / np.sqrt(2), 0.012 / np.sqrt(2)])


def test_a_knife_opens_with_its_half_angle() -> None:
    mesh = knife_edge(0.02, 0.01, 0.3)
    flanks = mesh.face_normals[mesh.face_normals[:, 1] > 0.1]
    assert np.abs(flanks[:, 0]) == pytest.approx(np.cos(0.3))
    assert flanks[:, 1] == pytest.approx(np.sin(0.3))
    apex = mesh.vertices[np.abs(mesh.vertices[:, 1]) < 1e-12]
    assert sorted(apex[:, 2]) == [-0.01, 0.01]


def test_every_body_of_a_plunger_is_closed_and_outward() -> None:
    bodies = pressed_plunger(0.002).split(only_watertight=False)
    assert len(bodies) == 4
    for body in bodies:
        assert body.is_watertight
        assert body.volume > 0


def test_compression_shortens_the_coil_and_leaves_nose_and_topology() -> None:
    free, pressed = pressed_plunger(0.0), pressed_plunger(0.004)
    assert (free.faces == pressed.faces).all()
    nose = free.vertices[:, 1] > -0.001
    assert nose.any()
    assert (free.vertices[nose] == pressed.vertices[nose]).all()

    def housing(mesh: trimesh.Trimesh) -> float:
        bodies = mesh.split(only_watertight=False)
        return min(float(body.bounds[1, 1]) for body in bodies)

    assert housing(free) == pytest.approx(-0.003 - 0.01)
    assert housing(pressed) == pytest.approx(-0.003 - 0.006)
    # The stem, the slimmest body, stays within the housing, whose back is the plunger's.
    for mesh in (free, pressed_plunger(0.0075)):
        stem = min(mesh.split(only_watertight=False), key=lambda body: float(body.extents[0]))
        assert mesh.bounds[0, 1] < stem.bounds[0, 1] < housing(mesh)


def test_a_plunger_cannot_be_pressed_beyond_its_solid_coil() -> None:
    with pytest.raises(InputError, match=r"pressed in by 9\.9 mm, allowed is 0 to 7\.5 mm"):
        plunger(0.003, 0.0099, 0.01, -0.004, 0.003)
    with pytest.raises(InputError, match="pressed in by -1 mm"):
        plunger(0.003, -0.001, 0.01, -0.004, 0.003)


@pytest.mark.thorough
@pytest.mark.parametrize("dent", [1e-5, 0.2e-3, 0.9e-3, 2e-3])
@pytest.mark.parametrize("face_radius", [0.0101, 0.05, 1.0])
@pytest.mark.parametrize("radius", [0.1e-3, 0.4e-3, 1e-3])
def test_a_dented_pad_touches_the_beam_and_does_not_cut_it(
    dent: float, face_radius: float, radius: float
) -> None:
    mesh = pressed_pad(dent, face_radius, radius)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    near = np.abs(mesh.triangles[:, :, 2]).min(axis=1) < 2 * radius
    points = spread_over(mesh.triangles[near & (mesh.face_normals[:, 1] > 0)], 3)
    distance = np.hypot(points[:, 1] - radius, points[:, 2])
    assert distance.min() == pytest.approx(radius, abs=1e-12)
    middle = points[np.abs(points[:, 0]) < 1e-9]
    assert np.linalg.norm(middle, axis=1).min() < 1e-12
    # Wherever the beam's side is below the rim it lies snugly, to a part in a thousand.
    hugged = np.abs(mesh.vertices[:, 0]) < 1e-9
    side = mesh.vertices[hugged & (mesh.vertices[:, 1] > -1e-9)]
    side = side[side[:, 1] < min(dent / 2, 0.8 * radius)]
    assert np.hypot(side[:, 1] - radius, side[:, 2]) == pytest.approx(radius, rel=1.1e-3)


def test_a_dent_leaves_the_rest_of_the_face_where_it_was() -> None:
    plain, dented = pressed_pad(0.0), pressed_pad(0.9e-3)
    assert (plain.faces == dented.faces).all()
    beside = np.abs(plain.vertices[:, 2]) > 4 * BEAM_RADIUS
    moved = dented.vertices[beside] - plain.vertices[beside]
    assert moved == pytest.approx(np.broadcast_to([0, 0.9e-3, 0], moved.shape), abs=1e-15)
    assert plain.volume - dented.volume == pytest.approx(
        # About the beam's own section below the rim, along the chord that it cuts off the face.
        2 * BEAM_RADIUS * 0.9e-3 * 2 * np.sqrt(2 * 0.05 * 0.9e-3) * 2 / 3,
        rel=0.2,
    )


def test_the_shoulders_of_a_dent_are_rounded_by_an_eighth_of_its_depth() -> None:
    dent = 0.9e-3
    mesh = pressed_pad(dent)
    middle = mesh.vertices[(np.abs(mesh.vertices[:, 0]) < 1e-9) & (mesh.vertices[:, 1] > -1e-9)]
    height, beside = middle[:, 1], np.abs(middle[:, 2])
    # The wall is the beam's tangent at 80 degrees.
    steep = np.deg2rad(80)
    wall_height = BEAM_RADIUS + (beside * np.sin(steep) - BEAM_RADIUS) / np.cos(steep)
    sharp = np.minimum(wall_height, dent)
    shoulder = beside > BEAM_RADIUS
    cut = (sharp - height)[shoulder]
    assert cut.min() == pytest.approx(0, abs=1e-15)
    assert dent / 16 < cut.max() <= dent / 8


@pytest.mark.parametrize("top", [0.1e-3, 0.4e-3, 0.5e-3])
def test_a_pad_may_end_within_the_beams_width(top: float) -> None:
    mesh = pad(0.02, 0.01, 0.05, -0.01, top, 0.9e-3, BEAM_RADIUS)
    assert mesh.is_watertight
    assert mesh.bounds[1, 2] == top
    points = spread_over(mesh.triangles[mesh.face_normals[:, 1] > 0], 3)
    assert np.hypot(points[:, 1] - BEAM_RADIUS, points[:, 2]).min() > BEAM_RADIUS - 1e-12


def test_an_impossible_pad_is_refused() -> None:
    with pytest.raises(InputError, match=r"20 mm wide .* a face of radius 9 mm"):
        pressed_pad(0.0, face_radius=0.009)
    with pytest.raises(InputError, match="dented by 10 mm, allowed is 0 to less than its"):
        pressed_pad(0.01)


@pytest.mark.parametrize("offset", [[0.004, 0.0, 0.0], [0.0, 0.003, 0.0], [0.003, -0.004, 0.001]])
def test_an_adaptor_leads_from_the_motors_axis_to_the_clamp(offset: list[float]) -> None:
    mesh = adaptor(np.array(offset), 0.5e-3)
    assert mesh.is_watertight
    length = np.linalg.norm(offset)
    assert mesh.volume == pytest.approx(np.pi * 0.5e-3**2 * length, rel=2e-3)
    along = -mesh.vertices @ np.array(offset) / length
    assert [along.min(), along.max()] == pytest.approx([0, length], abs=1e-12)
    assert mesh.center_mass == pytest.approx(-np.array(offset) / 2, abs=1e-12)


def test_a_slab_between_two_grids_is_closed_and_outward() -> None:
    x, z = np.meshgrid(np.arange(4.0), np.arange(3.0), indexing="ij")
    front = np.stack([x, np.ones_like(x), z], axis=-1)
    mesh = slab(front, front - [0, 1, 0])
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(6)


@pytest.mark.parametrize("slope", [0.0, -0.4])
def test_a_weight_hangs_below_a_loop_that_is_around_the_beam(slope: float) -> None:
    mesh = weight(BEAM_RADIUS, slope, 0.1e-3, 0.02, 5e-3, 0.012)
    assert mesh.is_watertight
    loop, thread, body = mesh.split()
    assert body.volume == pytest.approx(np.pi * 5e-3**2 * 0.012, rel=2e-3)
    assert body.bounds[:, 1] == pytest.approx([-0.032, -0.02])
    assert thread.bounds[0, 1] == pytest.approx(-0.02)
    along = np.array([1.0, slope, 0.0]) / np.hypot(1.0, slope)
    away = np.linalg.norm(loop.vertices - np.outer(loop.vertices @ along, along), axis=1)
    assert away.min() == pytest.approx(BEAM_RADIUS, rel=1e-3)
    assert np.abs(loop.vertices @ along).max() == pytest.approx(0.1e-3, rel=1e-2)
