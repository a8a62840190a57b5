"""Files that a scene names: found by one walk, checked, copied, and read from the copies alone."""

import json
import os
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
import pytest
import trimesh

from solver.instrument.errors import DamageError, InputError
from solver.instrument.hashes import HASHES, hashes_bytes
from tests.conftest import SMALL_SCENE
from tests.sealing import reseal
from vbaa_bench.api.verification import verify
from vbaa_bench.assembly.mesh_file import SceneMeshes
from vbaa_bench.assembly.plan import check_possible
from vbaa_bench.assembly.pushes import Pushes, PushSolver
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.dataset.identity import (
    OtherDatasetError,
    check_identity,
    dataset_identity,
    write_identity,
)
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.lock import FolderError, locked
from vbaa_bench.dataset.merge import merge
from vbaa_bench.dataset.scene_files import check_copies, copy_files, file_digests, read_file
from vbaa_bench.dataset.writer import shard_writer
from vbaa_bench.generation.dataset_worker import DatasetWorker, dataset_worker
from vbaa_bench.generation.generate_collection import RigGenerator, RigResult, generate_collection
from vbaa_bench.scene.files import MAX_BYTES, SceneFileError, named_files
from vbaa_bench.scene.frames import FrameName, Frames
from vbaa_bench.scene.load import SceneFile, load_scene, recorded_scene
from vbaa_bench.scene.objects.object import ObjectSetting
from vbaa_bench.scene.random_keys import parse
from vbaa_bench.scene.rigs import true_rig
from vbaa_bench.scene.schema import Scene

DRAWN = """
object:
  choice:
    - {kind: block, texture: {kind: image, file: {choice: [a.png, b.png], per: frame}}}
    - {kind: mesh, file: a.stl}
    - {kind: mesh, file: {choice: [./meshes/b.stl]}}
  per: push
"""


def quiet(*_: object) -> None:
    pass


def write_files(folder: Path, size: float = 10.0) -> None:
    """Write the files of DRAWN; meshes are cubes of this size [mm]."""
    (folder / "meshes").mkdir(exist_ok=True)
    for name in ("a.stl", "meshes/b.stl"):
        trimesh.creation.box(extents=(size, size, size)).export(folder / name)
    for name in ("a.png", "b.png"):
        cv2.imwrite(str(folder / name), np.full((2, 2), 100, np.uint8))


@pytest.fixture
def file(tmp_path: Path) -> SceneFile:
    write_files(tmp_path)
    path = tmp_path / "scene.yaml"
    path.write_text(SMALL_SCENE + DRAWN, encoding="utf-8")
    return load_scene(path)


@pytest.fixture
def layout(file: SceneFile, tmp_path: Path) -> Layout:
    """A dataset that has been begun, with copies of the files."""
    layout = Layout(tmp_path / "set")
    identity = dataset_identity(file, "scalar_rgb")
    write_identity(layout, identity)
    copy_files(file, identity["files"], layout.files)
    return layout


def names(tree: Any) -> set[str]:
    return {named.name for named in named_files(parse(tree), Scene)}


@pytest.mark.parametrize(
    ("tree", "expected"),
    [
        ({"object": {"file": "a"}}, {"a"}),
        ({"object": {"file": {"choice": ("a", "b"), "per": "push"}}}, {"a", "b"}),
        ({"object": {"choice": ({"kind": "block"}, {"file": "a"}), "per": "push"}}, {"a"}),
        (
            {"object": {"choice": ({"texture": {"file": {"choice": ("a", "b")}}}, {"file": "c"})}},
            {"a", "b", "c"},
        ),
        ({"lights": ({"file": "a"}, {"choice": ({"file": "b"}, {"kind": "spot"})})}, {"a", "b"}),
        ({"lights": {"choice": (({"file": "a"},), ())}}, {"a"}),
        (
            {"background": {"image_file": {"choice": ("a", None), "weights": (0.0, 1.0)}}},
            {"a"},
        ),
        (
            {
                "object": {"texture": {"file": {"from": "background.image_file"}}},
                "background": {"choice": ({"image_file": "a"}, {"image_file": "b"})},
            },
            {"a", "b"},
        ),
        ({"lights": ({"kind": "spot", "file": "a"}, {"kind": "environment", "file": "b"})}, {"b"}),
        ({"title": "a", "object": {"file": {"from": "title"}}}, {"a"}),
        ({"object": {"file": {"choice": ("a", {"from": "object.file"})}}}, {"a"}),
        ({"object": {"file": {"from": "object.none"}}}, set()),
        ({"title": "a.stl", "object": {"kind": "block", "paint": "gloss"}}, set()),
    ],
)
def test_the_walk_finds_every_file_that_may_be_drawn(
    tree: dict[str, Any], expected: set[str]
) -> None:
    assert names(tree) == expected


