"""Datasets rendered once for all tests: four pushes of the reference rig in a strip of an image."""

import fcntl
import gc
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import drjit
import numpy as np
import pytest
from hypothesis import settings

from solver.antenna import Antenna
from solver.instrument.observation import Observations, open_observations
from solver.set_up import set_up
from tests import COLLECTING
from tests.draws import SEED, generator, seeded
from vbaa_bench.generation.generate import generate
from vbaa_bench.render.variant import choose
from vbaa_bench.scene.load import load_scene
from vbaa_bench.workers.kernels import reference_variables

# Test files that take longest, first: no worker process begins one when the others have no more.
# The first compiles the solver's functions. Those of rendering and mechanics need none of them: no
# second process compiles the same functions at the same time.
_LONGEST: Final = (
    "end_to_end/test_generate.py",
    "vbaa_bench/generation/test_failures.py",
    "vbaa_bench/workers/test_pool.py",
    "vbaa_bench/generation/test_same_images.py",
    "vbaa_bench/render/test_frame_rendering.py",
    "vbaa_bench/render/test_interreflection.py",
    "vbaa_bench/render/test_hidden_strip.py",
    "vbaa_bench/render/test_lights.py",
    "vbaa_bench/mechanics/test_friction.py",
    "vbaa_bench/mechanics/test_rod.py",
    "vbaa_bench/scene/test_load.py",
    "agreement/test_touching.py",
    "vbaa_bench/workers/test_cluster.py",
    "vbaa_bench/render/test_unbiased.py",
    "results/test_calibration.py",
    "results/test_limits.py",
    "end_to_end/test_collection.py",
    "end_to_end/test_command_line.py",
    "solver/learning/test_learn.py",
    "end_to_end/test_worlds.py",
    "end_to_end/test_regression.py",
    "end_to_end/test_damage.py",
    "vbaa_bench/cli/test_data.py",
    "solver/photographs/test_solve.py",
    "solver/centreline/test_beam.py",
)

# The same examples on every machine, others for another seed, and no deadline on a loaded machine.
settings.register_profile(
    "fixed", derandomize=SEED == 0, database=None, deadline=None, max_examples=60
)
settings.load_profile("fixed")

ALL_LAYERS = """
layers: [radiance, variance, beam_mask, coverage, arc_length, depth, normal, object_index,
  occlusion]
"""
SCENE_TEXT = f"""
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
SMALL_SCENE = seeded(SCENE_TEXT)


@pytest.hookimpl(tryfirst=True)  # before hypothesis, which reads its seed
def pytest_configure(config: pytest.Config) -> None:
    """Set the seed of hypothesis, and what costs time beside other worker processes."""
    config.option.hypothesis_seed = str(SEED)  # does not matter to the profile of seed 0
    # What a test writes need not survive a power failure: it waits for no disk.
    os.fsync = lambda fd: None  # noqa: ARG005  # the name is part of its type
    # The worker processes of the tests make data as those of the product do: to the same bytes.
    os.environ |= reference_variables()
    if "PYTEST_XDIST_WORKER" in os.environ:
        # Kernels in one thread: those that wait for each other take a third more time, or more.
        drjit.set_thread_count(1)
        drjit.set_thread_count = lambda _count: None


@pytest.hookimpl(tryfirst=True)  # before -m chooses by marker
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order the test files for worker processes, which take one file after the other.

    Tests of the laboratory and of robustness are thorough ones.
    """
    for item in items:
        if item.path.relative_to(Path(__file__).parent).parts[0] in {"results", "robustness"}:
            item.add_marker("thorough")
    rank = {Path(__file__).parent / name: number for number, name in enumerate(_LONGEST)}
    items.sort(key=lambda item: rank.get(item.path, len(rank)))


def pytest_collection_finish() -> None:
    """Let the next worker process collect."""
    if COLLECTING is not None:
        os.close(COLLECTING)


@pytest.hookimpl(tryfirst=True)  # before the loop of a worker process, which is such a hook
def pytest_runtestloop() -> None:
    """Leave modules and tests out of garbage collections, each of which would search them all."""
    gc.freeze()
    gc.enable()


@pytest.fixture
def random(request: pytest.FixtureRequest) -> np.random.Generator:
    """Return the generator of the numbers that this test draws (tests/draws.py)."""
    return generator(request.node.nodeid)


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
    """A complete dataset, rendered by the first worker process. Not to be written to: copy it."""
    root = tmp_path_factory.mktemp("data") / "small"
    of_all_workers = tmp_path_factory.getbasetemp().parent
    if "PYTEST_XDIST_WORKER" not in os.environ:
        of_all_workers = root.parent
    rendered = of_all_workers / "rendered"
    with (of_all_workers / "rendered.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # the others wait for the first, and find it complete
        generate(load_scene(small_scene), rendered, variant, 0, lambda _done, _total: None)
    shutil.copytree(rendered, root)
    yield root
    for path in root.rglob(f".*{os.getpid()}.part"):
        pytest.fail(f"{path} was left behind")


@pytest.fixture(scope="session")
def observations(dataset: Path) -> Observations:
    """Open the observations of the dataset, as a laboratory has them."""
    return open_observations(dataset / "observations")


@pytest.fixture(scope="session")
def antenna(observations: Observations) -> Antenna:
    """Calibrate the dataset's camera and learn its beam at rest."""
    return set_up(observations)
