"""A short fuzz of every kind of input; `vbaa-bench fuzz` is the long one."""

import shutil
from collections import Counter
from pathlib import Path

import polars as pl
import pytest

from vbaa_bench.api import results
from vbaa_bench.benchmarks.fuzz.case import ALLOWED, Case
from vbaa_bench.benchmarks.fuzz.child import Runner
from vbaa_bench.benchmarks.fuzz.kinds import KINDS
from vbaa_bench.dataset.collection import CollectionLayout
from vbaa_bench.regression.baseline import write_baseline
from vbaa_bench.regression.scored_run import read_run

SCENES = Path(__file__).parents[4] / "scenes"
# Fewer of those that score and report: a case takes a tenth of a second.
COUNTS = {
    "scenes": 40,
    "rigs": 15,
    "tables": 15,
    "images": 150,
    "predictions": 15,
    "records": 15,
    "settings": 40,
}


@pytest.fixture(scope="module")
def material(dataset: Path, small_scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The material of the command, from the dataset of the tests; its predictions are the truth."""
    folder = tmp_path_factory.mktemp("material")
    for name in ("scenes", "files"):
        shutil.copytree(SCENES / "objects", folder / name)
    shutil.copy(small_scene, folder / "dataset.yaml")
    for root in (folder / "dataset", folder / "collection" / "rig_00000"):
        shutil.copytree(dataset, root)
    tables = sorted((dataset / "truth").rglob("truth.parquet"))
    truth = pl.concat(map(pl.read_parquet, tables), how="diagonal_relaxed")
    predictions = folder / "dataset" / "predictions"
    predictions.mkdir()
    truth.select("frame_id", "x_c_mm", "force_n").write_csv(predictions / "two_point.csv")
    results.score(folder / "dataset")
    write_baseline(read_run(folder / "dataset"), folder / "baseline.json")
    collection = CollectionLayout(folder / "collection")
    collection.scene.write_text('{"title": "One rig"}', encoding="utf-8")
    collection.write_rows({0: {"rig": "0", "seed": "11", "reason": None}})
    return folder


def test_all_kinds_of_input_are_accepted_or_refused(material: Path, tmp_path: Path) -> None:
    assert COUNTS.keys() == KINDS.keys()
    runner = Runner(KINDS, 2, material, tmp_path / "work")
    for kind, count in COUNTS.items():
        outcomes: Counter[str] = Counter()
        for number in range(count):
            result = runner.run(Case(kind, number))
            assert result.outcome in ALLOWED, f"{kind} {number}: {result.text}"
            outcomes[result.outcome] += 1
        # Mistakes are made, and not all inputs are beyond use.
        assert outcomes["refused"]
        assert outcomes["accepted"], kind