def test_all_files_that_may_be_drawn_belong_to_the_identity(
    file: SceneFile, layout: Layout
) -> None:
    identity = json.loads(layout.identity.read_text())
    assert set(identity["files"]) == {"a.png", "b.png", "a.stl", "meshes/b.stl"}
    # So they do in the scene of a worker, which is read from the identity.
    recorded = recorded_scene({"title": "x", **identity["scene"]}, layout.identity, layout.files)
    assert file_digests(recorded) == identity["files"]
    assert check_identity(layout, dataset_identity(file, "scalar_rgb")) == "same"


@pytest.mark.parametrize("name", ["a.png", "b.png", "a.stl", "meshes/b.stl"])
def test_an_edited_file_is_refused_by_name_with_the_remedy(
    file: SceneFile, layout: Layout, tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    stat = path.stat()
    content = bytearray(path.read_bytes())
    content[40] ^= 1
    path.write_bytes(content)
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    with pytest.raises(OtherDatasetError) as caught:
        check_identity(layout, dataset_identity(file, "scalar_rgb"))
    message = f"other files than those beside the scene ({name})"
    assert message in str(caught.value)
    assert f"put back the files with which it was made, of which {layout.files}" in str(
        caught.value
    )


def test_a_copy_is_compared_whenever_it_is_read(layout: Layout, tmp_path: Path) -> None:
    read_file(layout.files, "a.stl", "mesh")
    spec, setting = mesh_spec(tmp_path), ObjectSetting(0.4e-3, -0.03, SceneMeshes(layout.files))
    assert spec.mesh(setting).is_watertight
    trimesh.creation.box(extents=(9, 10, 10)).export(layout.files / "a.stl")
    with pytest.raises(SceneFileError, match=r"a\.stl: is not the file with which the dataset"):
        spec.mesh(setting)
    (layout.files / "other.stl").write_bytes((tmp_path / "a.stl").read_bytes())
    with pytest.raises(SceneFileError, match="is not a file that the dataset's scene names"):
        read_file(layout.files, "other.stl", "mesh")


def mesh_spec(folder: Path) -> Any:
    path = folder / "mesh.yaml"
    path.write_text(f"{SMALL_SCENE}object: {{kind: mesh, file: a.stl}}\n", encoding="utf-8")
    return load_scene(path).scene.object


def test_a_mesh_that_is_edited_between_two_scenes_is_read_again(tmp_path: Path) -> None:
    write_files(tmp_path)
    spec, setting = mesh_spec(tmp_path), ObjectSetting(0.4e-3, -0.03, SceneMeshes(tmp_path))
    first = spec.mesh(setting).volume
    write_files(tmp_path, 11.0)  # a file of the same size
    assert spec.mesh(setting).volume > 1.2 * first


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.stl", None, "cannot be read (No such file or directory)"),
        ("meshes/b.stl", b"no mesh", "b.stl: has no faces"),
        ("b.png", b"no image", "is not an image that can be decoded"),
    ],
)
def test_a_file_that_cannot_be_used_is_no_impossible_draw(
    file: SceneFile, tmp_path: Path, name: str, content: bytes | None, said: str
) -> None:
    path = tmp_path / name
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content)
    with pytest.raises(SceneFileError) as caught:
        check_possible(file, quiet, quiet)
    assert said in str(caught.value)
    assert str(tmp_path / "scene.yaml") in str(caught.value)


def test_a_mesh_that_is_damaged_while_pushes_are_drawn_is_no_impossible_draw(
    layout: Layout,
) -> None:
    values = json.loads(layout.identity.read_text())["scene"]
    values["pushes"]["repeats"] = 40  # at least one of 40 pushes has a mesh
    copy = recorded_scene({"title": "x", **values}, layout.identity, layout.files)
    rig, frames = true_rig(copy.scene), Frames(copy.scene)
    pushes = Pushes(copy, rig, PushSolver(copy.scene, rig, copy.folder))
    kinds = [frames.of_push(n)[0].scene.object.kind for n in range(frames.pushes)]
    for name in ("a.stl", "meshes/b.stl"):
        (layout.files / name).unlink()
    with pytest.raises(SceneFileError, match=r"\.stl: cannot be read"):
        pushes.frames(kinds.index("mesh"))


