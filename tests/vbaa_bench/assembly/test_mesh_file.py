import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from solver.instrument.errors import InputError
from solver.instrument.transforms import rigid
from vbaa_bench.assembly import mesh_file
from vbaa_bench.dataset.scene_files import read_file
from vbaa_bench.geometry.solids import box
from vbaa_bench.scene.files import MAX_BYTES
from vbaa_bench.scene.objects.cylinder import cylinder
from vbaa_bench.scene.objects.knife_edge import knife_edge
from vbaa_bench.scene.objects.mesh import touching
from vbaa_bench.scene.objects.sphere import sphere

RADIUS = 0.4e-3

# A cube as drawing programs write it: quadrangles, whose corners have texture and normals.
TEXTURED = """mtllib no_such_file.mtl
usemtl paint
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
vt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\nvn 0 1 0
f 4/1/1 3/2/1 2/3/1 1/1/1\nf 5/1/1 6/2/1 7/3/1 8/1/1\nf 1/2/2 2/1/2 6/3/2 5/2/2
f 2/1/1 3/1/1 7/1/1 6/1/1\nf 3/2/1 4/2/1 8/2/1 7/2/1\nf 4/3/2 1/3/2 5/3/2 8/3/2
"""


def read_mesh(path: Path, unit_m: float) -> trimesh.Trimesh:
    return mesh_file.read_mesh(read_file(path.parent, path.name, "mesh"), unit_m)


def cuboid() -> trimesh.Trimesh:
    return box(np.array([1.0, 2.0, 3.0]), np.array([3.0, 5.0, 7.0]))


def written(path: Path, mesh: trimesh.Trimesh, scale: float = 1.0) -> Path:
    trimesh.Trimesh(mesh.vertices * scale, mesh.faces, process=False).export(path)
    return path


@pytest.mark.parametrize("name", ["a.stl", "a.obj", "a.ply", "A.STL"])
def test_a_solid_is_read_in_its_unit(tmp_path: Path, name: str) -> None:
    mesh = read_mesh(written(tmp_path / name, cuboid()), 1e-3)
    assert mesh.is_watertight
    assert len(mesh.vertices) == 10
    assert mesh.bounds == pytest.approx(np.array([[1, 2, 3], [3, 5, 7]]) * 1e-3, abs=1e-9)
    assert mesh.volume == pytest.approx(24e-9)


@pytest.mark.parametrize("unit", [1e-9, 1.0])
def test_vertices_are_merged_by_the_meshs_own_size(tmp_path: Path, unit: float) -> None:
    mesh = read_mesh(written(tmp_path / "a.stl", cuboid()), unit)
    assert len(mesh.vertices) == 10
    assert mesh.extents == pytest.approx(np.array([2, 3, 4]) * unit, abs=1e-6 * unit)


def test_slivers_that_vanish_with_merged_vertices_leave_the_mesh_closed(tmp_path: Path) -> None:
    mesh = cuboid()
    p, q = mesh.faces[0, :2]
    # A vertex hardly off p divides the edge pq, and with it the faces to either side.
    split = []
    for face in mesh.faces.tolist():
        if p in face and q in face:
            split += [[10 if v == p else v for v in face], [10 if v == q else v for v in face]]
        else:
            split.append(face)
    between = mesh.vertices[p] + 1e-10 * (mesh.vertices[q] - mesh.vertices[p])
    divided = trimesh.Trimesh(np.vstack([mesh.vertices, between]), split, process=False)
    assert len(divided.faces) == 18
    found = read_mesh(written(tmp_path / "a.obj", divided), 1e-3)
    assert len(found.faces) == 16
    assert found.volume == pytest.approx(24e-9)


def test_a_solid_wound_inward_is_turned_outward(tmp_path: Path) -> None:
    inward = cuboid()
    inward.invert()
    mesh = read_mesh(written(tmp_path / "a.ply", inward), 1e-3)
    assert mesh.volume == pytest.approx(24e-9)
    outermost = np.argmax(mesh.triangles_center[:, 1])
    assert mesh.face_normals[outermost] == pytest.approx([0, 1, 0])


