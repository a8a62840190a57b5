"""Valid inputs from which mistakes are made: shipped scenes, a small dataset and a collection."""

import shutil
from pathlib import Path
from typing import Final

from vbaa_bench.dataset.layout import Layout
from vbaa_bench.generation.generate import generate
from vbaa_bench.generation.generate_collection import generate_collection
from vbaa_bench.regression.baseline import write_baseline
from vbaa_bench.regression.scored_run import read_run
from vbaa_bench.render.variant import choose
from vbaa_bench.scene.load import load_scene
from vbaa_bench.scoring.isolation.runs import solve
from vbaa_bench.scoring.results_layout import Results
from vbaa_bench.scoring.score import found_predictions, score, score_rigs
from vbaa_bench.workers.resources import cores

# A strip of an image, and few frames: a case copies and reads all of it.
_SCENE: Final = """
title: A small dataset for fuzzing
seed: 11
camera:
  width_px: 512
  height_px: 176
  position_mm: [120.0, 22.0, 360.0]
  look_at_mm: [120.6, 22.0, 0.0]
calibration: {columns: 20, rows: 5, square_mm: 10, center_mm: [120.0, 22.0], views: 3}
sensor: {rest_images: 2}
frames_per_shard: 5
"""
# Nine pushes: the fewest that `compare` compares.
_DATASET: Final = f"""{_SCENE}
pushes: {{contact_distance_mm: [70, 90, 110, 130, 150, 170, 190, 210, 220], deflection_pct: [8]}}
"""
_COLLECTION: Final = f"""{_SCENE}rigs: 2
beam: {{length_mm: {{uniform: [236, 240]}}}}
pushes: {{contact_distance_mm: [150], deflection_pct: [10]}}
"""
# A baseline, an estimate of exact mechanics and one of linear mechanics.
_METHODS: Final = ("two_point", "exact_fit")


def prepare(folder: Path, scenes: Path, variant: str | None = None) -> None:
    """Copy scenes and make a scored dataset and collection, unless they exist. Raises InputError.

    FOLDER/scenes, FOLDER/files (those that scenes name), FOLDER/dataset, FOLDER/collection and
    FOLDER/baseline.json.
    """
    finished = folder / "finished"
    if finished.exists():
        return
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(scenes, folder / "scenes")
    (folder / "files").mkdir()
    for path in (folder / "scenes").rglob("*.stl"):
        shutil.copy(path, folder / "files")
    chosen, workers = choose(variant), cores()
    for name, text in {"dataset": _DATASET, "collection": _COLLECTION}.items():
        (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    file = load_scene(folder / "dataset.yaml")
    generate(file, folder / "dataset", chosen, workers, _ignore)
    _solve(folder / "dataset")
    score(Results(folder / "dataset"), found_predictions(Results(folder / "dataset")))
    file = load_scene(folder / "collection.yaml")
    generate_collection(file, folder / "collection", chosen, workers, _ignore)
    for root in sorted((folder / "collection").glob("rig_*")):
        _solve(root)
    score_rigs(folder / "collection")
    write_baseline(read_run(folder / "dataset"), folder / "baseline.json")
    finished.touch()


def _solve(root: Path) -> None:
    for method in _METHODS:
        solve(Layout(root), method, Results(root).predictions / f"{method}.csv", 1)


def _ignore(_done: int, _total: int) -> None:
    pass