def test_sizes_are_checked_before_a_file_is_read(tmp_path: Path) -> None:
    for kind, largest in MAX_BYTES.items():
        with (tmp_path / "vast").open("wb") as vast:
            vast.truncate(largest + 10**6)  # a file with a hole: it takes no room
        with pytest.raises(
            SceneFileError, match=f"vast: has .* MB, allowed are {largest // 10**6}"
        ):
            read_file(tmp_path, "vast", kind)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(SceneFileError, match=r"pipe: cannot be read \(it is not a regular file\)"):
        read_file(tmp_path, "pipe", "mesh")
    (tmp_path / "folder").mkdir()
    with pytest.raises(SceneFileError, match=r"folder: cannot be read \(Is a directory\)"):
        read_file(tmp_path, "folder", "mesh")


@pytest.mark.parametrize("name", ["hashes.json", "a\nb.png", "x/../a.png"])
def test_names_that_a_dataset_cannot_have_are_refused(tmp_path: Path, name: str) -> None:
    write_files(tmp_path)
    (tmp_path / "x").mkdir()
    with pytest.raises(SceneFileError, match=r"allowed is a file within it|a scene may use"):
        read_file(tmp_path, name, "image")


@pytest.fixture
def drawn_rigs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SceneFile:
    """Two rigs with one of two meshes each, which are not rendered."""
    write_files(tmp_path)
    path = tmp_path / "scene.yaml"
    text = SMALL_SCENE + "rigs: 2\n"
    text += "object: {kind: mesh, file: {choice: [a.stl, meshes/b.stl]}}\n"
    path.write_text(text, encoding="utf-8")
    results = [RigResult(0, {"rig": "0", "reason": "too stiff"}, "too stiff")]
    monkeypatch.setattr("vbaa_bench.generation.generate_collection._generate", lambda *_: results)
    return load_scene(path)


def test_a_collection_refuses_an_edited_file_before_it_writes(
    drawn_rigs: SceneFile, tmp_path: Path
) -> None:
    root = tmp_path / "rigs"
    generate_collection(drawn_rigs, root, "scalar_rgb", 0, quiet)
    layout = CollectionLayout(root)
    assert set(layout.read_files()) == {"a.stl", "meshes/b.stl"}
    whole = {one: one.read_bytes() for one in root.rglob("*") if one.is_file()}
    assert layout.files / "meshes" / "b.stl" in whole
    generate_collection(drawn_rigs, root, "scalar_rgb", 0, quiet)
    write_files(tmp_path, 11.0)
    with pytest.raises(InputError, match=r"other files than those beside the scene \(a\.stl, mes"):
        generate_collection(drawn_rigs, root, "scalar_rgb", 0, quiet)
    (tmp_path / "a.stl").unlink()
    with pytest.raises(InputError, match=r"a\.stl: cannot be read"):
        generate_collection(drawn_rigs, root, "scalar_rgb", 0, quiet)
    assert {one: one.read_bytes() for one in root.rglob("*") if one.is_file()} == whole


def test_files_of_a_collection_are_verified_and_merged(
    drawn_rigs: SceneFile, tmp_path: Path
) -> None:
    parts = [tmp_path / "one", tmp_path / "two"]
    for part in parts:
        generate_collection(drawn_rigs, part, "scalar_rgb", 0, quiet)
        assert verify(part).faults == []
    merge(parts, tmp_path / "merged")
    assert verify(tmp_path / "merged").faults == []
    copy = CollectionLayout(tmp_path / "merged").files / "meshes" / "b.stl"
    write_files(copy.parent.parent, 11.0)
    (copy.parent / "c.stl").touch()
    found = {fault.path.name for fault in verify(tmp_path / "merged").faults}
    assert found == {"a.stl", "b.stl", "c.stl", "a.png", "b.png"}
    with pytest.raises(SceneFileError, match="is not the file with which the dataset was made"):
        read_file(copy.parent.parent, "meshes/b.stl", "mesh")
    write_files(tmp_path, 11.0)
    other = tmp_path / "other"
    generate_collection(load_scene(drawn_rigs.path), other, "scalar_rgb", 0, quiet)
    with pytest.raises(InputError, match="is no part of the collection"):
        merge([parts[0], other], tmp_path / "both")