def test_texture_normals_and_materials_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text(TEXTURED)
    mesh = read_mesh(path, 1e-2)
    assert mesh.volume == pytest.approx(1e-6)
    assert len(mesh.vertices) == 8


def test_all_objects_of_a_file_make_one_mesh(tmp_path: Path) -> None:
    second = "".join(
        "f " + " ".join(str(int(corner.split("/")[0]) + 8) for corner in line.split()[1:]) + "\n"
        for line in TEXTURED.splitlines()
        if line.startswith("f ")
    )
    corners = "".join(
        f"v {int(line.split()[1]) + 3} {line[4:]}\n"
        for line in TEXTURED.splitlines()
        if line.startswith("v ")
    )
    path = tmp_path / "a.obj"
    path.write_text(TEXTURED + "o second\n" + corners + second)
    mesh = read_mesh(path, 1e-2)
    assert mesh.volume == pytest.approx(2e-6)
    assert mesh.extents == pytest.approx([0.04, 0.01, 0.01])


def open_box() -> trimesh.Trimesh:
    mesh = cuboid()
    mesh.update_faces(np.arange(len(mesh.faces) - 1))
    return mesh


def ill_wound() -> trimesh.Trimesh:
    mesh = cuboid()
    faces = mesh.faces.copy()
    faces[0] = faces[0][::-1]
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def huge() -> trimesh.Trimesh:
    mesh = cuboid()
    return trimesh.Trimesh(mesh.vertices, np.tile(mesh.faces, (12501, 1)), process=False)


def flat() -> trimesh.Trimesh:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 1]], process=False)


@pytest.mark.parametrize(
    ("mesh", "scale", "sentence"),
    [
        (open_box(), 1.0, "is not closed, allowed is a watertight mesh"),
        (ill_wound(), 1.0, "is wound inconsistently, allowed is one orientation"),
        (flat(), 1.0, "encloses no volume, allowed is a solid"),
        (
            cuboid(),
            1e5,
            "is 400 m large with its unit of 0.001 m, allowed are 1e-09 to 10 m",
        ),
        (
            cuboid(),
            1e-7,
            "is 4e-10 m large with its unit of 0.001 m, allowed are 1e-09 to 10 m",
        ),
        (huge(), 1.0, "has 200016 faces, allowed are 200000"),
    ],
)
def test_what_is_not_a_solid_is_refused(
    tmp_path: Path, mesh: trimesh.Trimesh, scale: float, sentence: str
) -> None:
    path = written(tmp_path / "a.ply", mesh, scale)
    with pytest.raises(InputError) as refusal:
        read_mesh(path, 1e-3)
    assert str(refusal.value) == f"{path}: {sentence}"


