"""A suite with the small dataset of the tests, and submissions to it."""

import shutil
from pathlib import Path

from vbaa_bench.dataset.target import target
from vbaa_bench.scene.load import load_scene
from vbaa_bench.suite.folder import SuiteFolder, create_folder

SUITE = """
version: small
title: A suite for the tests
reference: {{variant: {variant}, target: "{target}"}}
metrics: [error_pct_L, rmse_over_limit, answered_pct, within_3_sigma_pct, sigma_over_rmse,
  time_over_reference, ms_median]
rules:
  reads: Observations only.
  frame_limit_s: 60
  memory_gb: 8
  repeats: 1
  failure_error_pct: 50
  consistent_sigmas: 3
  refusals: They count as failures.
  ties: They are ties.
  speed: It is measured.
tracks:
  one:
    about: Four pushes.
    datasets:
      pushes: {{scene: "{scene}", seed: {seed}, frames: 4}}
real:
  about: Pushes and weights.
  min_loads: 20
  min_places: 4
  reads: Images only.
  ranks: There are none.
"""
METHOD = """
name: mine
suite: "{suite}"
authors: [A. Person, B. Person]
licence: Apache-2.0
hardware: an abacus
link: https://example.org/mine
"""
CODE = """
from solver import Estimate, Outcome


def halfway(measurement):
    return Estimate(Outcome.CONTACT, values={"x_c_m": 0.12, "force_n": 0.05})
"""


def write_suite(folder: Path, scene: Path, variant: str) -> Path:
    """Write the file of the suite; return its path."""
    path = folder / "small.yaml"
    seed = load_scene(scene).scene.seed
    text = SUITE.format(variant=variant, target=target(variant), scene=scene, seed=seed)
    path.write_text(text, encoding="utf-8")
    return path


def folder_with(root: Path, suite: Path, dataset: Path) -> SuiteFolder:
    """Make the folder of a run of the suite that has its dataset already."""
    folder = create_folder(root, str(suite))
    (entry,) = folder.suite.entries()
    shutil.copytree(dataset, folder.results(entry).root)
    return folder


def write_submission(folder: Path, suite: Path, text: str, files: dict[str, str]) -> Path:
    """Write a submission of this further text of method.yaml, and files by name."""
    folder.mkdir()
    method = METHOD.format(suite=suite) + text
    for name, content in {"method.yaml": method, **files}.items():
        (folder / name).write_text(content, encoding="utf-8")
    return folder