@pytest.mark.thorough
def test_an_error_of_a_file_or_of_a_folder_is_no_property_of_a_rig(
    drawn_rigs: SceneFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    errors = SceneFileError("a.stl: cannot be read"), OtherDatasetError("another")
    for error in (*errors, DamageError("truth/identity.json is missing")):

        def refused(*_: object, error: InputError = error, **__: object) -> None:
            raise error

        monkeypatch.setattr("vbaa_bench.generation.generate_collection.generate", refused)
        generator = RigGenerator(drawn_rigs, "scalar_rgb", 1)
        with pytest.raises(type(error)):
            generator.rig(quiet, 0, tmp_path / "rig", {})


def test_a_folder_that_cannot_be_written_is_no_property_of_a_rig(
    drawn_rigs: SceneFile, tmp_path: Path
) -> None:
    generator = RigGenerator(drawn_rigs, "scalar_rgb", 1)
    (tmp_path / "a_file").touch()
    with pytest.raises(FolderError, match=r"cannot be written \(Not a directory\)"):
        generator.rig(quiet, 0, tmp_path / "a_file" / "rig", {})
    (tmp_path / "rig").mkdir()
    with locked(tmp_path / "rig" / ".lock"), pytest.raises(FolderError, match="is being written"):
        generator.rig(quiet, 0, tmp_path / "rig", {})


def test_the_reason_of_an_impossible_rig_does_not_depend_on_the_folder(
    drawn_rigs: SceneFile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise InputError(f"object: {tmp_path}/a.stl: is 4 m across")

    monkeypatch.setattr("vbaa_bench.generation.generate_collection.generate", refused)
    result = RigGenerator(drawn_rigs, "scalar_rgb", 1).rig(quiet, 0, tmp_path / "rig", {})
    assert result.reason == "object: a.stl: is 4 m across"


def test_a_frame_whose_file_cannot_be_read_is_no_frame_that_failed(
    layout: Layout, monkeypatch: pytest.MonkeyPatch
) -> None:
    def frame(*_: object) -> None:
        raise SceneFileError("a.stl: cannot be read")

    monkeypatch.setattr(DatasetWorker, "frame", frame)
    worker = DatasetWorker.__new__(DatasetWorker)
    layout.observations.mkdir()
    with shard_writer(layout, 0) as writer:
        with pytest.raises(SceneFileError):
            worker._add(writer, FrameName("frame", 0), cast(Any, None), {})
        assert writer.failed == 0


def test_a_worker_renders_into_no_other_dataset(layout: Layout) -> None:
    with pytest.raises(InputError, match=r"identity\.json: has changed while the command ran"):
        dataset_worker(layout.root, "0" * 64, "scalar_rgb", 1)


def test_copies_are_compared_when_a_dataset_is_completed(file: SceneFile, layout: Layout) -> None:
    recorded = file_digests(file)
    check_copies(recorded, layout.files)
    write_files(layout.files, 11.0)
    with pytest.raises(SceneFileError, match=r"a\.stl: is not what was generated; it has changed"):
        check_copies(recorded, layout.files)


def test_a_folder_of_a_scene_may_have_the_name_of_that_of_the_copies(tmp_path: Path) -> None:
    folder = tmp_path / "files"
    folder.mkdir()
    write_files(folder)
    (tmp_path / HASHES).write_bytes(hashes_bytes({"other.csv": "0"}))
    assert read_file(folder, "a.stl", "mesh").path == folder / "a.stl"


def test_copies_are_known_from_the_hashes_where_the_identity_is_damaged(layout: Layout) -> None:
    layout.shard(layout.observations, 0).mkdir(parents=True)
    reseal(layout)
    layout.identity.write_text("{}", encoding="utf-8")
    read_file(layout.files, "meshes/b.stl", "mesh")
    write_files(layout.files, 11.0)
    with pytest.raises(SceneFileError, match="is not the file with which the dataset was made"):
        read_file(layout.files, "meshes/b.stl", "mesh")
