"""Datasets rendered once for all tests: four pushes of the reference rig in a strip of an image."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from vbaa_bench.generation.generate import generate
from vbaa_bench.render.variant import choose
from vbaa_bench.scene.load import load_scene

# The same examples on every machine, and no deadline on a loaded one.
settings.register_profile("fixed", derandomize=True, deadline=None, max_examples=60)
settings.load_profile("fixed")

ALL_LAYERS = """
layers: [radiance, variance, beam_mask, coverage, arc_length, depth, normal, object_index,
  occlusion]
"""
SMALL_SCENE = f"""
title: Four pushes for the tests
seed: 11
camera:
  width_px: 512
  height_px: 176
  position_mm: [120.0, 22.0, 360.0]
  look_at_mm: [120.6, 22.0, 0.0]
calibration: {{columns: 20, rows: 5, square_mm: 10, center_mm: [120.0, 22.0], views: 6}}
sensor: {{rest_images: 2}}
pushes:
  contact_distance_mm: [100, 200]
  deflection_pct: [10, 20]
frames_per_shard: 2
{ALL_LAYERS}"""


@pytest.fixture(scope="session")
def variant() -> str:
    return choose()


@pytest.fixture(scope="session")
def small_scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scene") / "small.yaml"
    path.write_text(SMALL_SCENE, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def dataset(
    small_scene: Path, variant: str, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Path]:
    """A complete dataset, made by one worker. Not to be written to: copy it first."""
    root = tmp_path_factory.mktemp("data") / "small"
    generate(load_scene(small_scene), root, variant, 1, lambda _done, _total: None)
    yield root
    for path in root.rglob(f".*{os.getpid()}.part"):
        pytest.fail(f"{path} was left behind")
