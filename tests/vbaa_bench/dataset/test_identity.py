"""A dataset is that of its files, not only of their names; that of another scene is beside it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.conftest import SCENE_TEXT, SMALL_SCENE
from vbaa_bench.dataset.collection import CollectionLayout, fork_of_collection
from vbaa_bench.dataset.identity import (
    OtherDatasetError,
    check_identity,
    dataset_identity,
    fork_of_dataset,
    write_identity,
)
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.scene.load import SceneFile, load_scene

VARIANT = "llvm_ad_mono"


def scene(folder: Path, **changes: tuple[str, str]) -> SceneFile:
    text = SCENE_TEXT
    for old, new in changes.values():
        assert old in text
        text = text.replace(old, new)
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scene(path)


def begun(file: SceneFile, root: Path) -> None:
    write_identity(Layout(root), dataset_identity(file, VARIANT))


def test_the_first_folder_that_is_free_or_holds_this_dataset(tmp_path: Path) -> None:
    root = tmp_path / "data"
    one = scene(tmp_path)
    assert fork_of_dataset(one, root, VARIANT) == root
    begun(one, root)
    assert fork_of_dataset(one, root, VARIANT) == root
    two = scene(tmp_path, seed=("seed: 11", "seed: 12"))
    assert fork_of_dataset(two, root, VARIANT) == tmp_path / "data-2"
    (tmp_path / "data-2").mkdir()
    (tmp_path / "data-2" / "thesis.tex").touch()
    assert fork_of_dataset(two, root, VARIANT) == tmp_path / "data-3"
    begun(two, tmp_path / "data-3")
    assert fork_of_dataset(two, root, VARIANT) == tmp_path / "data-3"


def test_a_refusal_names_five_changes_and_counts_the_rest(tmp_path: Path) -> None:
    root = tmp_path / "data"
    begun(scene(tmp_path), root)
    other = scene(
        tmp_path,
        seed=("seed: 11", "seed: 12"),
        size=("width_px: 512", "width_px: 500"),
        board=("columns: 20, rows: 5", "columns: 19, rows: 4"),
        views=("views: 6", "views: 7"),
        rest=("rest_images: 2", "rest_images: 3"),
        shard=("frames_per_shard: 2", "frames_per_shard: 3"),
    )
    with pytest.raises(OtherDatasetError) as refusal:
        check_identity(Layout(root), dataset_identity(other, VARIANT))
    assert "calibration.columns 20 -> 19" in str(refusal.value)
    assert str(refusal.value).count("->") == 5
    assert "and 2 more" in str(refusal.value)
    assert "--fork" in str(refusal.value)


def test_a_subset_is_not_grown(tmp_path: Path) -> None:
    file = scene(tmp_path)
    identity = dataset_identity(file, VARIANT)
    write_identity(Layout(tmp_path / "data"), {**identity, "subset": {"frames": 2}})
    with pytest.raises(OtherDatasetError, match="make it again with vbaa-bench subset"):
        check_identity(Layout(tmp_path / "data"), identity)


def test_collections_fork_too(tmp_path: Path) -> None:
    rigs = ("seed: 11", "seed: 11\nrigs: 2")
    length = ("views: 6", "views: 6}\nbeam: {length_mm: {uniform: [239, 241]}")
    one = scene(tmp_path, rigs=rigs, length=length)
    layout = CollectionLayout(tmp_path / "rigs")
    assert layout.check_scene(one.template, {}) == "empty"
    layout.write_scene(one.template, {})
    assert layout.check_scene(one.template, {}) == "same"
    layout.scene.write_text("damaged")
    assert layout.check_scene(one.template, {}) == "same"
    layout.write_scene(one.template, {})
    assert fork_of_collection(one, layout.root) == layout.root
    three = scene(tmp_path, rigs=(rigs[0], "seed: 11\nrigs: 3"), length=length)
    assert layout.check_scene(three.template, {}) == "smaller"
    other = scene(tmp_path, rigs=("seed: 11", "seed: 12\nrigs: 2"), length=length)
    assert fork_of_collection(other, layout.root) == tmp_path / "rigs-2"
    with pytest.raises(OtherDatasetError, match=r"\(seed 11 -> 12\)"):
        layout.check_scene(other.template, {})


EXTRA = """
background: {pattern: image, image_file: table.png}
object: {kind: block, texture: {kind: image, file: label.png}}
"""


def test_images_of_surfaces_belong_to_the_identity(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SMALL_SCENE + EXTRA, encoding="utf-8")
    identities = []
    for number in range(3):
        values = np.full((2, 2), 100, np.uint8)
        cv2.imwrite(str(tmp_path / "table.png"), values + (number == 1))
        cv2.imwrite(str(tmp_path / "label.png"), values + (number == 2))
        identities.append(dataset_identity(load_scene(path), VARIANT)["files"])
    assert set(identities[0]) == {"table.png", "label.png"}
    first, *others = identities
    changed = [{name for name in first if first[name] != other[name]} for other in others]
    assert changed == [{"table.png"}, {"label.png"}]
