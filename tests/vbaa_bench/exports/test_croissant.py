"""Croissant documents fit their files; the task names what the scoring computes."""

import json
from pathlib import Path

import pytest

from solver.instrument.errors import DamageError
from solver.instrument.files import sha256
from tests.vbaa_bench.exports.test_formats import exported
from tests.vbaa_bench.exports.written import Size, write_collection, write_dataset
from vbaa_bench.dataset.fingerprint import others_digest
from vbaa_bench.exports import croissant, croissant_document
from vbaa_bench.exports.croissant import document_errors, write_croissant
from vbaa_bench.exports.source import open_source
from vbaa_bench.scene.shipped import frozen_frames


def test_a_document_lists_files_with_sha256_and_fields_with_units(tmp_path: Path) -> None:
    root = write_collection(tmp_path / "rigs", [Size(), Size()])
    content = json.loads(write_croissant(root).read_bytes())
    files = {node["@id"]: node for node in content["distribution"]}
    rig = files["rig_00001/observations/rig.json"]
    assert rig["sha256"] == sha256(root / rig["contentUrl"])
    assert files["images-files"]["includes"] == "rig_*/observations/shard_*/*.png"
    assert "layers-files" not in files  # the scene has none
    splits, frames, images = content["recordSet"]
    assert [row["splits/name"] for row in splits["data"]] == ["train", "test"]
    assert images["key"] == {"@id": "images/file_name"}
    fields = {field["name"]: field for field in frames["field"]}
    assert "[mm]" in fields["x_c_mm"]["description"]
    assert fields["x_c_mm"]["source"]["fileSet"] == {"@id": "truth-files"}
    assert fields["force_antenna_n"]["arrayShape"] == "3"
    assert fields["frame_id"]["references"]["fileSet"] == {"@id": "truth-files"}
    assert {"rig", "motor_angle_deg", "centreline_s_mm"} <= fields.keys()


def test_a_document_that_does_not_fit_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = write_dataset(tmp_path / "data")
    write_croissant(root)
    source = open_source(root)
    assert not list(document_errors(root, source))
    (root / "observations" / "rig.json").write_text("{} ", encoding="utf-8")
    assert list(document_errors(root, source)) == ["the sha256 of observations/rig.json differs"]
    next(root.glob("observations/shard_*/*.png")).unlink()
    assert "observations/shard_*/*.png matches 8 files, of 9 frames" in document_errors(
        root, source
    )
    other = write_dataset(tmp_path / "other")
    wrong = {"rest/rest_00.png": "0" * 64, "rig.json": "0" * 64}
    monkeypatch.setattr(
        croissant, "read_hashes", lambda tree: wrong if tree.name == "observations" else {}
    )
    with pytest.raises(DamageError, match=r"the sha256 of observations/rig\.json differs"):
        write_croissant(other)


def test_a_hugging_face_export_has_a_document_of_its_own(tmp_path: Path) -> None:
    root = write_dataset(tmp_path / "data", Size(bits=16))
    out = exported(root, "hf", tmp_path / "out")
    content = json.loads((out / "croissant.json").read_bytes())
    names = [node["@id"] for node in content["distribution"]]
    assert "data/train-00000-of-00001.parquet" in names
    assert "rigs/rig/rig.json" in names
    (image, *_) = content["recordSet"][1]["field"]
    assert image["source"]["transform"] == {"jsonPath": "bytes"}
    task = json.loads((out / "croissant_task.json").read_bytes())
    assert task["@type"] == "cr:TaskProblem"
    assert task["cr:input"]["@id"] == "croissant.json"
    answer = {field["name"]: field["dataType"] for field in task["cr:output"]["cr:schema"]["field"]}
    assert {"frame_id", "outcome", "x_c_mm", "x_c_sigma_mm", "force_n"} <= answer.keys()
    texts = {name for name, kind in answer.items() if kind == "sc:Text"}
    assert texts == {"frame_id", "outcome", "message", "assumption"}


def test_a_frozen_dataset_of_a_suite_is_part_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = write_dataset(tmp_path / "data")
    suite = tmp_path / "2.0.yaml"
    suite.write_text("version: 2.0\n", encoding="utf-8")
    monkeypatch.setattr(croissant_document, "shipped_suites", lambda: [suite])
    assert "isPartOf" not in json.loads(write_croissant(root).read_bytes())
    datasets = {"paper/fig8": {"others": others_digest(root)}, "paper/fig9": {"others": "0" * 64}}
    frozen_frames(suite).write_text(json.dumps({"datasets": datasets}), encoding="utf-8")
    (part,) = json.loads(write_croissant(root).read_bytes())["isPartOf"]
    assert part["name"] == "VBAA-Bench suite 2.0, paper/fig8"
    assert part["identifier"] == f"sha256:{sha256(suite)}"