POINTS = """ply
format ascii 1.0
element vertex 2
property float x
property float y
property float z
end_header
0 0 0
1 1 1
"""
ASTRAY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 -1
"""


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.step", b"", "has the suffix '.step', allowed are .stl, .obj, .ply"),
        ("a", b"", "has the suffix '', allowed are .stl, .obj, .ply"),
        ("a.stl", b"", "has no faces, allowed is a closed mesh"),
        ("a.obj", b"nothing of the kind\n" * 20, "has no faces, allowed is a closed mesh"),
        ("a.ply", b"nothing of the kind\n" * 20, "is not a .ply mesh that can be read"),
        ("a.stl", bytes(range(128, 256)) * 9, "is not a .stl mesh that can be read"),
        ("a.obj", TEXTURED.encode() + b"f 1 2 99\n", "is not a .obj mesh that can be read"),
        (
            "a.obj",
            b"v 0 0 0\nv 1 0 0\nv 0 1\nf 1 2 3\n",
            "has a vertex without three coordinates, or a face without three",
        ),
        ("a.ply", POINTS.encode(), "has no faces, allowed is a closed mesh"),
        ("a.ply", ASTRAY.encode(), "has faces with undefined vertices"),
    ],
)
def test_what_is_not_a_mesh_is_refused(
    tmp_path: Path, name: str, content: bytes, sentence: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError) as refusal:
        read_mesh(path, 1e-3)
    assert str(refusal.value) == f"{path}: {sentence}"


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_vertex_that_is_no_number_is_refused(tmp_path: Path, value: float) -> None:
    path = written(tmp_path / "a.stl", cuboid())
    content = bytearray(path.read_bytes())
    content[96:100] = struct.pack("<f", value)
    path.write_bytes(content)
    with pytest.raises(InputError, match="has a vertex that is not finite, allowed are numbers"):
        read_mesh(path, 1e-3)


def test_a_file_that_is_missing_cut_short_or_vast_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    with pytest.raises(InputError, match=r"a\.stl: cannot be read \(No such file or directory\)"):
        read_mesh(path, 1e-3)
    written(path, cuboid())
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(InputError, match=r"a\.stl: is not a \.stl mesh that can be read"):
        read_mesh(path, 1e-3)
    with path.open("wb") as vast:
        vast.truncate(MAX_BYTES["mesh"] + 10**6)  # a file with a hole: it takes no room
    with pytest.raises(InputError, match=r"a\.stl: has 101 MB, allowed are 100 MB"):
        read_mesh(path, 1e-3)


@pytest.mark.parametrize("level", [0.0, 0.2e-3, -3e-3])
def test_a_sphere_touches_the_beam_at_the_sum_of_their_radii(level: float) -> None:
    ball = sphere(0.005)
    ball.apply_translation([0.03, 0.7, level])
    found = touching(ball, RADIUS)
    middle = (found.bounds[0] + found.bounds[1]) / 2
    # Off the pole the sphere's facets lie up to a few micrometres inside it.
    expected = RADIUS - np.sqrt((0.005 + RADIUS) ** 2 - level**2) - 0.005
    tolerance = 1e-12 if level == 0 else 5e-6
    assert found.vertices[:, 1].max() - 0.005 == pytest.approx(expected + 0.005, abs=tolerance)
    assert middle[0] == pytest.approx(0.03)
    assert middle[2] == pytest.approx(level, abs=1e-12)


@pytest.mark.parametrize("top", [0.01, 0.0, -0.5 * RADIUS, -0.999 * RADIUS])
def test_a_box_touches_with_its_face_or_with_its_upper_edge(top: float) -> None:
    thing = box(np.array([0.0, -1.0, -0.02]), np.array([0.05, -0.3, top]))
    moved = touching(thing, RADIUS)
    rise = 0.0 if top >= 0 else RADIUS - np.sqrt(RADIUS**2 - top**2)
    assert moved.bounds[1, 1] == pytest.approx(rise, abs=1e-12)
    assert moved.bounds[:, [0, 2]] == pytest.approx(thing.bounds[:, [0, 2]])


@pytest.mark.parametrize("lean", [-1.2, -0.4, 0.3, 1.0])
@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_a_leaning_edge_is_a_tangent_of_the_beam(lean: float, turn: float) -> None:
    knife = knife_edge(0.04, 0.03, 0.5)
    turned = rigid(np.array([0, turn, 0]), np.zeros(3))
    knife.apply_transform(rigid(np.array([lean, 0, 0]), np.array([0.0, 0.1, 0.0])) @ turned)
    moved = touching(knife, RADIUS)
    # The apex still leans as it did; the beam's middle is a radius above it.
    apex = moved.vertices[0]
    normal = np.array([0, np.cos(lean), np.sin(lean)])
    assert normal @ (np.array([0, RADIUS, 0]) - apex) == pytest.approx(RADIUS, abs=1e-12)


def test_an_object_made_to_touch_stays_where_it_is() -> None:
    thing = cylinder(0.01, -0.01, 0.002)
    assert touching(thing, RADIUS).vertices == pytest.approx(thing.vertices, abs=1e-15)


@pytest.mark.parametrize("top", [-RADIUS, -0.002])
def test_a_mesh_beside_the_beam_is_refused(top: float) -> None:
    thing = box(np.array([0.0, -1.0, -0.02]), np.array([0.05, -0.3, top]))
    with pytest.raises(InputError, match=r"spans z = -20 to -.* mm, beside the beam.* 0\.4 mm of"):
        touching(thing, RADIUS)
