"""Datasets of older formats are migrated in memory, those of newer ones are refused."""

import json
import shutil
from pathlib import Path

import polars as pl
import pytest

from solver.instrument.errors import InputError
from tests.sealing import reseal
from vbaa_bench.dataset import format_version, identity
from vbaa_bench.dataset.document import read_json
from vbaa_bench.dataset.layout import Layout
from vbaa_bench.dataset.readers import open_truth
from vbaa_bench.scene.load import load_scene


@pytest.fixture
def copied(dataset: Path, tmp_path: Path) -> Layout:
    return Layout(shutil.copytree(dataset, tmp_path / "copy"))


def rewritten(layout: Layout, path: Path, **changes: object) -> None:
    document = read_json(path)
    for key, value in changes.items():
        if value is None:
            del document[key]
        else:
            document[key] = value
    path.write_text(json.dumps(document), encoding="utf-8")
    reseal(layout)


def test_both_records_state_the_version(dataset: Path) -> None:
    layout = Layout(dataset)
    assert read_json(layout.manifest)["schema"] == format_version.SCHEMA
    assert read_json(layout.identity)["schema"] == format_version.SCHEMA
    assert open_truth(layout.truth).manifest["schema"] == format_version.SCHEMA


def test_the_first_format_is_migrated_in_memory(copied: Layout) -> None:
    rewritten(copied, copied.manifest, schema=None)
    shard = copied.shard(copied.truth, 0) / "truth.parquet"
    pl.read_parquet(shard).drop("processor", strict=False).write_parquet(shard)
    reseal(copied)
    before = copied.manifest.read_bytes()
    truth = open_truth(copied.truth)
    assert truth.manifest["failed_frames"] == 0
    assert truth.manifest["schema"] == format_version.SCHEMA
    assert "processor" in truth.frames.columns
    assert copied.manifest.read_bytes() == before
    old = {"scene": {"title": "Old", "seed": 1}, "code": {}}
    new = format_version.migrated_identity(copied.identity, old)
    assert new == {"scene": {"seed": 1}, "code": {}, "schema": format_version.SCHEMA}


@pytest.mark.parametrize(
    ("version", "sentence"),
    [
        (format_version.SCHEMA + 1, "install a newer vbaa-bench"),
        (0, "allowed is a whole number"),
        (True, "allowed is a whole number"),
        ("2", "allowed is a whole number"),
    ],
)
def test_a_newer_or_odd_version_is_one_sentence(
    copied: Layout, version: object, sentence: str
) -> None:
    rewritten(copied, copied.manifest, schema=version)
    with pytest.raises(InputError, match=sentence):
        open_truth(copied.truth)


def test_a_dataset_of_an_older_format_cannot_be_completed(
    copied: Layout, small_scene: Path, variant: str
) -> None:
    rewritten(copied, copied.identity, schema=None)
    here = identity.dataset_identity(load_scene(small_scene), variant)
    with pytest.raises(InputError, match=r"an older format.*--fork"):
        identity.check_identity(copied, here)
